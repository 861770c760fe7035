"""Rasters against analytic surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.planning.measure import normal_errors_deg, pitch
from benchmarks.planning.panels import Panel, cylinder, panels, tube
from planner.errors import EchoBaseError
from planner.path.coverage import coverage
from planner.path.raster import raster
from planner.toolpath import Role, ToolPath
from tests.path.shapes import crystal, curved_of, ell, flat, plate, rotated, setup_of

STRATEGIES = ["plane", "geodesic"]
SMALL = {p.name: p for p in panels(140, 50)}


def data(path: ToolPath) -> ToolPath:
    return path.take(path.is_data)


def from_boundary(panel: Panel, p: np.ndarray) -> np.ndarray:
    """Distance of points to the edges that only one triangle has."""
    edge = np.sort(panel.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edge, axis=0, return_counts=True)
    a, b = (panel.vertices[unique[count == 1][:, k]] for k in (0, 1))
    d = b - a
    off = p[:, None] - a
    t = np.clip(np.sum(off * d, axis=2) / np.sum(d * d, axis=1), 0.0, 1.0)
    return np.linalg.norm(off - t[..., None] * d, axis=2).min(axis=1)


def points(path: ToolPath) -> np.ndarray:
    return path.Ts_part_contact.xyz_mm


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("name", list(SMALL))
def test_poses_look_along_the_true_normal(name: str, strategy: str) -> None:
    """Normals after resampling: the 99th percentile within 0.1 deg of the analytic surface, and no pose astray."""
    panel = SMALL[name]
    path = raster(curved_of(panel), crystal(strategy=strategy, step_mm=8.0, direction_deg=panel.direction_deg))
    assert np.isfinite(path.Ts_part_tcp.matrix).all()
    error = normal_errors_deg(panel, path)
    assert np.percentile(error, 99) <= 0.1
    assert error.max() <= 1.0


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_pitch_on_a_cylinder_is_measured_on_the_surface(strategy: str) -> None:
    """Lines along the axis of R 400: passes are 2.00 mm of arc apart, within 2 %, where planes would give up to 2.5."""
    path = data(raster(curved_of(cylinder(140, 90)), crystal(strategy=strategy)))
    arc = 400.0 * np.arctan2(points(path)[:, 1], points(path)[:, 2])
    lines = np.sort(np.bincount(path.pass_id, arc) / np.bincount(path.pass_id))
    gaps = np.diff(lines)
    assert gaps.min() >= 2.0 * 0.98
    assert gaps.max() <= 2.0 * 1.02
    # The outermost swath, 3 mm wide, reaches the margin of 5 mm.
    assert lines[0] == pytest.approx(-250.0 + 5.0 + 1.5, abs=0.25)


def test_geodesic_pitch_holds_on_uneven_triangles() -> None:
    """Jittered grid: what fast marching alone gets wrong by several percent."""
    low, high = pitch(raster(curved_of(SMALL["twist, irregular mesh"]), crystal(strategy="geodesic", step_mm=4.0)))
    assert low >= 4.0 * 0.98
    assert high <= 4.0 * 1.02


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_uneven_tessellation_drops_nothing(strategy: str) -> None:
    """Vertices crowded at one end: passes reach both ends all the same."""
    path = data(raster(curved_of(SMALL["uneven vertices along x"]), setup_of(strategy=strategy)))
    x = points(path)[:, 0]
    first = np.minimum.reduceat(x, np.flatnonzero(np.r_[True, np.diff(path.pass_id) > 0]))
    assert first == pytest.approx(np.full(path.passes, -745.0), abs=3.0)
    assert x.max() == pytest.approx(745.0, abs=1.0)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_plate_of_two_triangles(strategy: str) -> None:
    """150 x 100 with 30 mm swath, 5 mm margin: four passes whose swath spans 5..95, data from 5 to 145."""
    path = raster(curved_of(plate()), setup_of(strategy=strategy))
    d = data(path)
    p = points(d)
    lines = np.unique(np.round(p[:, 1], 6))
    assert lines[0] == pytest.approx(20.0, abs=1e-6)
    assert lines[-1] == pytest.approx(80.0, abs=1e-6)
    assert np.diff(lines) == pytest.approx(np.full(3, 20.0), abs=1e-6)
    assert (p[:, 0].min(), p[:, 0].max()) == pytest.approx((5.0, 145.0), abs=1e-6)
    step = np.linalg.norm(np.diff(p, axis=0), axis=1)[np.diff(d.pass_id) == 0]
    assert step == pytest.approx(np.full(len(step), 2.0), abs=1e-6)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_structure_of_a_pass_and_forth_and_back(strategy: str) -> None:
    path = raster(curved_of(SMALL["twist"]), setup_of(strategy=strategy))
    ahead = []
    for k in range(path.passes):
        one = path.take(path.pass_id == k)
        roles = one.role[np.r_[True, np.diff(one.role.astype(int)) != 0]]
        expected = [Role.APPROACH, Role.LEAD_IN, Role.DATA, Role.LEAD_OUT, Role.RETRACT]
        assert [r for r in roles if r != Role.LINK] == expected
        assert (one.standoff_mm[one.is_data] == 15.0).all()
        assert one.standoff_mm[0] > 15.0 + 20.0
        p = points(data(one))
        ahead.append(np.sign((p[-1] - p[0])[0]))
    assert (np.array(ahead[1:]) == -np.array(ahead[:-1])).all()
    x_axis = data(path).Ts_part_tcp.rotation_matrix[:, :, 0]
    assert (x_axis @ x_axis[0] > 0.9).all()


def test_leads_go_on_without_a_kink() -> None:
    """Rings round a tube: the lead is on the circle's tangent, and its turn goes on at the rate of the pass."""
    path = raster(curved_of(tube(180, 30)), crystal(strategy="plane"))
    one = path.take(path.pass_id == 0)
    block = one.take((one.role > Role.APPROACH) & (one.role < Role.RETRACT))
    turn = (block.Ts_part_contact[:-1].inv() @ block.Ts_part_contact[1:]).angle_deg()
    assert turn == pytest.approx(np.full(len(turn), np.median(turn)), abs=0.05)


