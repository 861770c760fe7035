"""The alignment path: through the points, on the surface, across the edges that tell something."""

import numpy as np
import pytest

from benchmarks.planning.panels import cylinder, panels, tube
from planner.errors import EchoBaseError
from planner.keypoint import KeyPoint
from planner.part import Part, Provenance
from planner.path.alignment import alignment_path
from planner.path.coverage import coverage
from planner.path.keypoints import suggest
from planner.path.tour import short_tour
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from planner.toolpath import Role, ToolPath
from tests.path.shapes import curved_of, plate

SMALL = {p.name: p for p in panels(90, 36)}
NO_EDGES = Setup.model_validate({"alignment": {"edges": False}})


def points(*xyz: tuple[float, float, float]) -> tuple[KeyPoint, ...]:
    return tuple(KeyPoint(id=f"K{i}", x_mm=x, y_mm=y, z_mm=z) for i, (x, y, z) in enumerate(xyz, start=1))


def data_xyz(path: ToolPath) -> np.ndarray:
    return path.Ts_part_contact.xyz_mm[path.is_data]


def passes_by(path: ToolPath, xyz: tuple[float, float, float]) -> float:
    """Distance from a point to the DATA polyline."""
    d = path.take(path.is_data)
    p = d.Ts_part_contact.xyz_mm
    a, b = p[:-1], p[1:]
    same = d.pass_id[1:] == d.pass_id[:-1]
    t = np.clip(np.sum((xyz - a) * (b - a), axis=1) / np.maximum(np.sum((b - a) ** 2, axis=1), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(a + t[:, None] * (b - a) - xyz, axis=1)[same].min())


HAND = points((40, 30, 0), (110, 30, 0), (110, 70, 0), (40, 70, 0))


@pytest.mark.parametrize("setup", [Setup(), NO_EDGES])
def test_hand_picked_points_are_all_passed(setup: Setup) -> None:
    path = alignment_path(curved_of(plate()), HAND, setup)
    assert path.kind == "alignment"
    for k in HAND:
        assert passes_by(path, k.xyz()) < 1e-6


def test_points_on_a_curved_panel_are_passed_and_followed() -> None:
    panel = cylinder(100, 90)
    chosen = points(
        *[(x, 400 * np.sin(a), 400 * np.cos(a)) for x, a in ((-500, -0.3), (-100, 0.4), (300, -0.2), (600, 0.35))]
    )
    path = alignment_path(curved_of(panel), chosen, NO_EDGES)
    for k in chosen:
        assert passes_by(path, k.xyz()) < 0.05
    p = data_xyz(path)
    assert np.hypot(p[:, 1], p[:, 2]) == pytest.approx(np.full(len(p), 400.0), abs=0.01)
    n = path.Ts_part_contact.rotation_matrix[path.is_data][:, :, 2]
    assert np.degrees(np.arccos(np.clip(np.sum(n * panel.normals(p), axis=1), -1, 1))).max() < 0.1


def test_edges_are_crossed_on_all_four_sides_by_the_overrun() -> None:
    path = alignment_path(curved_of(plate()), HAND, Setup())
    off = path.is_data & (path.face < 0)
    p = path.Ts_part_contact.xyz_mm[off]
    sides = (p[:, 0] < 0, p[:, 0] > 150, p[:, 1] < 0, p[:, 1] > 100)
    assert all(s.any() for s in sides)
    assert p.min(axis=0)[:2] == pytest.approx((-8.0, -8.0))
    assert p.max(axis=0)[:2] == pytest.approx((158.0, 108.0))
    on = path.Ts_part_contact.xyz_mm[path.is_data & (path.face >= 0)]
    assert (on[:, :2] >= -1e-9).all()
    assert (on[:, :2] <= np.array([150.0, 100.0]) + 1e-9).all()


def test_points_in_the_middle_get_crossings_of_their_own() -> None:
    """Nothing near an edge: short passes are added on all four sides, off the corners, so that all six can be found."""
    path = alignment_path(curved_of(plate(600.0, 400.0)), points((280, 190, 0), (320, 190, 0), (300, 220, 0)), Setup())
    off = path.Ts_part_contact.xyz_mm[path.is_data & (path.face < 0)]
    for side in (off[:, 0] < 0, off[:, 0] > 600, off[:, 1] < 0, off[:, 1] > 400):
        assert side.any()
    # In the plane: three unknowns from the edge crossings; the smallest singular value says that none is left out.
    crossing = np.stack([off[:, 0] < 0, off[:, 0] > 600, off[:, 1] < 0, off[:, 1] > 400], axis=1)
    normal = crossing @ np.array([[-1.0, 0], [1, 0], [0, -1], [0, 1]])
    q = (off[:, :2] - [300, 200]) / 300.0
    rows = np.column_stack([normal, q[:, 0] * normal[:, 1] - q[:, 1] * normal[:, 0]])
    assert np.linalg.svd(rows, compute_uv=False)[-1] > 0.5


def test_without_edges_data_stay_inside_the_margin() -> None:
    curved = curved_of(plate())
    for keys in (HAND, suggest(curved, NO_EDGES)):
        path = alignment_path(curved, keys, NO_EDGES)
        p = data_xyz(path)
        assert (path.face[path.is_data] >= 0).all()
        assert p[:, :2].min() >= 5.0 - 1.3
        assert p[:, 0].max() <= 145.0 + 1.3
        assert p[:, 1].max() <= 95.0 + 1.3


def test_concave_edges_are_never_crossed() -> None:
    """A plate with a wall along x = 150: three sides are crossed, the wall is kept off by the margin."""
    v = np.array([[0, 0, 0], [150, 0, 0], [150, 100, 0], [0, 100, 0], [150, 0, 60], [150, 100, 60.0]])
    f = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    part = Part(v, f.astype(np.int32), Provenance("walled", "0" * 64, "mm"))
    curved = CurvedSurface(InspectionSurface(part, np.arange(2, dtype=np.int32)), 4.5)
    for keys in (points((40, 30, 0), (125, 30, 0), (125, 70, 0), (40, 70, 0)), suggest(curved, Setup())):
        p = data_xyz(alignment_path(curved, keys, Setup()))
        assert p[:, 0].max() <= 150.0 - 5.0 + 1.3
        assert p[:, 0].min() == pytest.approx(-8.0)
        assert p[:, 1].min() == pytest.approx(-8.0)
        assert p[:, 1].max() == pytest.approx(108.0)


def test_array_lies_across_the_travel_and_standoff_is_that_of_the_alignment() -> None:
    setup = Setup.model_validate({"alignment": {"standoff_mm": 25.0}})
    path = alignment_path(curved_of(SMALL["twist"]), suggest(curved_of(SMALL["twist"]), setup), setup)
    assert (path.standoff_mm[path.is_data] == 25.0).all()
    d = path.take(path.is_data)
    same = d.pass_id[1:] == d.pass_id[:-1]
    travel = np.diff(d.Ts_part_contact.xyz_mm, axis=0)[same]
    travel /= np.linalg.norm(travel, axis=1, keepdims=True)
    array = d.Ts_part_tcp.rotation_matrix[:-1][same][:, :, 0]
    assert np.degrees(np.arcsin(np.abs(np.sum(travel * array, axis=1)))).max() < 0.5
    beam = d.Ts_part_tcp.rotation_matrix[:, :, 2]
    assert beam == pytest.approx(-d.Ts_part_contact.rotation_matrix[:, :, 2])


def test_ways_between_passes_keep_off_the_part() -> None:
    """Strips all round a tube, on opposite sides of it: no way between them comes nearer than half the clearance."""
    curved = curved_of(tube(180, 60))
    at = [(x, 100 * np.cos(a), 100 * np.sin(a)) for a in np.radians([0.0, 180.0, 75.0]) for x in (60.0, 340.0)]
    keys = tuple(KeyPoint(id=f"S{i // 2 + 1}.{i % 2 + 1}", x_mm=x, y_mm=y, z_mm=z) for i, (x, y, z) in enumerate(at))
    path = alignment_path(curved, keys, NO_EDGES)
    assert (path.role == Role.LINK).any()
    xyz = path.Ts_part_tcp.xyz_mm
    travel = np.flatnonzero(np.isin(path.role[:-1], [Role.RETRACT, Role.LINK]))
    t = np.linspace(0.0, 1.0, 40)[:, None, None]
    way = (xyz[travel] + t * (xyz[travel + 1] - xyz[travel])).reshape(-1, 3)
    inside = (way[:, 0] > 0) & (way[:, 0] < 400)
    assert np.hypot(way[inside, 1], way[inside, 2]).min() > 100.0 + 25.0


def test_tube_strips_follow_the_way_their_middle_point_says() -> None:
    """A strip over more than half the circumference is not cut short."""
    at = [(200.0, 100 * np.cos(a), 100 * np.sin(a)) for a in np.radians([0.0, 110.0, 220.0])]
    keys = tuple(KeyPoint(id=f"S1.{i}", x_mm=x, y_mm=y, z_mm=z) for i, (x, y, z) in enumerate(at, start=1))
    path = alignment_path(curved_of(tube(180, 60)), keys, NO_EDGES)
    p = data_xyz(path)
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).sum() == pytest.approx(np.radians(220.0) * 100.0, rel=0.01)


