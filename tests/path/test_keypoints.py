"""Key points: snapping, verdicts, suggestions."""

from itertools import product

import numpy as np
import pytest

from benchmarks.planning.panels import panels, tube
from planner.errors import EchoBaseError
from planner.keypoint import KeyPoint
from planner.path.alignment import alignment_path
from planner.path.coverage import coverage
from planner.path.keypoints import snap, suggest, verdicts
from planner.setup import Setup
from tests.path.shapes import curved_of, ell, plate

SMALL = {p.name: p for p in panels(90, 36)}


def points(*xyz: tuple[float, float, float]) -> tuple[KeyPoint, ...]:
    return tuple(KeyPoint(id=f"K{i}", x_mm=x, y_mm=y, z_mm=z) for i, (x, y, z) in enumerate(xyz, start=1))


def codes(*xyz: tuple[float, float, float], panel: object = None, setup: Setup | None = None) -> dict[str, str]:
    panel = panel or plate()
    return {i.where: i.code for i in verdicts(curved_of(panel), points(*xyz), setup or Setup())}


def test_snap_moves_onto_the_surface_and_keeps_the_id() -> None:
    (k,) = snap(curved_of(plate()), points((50.0, 40.0, 1.5)))
    assert k.xyz() == pytest.approx((50.0, 40.0, 0.0))
    assert k.id == "K1"


def test_snap_names_every_point_that_is_off() -> None:
    with pytest.raises(EchoBaseError) as caught:
        snap(curved_of(plate()), points((50, 40, 0), (50, 40, 2.5), (-30, 40, 0)))
    assert [i.where for i in caught.value.issues] == ["keypoints: K2", "keypoints: K3"]
    assert "2.50 mm" in caught.value.issues[0].message
    assert "30.00 mm" in caught.value.issues[1].message


def test_snap_refuses_an_id_used_twice() -> None:
    one = points((50, 40, 0))[0]
    with pytest.raises(EchoBaseError, match="K1"):
        snap(curved_of(plate()), (one, one))


def test_good_points_have_no_verdict() -> None:
    assert codes((30, 30, 0), (120, 30, 0), (75, 70, 0)) == {}


def test_verdicts_say_edge_duplicate_and_line() -> None:
    found = codes((30, 30, 0), (120, 30, 0), (75, 94, 0), (120, 30.2, 0))
    assert found == {"keypoints: K3": "keypoint-near-edge", "keypoints: K4": "keypoint-duplicate"}
    assert codes((30, 30, 0), (75, 50, 0), (120, 70, 0)) == {"keypoints": "keypoints-on-a-line"}
    assert codes((30, 30, 0), (120, 70, 0)) == {"keypoints": "keypoints-on-a-line"}


def test_curvature_is_judged_by_the_search_radius() -> None:
    """R 100: a plane over 10 mm lies 10^2 / (4 x 100) = 0.25 mm off; over 5 mm 0.06."""
    at = [(x, 100 * np.cos(a), 100 * np.sin(a)) for x, a in ((100, 0.0), (200, 0.6), (300, 0.0))]
    found = codes(*at, panel=tube(360, 60))
    assert set(found.values()) == {"keypoint-curved"}
    small = Setup.model_validate({"alignment": {"search_radius_mm": 5.0}})
    assert codes(*at, panel=tube(360, 60), setup=small) == {}


CELLS = {
    "paper": {},
    "crystal": {"probe": {"elements": 1}, "inspection": {"step_mm": 2.0}},
    "no edges": {"alignment": {"edges": False}},
    "a tenth": {"alignment": {"coverage": 0.12}},
}


@pytest.mark.parametrize(
    "name, cell", [*product(["plate", "L"], CELLS), *product(["twist", "two holes"], ["paper", "no edges"])]
)
def test_suggested_points_reach_the_coverage_asked(name: str, cell: str) -> None:
    setup = Setup.model_validate(CELLS[cell])
    panel = {"plate": plate(), "L": ell()}.get(name) or SMALL[name]
    curved = curved_of(panel, setup)
    chosen = suggest(curved, setup)
    assert chosen == suggest(curved, setup)
    assert len(chosen) >= 3
    share = coverage(curved, alignment_path(curved, chosen, setup), setup).share
    assert share == pytest.approx(setup.alignment.coverage, abs=0.02)
    kept = snap(curved, chosen)
    assert np.allclose([k.xyz() for k in kept], [k.xyz() for k in chosen], atol=1e-3)
    found = {i.code for i in verdicts(curved, chosen, setup)}
    assert not found & {"keypoint-off-surface", "keypoint-duplicate", "keypoint-curved", "keypoints-on-a-line"}


def test_suggested_points_of_a_plate_keep_off_edges_and_corners() -> None:
    chosen = suggest(curved_of(plate()), Setup())
    xyz = np.array([k.xyz() for k in chosen])
    assert xyz[:, 0].min() >= 10.0
    assert xyz[:, 0].max() <= 140.0
    assert xyz[:, 1].min() >= 10.0
    assert xyz[:, 1].max() <= 90.0
    # Spread: they reach all quarters of the plate.
    assert len({(x > 75, y > 50) for x, y, _ in xyz}) == 4


def test_another_seed_gives_other_points() -> None:
    curved = curved_of(SMALL["twist"])
    assert suggest(curved, Setup(), seed=1) != suggest(curved, Setup())
    assert suggest(curved, Setup(), seed=1) == suggest(curved, Setup(), seed=1)