def test_rings_of_a_tube_close() -> None:
    path = data(raster(curved_of(tube(180, 30)), crystal(strategy="plane")))
    for k in range(0, path.passes, 40):
        p = points(path.take(path.pass_id == k))
        assert np.linalg.norm(p[0] - p[-1]) < 1e-6
        assert np.linalg.norm(np.diff(p, axis=0), axis=1).sum() == pytest.approx(2 * np.pi * 100.0, rel=1e-3)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_passes_run_round_a_tube_with_the_array_along_it(strategy: str) -> None:
    """Straight along the axis, so the whole swath of 30 mm is within tolerance: (400 - 10 - 30) / 22.5 = 16 steps."""
    path = data(raster(curved_of(tube(180, 30)), setup_of(strategy=strategy)))
    x = np.bincount(path.pass_id, points(path)[:, 0]) / np.bincount(path.pass_id)
    assert np.sort(x) == pytest.approx(np.linspace(20.0, 380.0, 17), abs=0.1)
    assert np.abs(path.Ts_part_tcp.rotation_matrix[:, 0, 0]).min() > 0.999


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_holes_split_passes_and_margin_is_kept_at_their_ends(strategy: str) -> None:
    panel = SMALL["two holes"]
    curved = curved_of(panel)
    path = data(raster(curved, crystal(strategy=strategy, step_mm=10.0)))
    first = np.flatnonzero(np.r_[True, np.diff(path.pass_id) > 0])
    ends = points(path)[np.r_[first, first[1:] - 1, len(path) - 1]]
    distance = from_boundary(panel, ends)
    assert distance.min() >= 5.0 - 0.02
    assert np.percentile(distance, 90) <= 5.0 + 0.02 + 3.0  # oblique ends stop where the margin does, not sooner
    assert path.passes > 50 + 2 * 10


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_l_shape_in_four_triangles_reaches_all_arms(strategy: str) -> None:
    p = points(data(raster(curved_of(ell()), setup_of(strategy=strategy))))
    assert p[:, 0].max() == pytest.approx(395.0, abs=1.0)
    assert p[:, 1].max() >= 375.0
    inside = (p[:, 0] <= 115.01) | (p[:, 1] <= 145.01)
    assert inside.all()


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_face_and_barycentric_give_the_pose_back(strategy: str) -> None:
    curved = curved_of(SMALL["double-curved, long lines"])
    d = data(raster(curved, setup_of(strategy=strategy)))
    p, n = curved.evaluate(d.face, d.bary)
    assert p == pytest.approx(points(d), abs=1e-9)
    assert n == pytest.approx(d.Ts_part_contact.rotation_matrix[:, :, 2], abs=1e-9)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_same_input_same_path_and_it_turns_with_the_part(strategy: str) -> None:
    panel = SMALL["twist"]
    setup = setup_of(strategy=strategy)
    one, two = raster(curved_of(panel), setup), raster(curved_of(panel), setup)
    assert (one.Ts_part_tcp.matrix == two.Ts_part_tcp.matrix).all()
    turn = Rotation.from_euler("xyz", [20.0, -35.0, 80.0], degrees=True).as_matrix()
    shift = np.array([300.0, -2000.0, 50.0])
    moved = data(raster(curved_of(rotated(panel, turn, shift)), setup))
    assert moved.passes == one.passes
    back = (points(moved) - shift) @ turn
    both = np.sort(back[:, 1]), np.sort(points(data(one))[:, 1])
    assert np.abs(both[0]).max() == pytest.approx(np.abs(both[1]).max(), abs=0.5)


