"""Key points: snapping, verdicts, suggestions."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from benchmarks.planning.panels import Panel, panels, tube
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
    (first, *_) = verdicts(curved_of(tube(360, 60)), points(*at), Setup())
    assert "search_radius_mm of at most 6.3" in first.remedy
    for radius, bad in ((6.2, False), (6.5, True)):
        small = Setup.model_validate({"alignment": {"search_radius_mm": radius}})
        assert bool(codes(*at, panel=tube(360, 60), setup=small)) == bad


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


def cap(radius: float, reach: float) -> Panel:
    """The cap of a sphere of this radius, `reach` mm out from its top: 96 triangles round."""
    ring = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
    out = np.linspace(0.0, reach, 40)[1:, None]
    x, y = (out * np.cos(ring)).ravel(), (out * np.sin(ring)).ravel()
    v = np.vstack([[0.0, 0.0, radius], np.column_stack([x, y, np.sqrt(radius**2 - x**2 - y**2)])])
    j, k = np.arange(96), (np.arange(96) + 1) % 96
    faces = [np.column_stack([np.zeros(96, dtype=int), 1 + j, 1 + k])]
    for i in range(38):
        a, b = 1 + 96 * i + j, 1 + 96 * i + k
        faces += [np.column_stack([a, a + 96, b + 96]), np.column_stack([a, b + 96, b])]
    return Panel("cap", v, np.vstack(faces), lambda p: p / np.linalg.norm(p, axis=1, keepdims=True))


PROBES = {
    "array": {},
    "crystal": {"probe": {"elements": 1}, "inspection": {"step_mm": 2.0}},
    "crystal of 6 mm": {"probe": {"elements": 1, "beam_width_mm": 6.0}, "inspection": {"step_mm": 4.0}},
    "short array": {"probe": {"elements": 16, "aperture_elements": 4}},
}


@pytest.mark.parametrize("share", [0.1, 0.25])
@pytest.mark.parametrize(("name", "cell"), [*product(["cap", "plate", "L", "two holes"], PROBES)])
def test_suggested_points_are_few_apart_and_draw_no_warnings(name: str, cell: str, share: float) -> None:
    """Whatever the width of the beam: a crystal runs several passes side by side through as many points as an array."""
    setup = Setup.model_validate({**PROBES[cell], "alignment": {"coverage": share}})
    panel = {"cap": cap(400.0, 150.0), "plate": plate(), "L": ell()}.get(name) or SMALL[name]
    curved = curved_of(panel, setup)
    chosen = suggest(curved, setup)
    assert verdicts(curved, chosen, setup) == []
    assert 4 <= len(chosen) <= 56
    assert pdist([k.xyz() for k in chosen]).min() > setup.alignment.search_radius_mm
    path = alignment_path(curved, chosen, setup)
    # The least there is: two strips of two points, 23 mm long, 30 mm wide, on a small plate.
    assert coverage(curved, path, setup).share == pytest.approx(share, abs=0.035)


def test_a_crystal_fills_the_search_volume_of_its_key_points() -> None:
    """Readings around each suggested point lie in a plane, not on a line: they fix the normal the method compares."""
    setup = Setup.model_validate(PROBES["crystal"])
    curved = curved_of(cap(400.0, 150.0), setup)
    chosen = suggest(curved, setup)
    path = alignment_path(curved, chosen, setup)
    data = path.Ts_part_contact.xyz_mm[path.is_data]
    for k in chosen:
        near = data[np.linalg.norm(data - k.xyz(), axis=1) <= setup.alignment.search_radius_mm]
        assert np.linalg.svd(near - near.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(near)) > 2.0


def test_on_a_part_hardly_larger_than_the_probe_points_still_stand_apart() -> None:
    for cell in PROBES.values():
        setup = Setup.model_validate(cell)
        curved = curved_of(plate(60.0, 40.0), setup)
        chosen = suggest(curved, setup)
        assert len(chosen) >= 3
        assert verdicts(curved, chosen, setup) == []


def test_another_seed_gives_other_points() -> None:
    curved = curved_of(SMALL["twist"])
    assert suggest(curved, Setup(), seed=1) != suggest(curved, Setup())
    assert suggest(curved, Setup(), seed=1) == suggest(curved, Setup(), seed=1)