def test_a_hole_between_two_points_splits_the_pass() -> None:
    panel = SMALL["two holes"]
    at = [(x, y, float(-(x**2) / 4000 - y**2 / 1600)) for x, y in ((-450.0, 50.0), (-150.0, 50.0))]
    path = alignment_path(curved_of(panel), points(*at), NO_EDGES)
    assert path.passes == 2
    p = data_xyz(path)
    assert np.hypot(p[:, 0] + 300.0, p[:, 1] - 50.0).min() > 52.0


def test_coverage_of_hand_picked_points_is_what_their_swaths_make() -> None:
    """Two legs on a plate without edges: strips of 30 mm."""
    setup = NO_EDGES
    curved = curved_of(plate(600.0, 400.0))
    path = alignment_path(curved, points((200, 200, 0), (400, 200, 0)), setup)
    assert coverage(curved, path, setup).swept_mm2 == pytest.approx(200.0 * 30.0, rel=0.02)


def test_two_opt_finds_the_short_way_round() -> None:
    ring = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.linspace(0, 2 * np.pi, 12, endpoint=False)])
    shuffled = ring[np.random.default_rng(3).permutation(12)]
    order = short_tour(shuffled)
    assert sorted(order) == list(range(12))
    length = np.linalg.norm(np.diff(shuffled[order], axis=0), axis=1).sum()
    assert length == pytest.approx(11 * 2 * np.sin(np.pi / 12))


def test_no_points_is_an_error_in_words() -> None:
    with pytest.raises(EchoBaseError, match="key points"):
        alignment_path(curved_of(plate()), (), Setup())


def test_alignment_of_all_panels_is_finite_and_deterministic() -> None:
    for name, panel in SMALL.items():
        curved = curved_of(panel)
        keys = suggest(curved, Setup())
        one, two = alignment_path(curved, keys, Setup()), alignment_path(curved, keys, Setup())
        assert np.isfinite(one.Ts_part_tcp.matrix).all(), name
        assert (one.Ts_part_tcp.matrix == two.Ts_part_tcp.matrix).all(), name