def test_direction_turns_the_passes_about_the_normal() -> None:
    for angle in (0.0, 30.0, 90.0):
        d = data(raster(curved_of(plate()), setup_of(strategy="plane", direction_deg=angle)))
        x = d.Ts_part_contact.rotation_matrix[0, :, 0]
        assert abs(x @ [np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0]) == pytest.approx(1.0, abs=1e-9)


def test_step_follows_the_effective_swath_of_a_tight_radius() -> None:
    """R 100, tolerance 1 deg: laws beyond 100 tan(1 deg) = 1.75 mm see too much tilt; step = 0.75 x 3.49 = 2.62 mm."""
    panel = tube(360, 20)
    path = data(raster(curved_of(panel), setup_of(strategy="geodesic", direction_deg=90.0)))
    angle = np.sort(
        np.mod(np.bincount(path.pass_id, np.arctan2(*points(path)[:, [2, 1]].T)) / np.bincount(path.pass_id), 2 * np.pi)
    )
    gap = np.median(np.diff(angle)) * 100.0
    assert gap <= 0.75 * 2.0 * 100.0 * np.tan(np.radians(1.0)) * 1.02
    assert gap >= 0.75 * 2.0 * 100.0 * np.tan(np.radians(1.0)) * 0.95


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_surface_smaller_than_its_margins_is_refused_in_words(strategy: str) -> None:
    with pytest.raises(EchoBaseError) as caught:
        raster(curved_of(plate(9.0, 8.0)), setup_of(strategy=strategy))
    assert caught.value.issues[0].code == "raster-empty"
    assert "edge_margin_mm" in caught.value.issues[0].remedy


def test_a_narrow_strip_gets_one_pass_in_its_middle() -> None:
    d = data(raster(curved_of(plate(200.0, 24.0)), setup_of(strategy="plane")))
    assert d.passes == 1
    assert points(d)[:, 1] == pytest.approx(np.full(len(d), 12.0), abs=1e-9)


def test_an_absurd_step_is_refused() -> None:
    with pytest.raises(EchoBaseError, match="passes"):
        raster(curved_of(plate(3000.0, 3000.0)), crystal(step_mm=0.01, strategy="plane"))


def test_sliver_triangles_do_not_bend_the_lines() -> None:
    """A STEP-like strip: triangles 1000 mm long and 1.6 mm wide on R 400."""
    a = np.linspace(-0.4, 0.4, 201)
    v = np.concatenate([np.stack([np.full_like(a, x), 400 * np.sin(a), 400 * np.cos(a)], 1) for x in (0.0, 1000.0)])
    i = np.arange(200)
    f = np.concatenate([np.stack([i, i + 201, i + 202], 1), np.stack([i, i + 202, i + 1], 1)])
    panel = Panel("slivers", v, f, lambda p: p)
    path = data(raster(curved_of(panel), crystal(strategy="geodesic", point_spacing_mm=5.0)))
    arc = 400.0 * np.arctan2(points(path)[:, 1], points(path)[:, 2])
    middle = np.bincount(path.pass_id, arc) / np.bincount(path.pass_id)
    assert np.abs(arc - middle[path.pass_id]).max() < 0.05
    assert np.diff(np.sort(middle)).max() <= 2.04


def test_flat_helper_faces_up() -> None:
    assert flat([(0, 0), (1, 0), (0, 1)], [(0, 1, 2)]).surface().mean_normal_part == pytest.approx([0, 0, 1])


def test_sheets_that_touch_in_a_point_or_an_edge_are_planned() -> None:
    """Two plates meeting in one corner, and a surface in two pieces: every piece gets its passes."""
    v = [(0, 0), (100, 0), (100, 80), (0, 80), (-100, 0), (-100, -80), (0, -80)]
    bow = flat(v, [(0, 1, 2), (0, 2, 3), (0, 4, 5), (0, 5, 6)])
    one = SMALL["twist"]
    apart = Panel(
        "apart",
        np.concatenate([one.vertices, one.vertices + np.array([0.0, 700.0, 0.0])]),
        np.concatenate([one.faces, one.faces + len(one.vertices)]),
        one.normals,
    )
    for panel, share in ((bow, 0.75), (apart, 0.95)):
        curved, setup = curved_of(panel), setup_of(strategy="geodesic")
        assert coverage(curved, raster(curved, setup), setup).within_share > share


def test_degenerate_and_unmerged_triangles_change_nothing() -> None:
    sound = SMALL["twist"]
    loose = Panel(
        "loose", sound.vertices[sound.faces].reshape(-1, 3), np.arange(sound.faces.size).reshape(-1, 3), sound.normals
    )
    broken = Panel("broken", sound.vertices, np.concatenate([sound.faces, [[3, 3, 4], [7, 8, 7]]]), sound.normals)
    for strategy in STRATEGIES:
        setup = setup_of(strategy=strategy)
        expected = raster(curved_of(sound), setup)
        for panel in (loose, broken):
            path = raster(curved_of(panel), setup)
            assert path.passes == expected.passes
            assert len(path) == len(expected)


def test_a_profile_bent_past_its_own_plane_is_covered() -> None:
    """A channel bent over 270 deg: planes along it cut it twice; its lines still lie a step apart on the surface."""
    a = np.linspace(-0.75 * np.pi, 0.75 * np.pi, 120)
    x = np.linspace(0.0, 500.0, 40)
    v = np.stack([np.repeat(x, 120), np.tile(80 * np.sin(a), 40), np.tile(80 * np.cos(a), 40)], axis=1)
    i = np.arange(4800).reshape(40, 120)
    p, q, r, s = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    panel = Panel("channel", v, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)]), lambda n: n)
    curved, setup = curved_of(panel), crystal(strategy="geodesic", step_mm=2.5)
    c = coverage(curved, raster(curved, setup), setup)
    assert c.missed_mm2 - c.margin_mm2 < 0.002 * c.area_mm2
