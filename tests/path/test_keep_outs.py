"""Keep-out regions: no data inside, nothing over a clamp, and the area said; against closed forms and sampled nozzles."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planning.panels import double_slope, double_z, height_panel
from planner.checks import check
from planner.errors import EchoBaseError
from planner.keypoint import KeyPoint
from planner.path.alignment import alignment_path
from planner.path.coverage import coverage
from planner.path.decimate import decimate
from planner.path.keypoints import suggest, verdicts
from planner.path.raster import raster
from planner.setup import Setup
from planner.surface.keepouts import keep_outs_of
from planner.surface.outlines import segment_distance_mm, signed_distance_mm
from planner.toolpath import Role
from tests.path.shapes import crystal, curved_of, plate, setup_of


def z(x: float, y: float) -> float:
    return float(double_z(np.array(x), np.array(y)))


RIVET = {"type": "disc", "centre_mm": [100.0, 50.0, z(100.0, 50.0)], "radius_mm": 8.0, "name": "rivet"}
CLAMP = {"type": "sphere", "centre_mm": [-300.0, -100.0, z(-300.0, -100.0)], "radius_mm": 25.0, "may_cross": False}
EDGE_CLAMP = {"type": "box", "min_mm": [-60.0, 200.0, -200.0], "max_mm": [60.0, 260.0, 100.0], "may_cross": False}
BRACKET = {
    "type": "polygon",
    "points_mm": [
        [x, y, z(x, y)] for x, y in [(300.0, 0.0), (400.0, 0.0), (400.0, 60.0), (350.0, 20.0), (300.0, 60.0)]
    ],
}
EVERY = [RIVET, CLAMP, EDGE_CLAMP, BRACKET]


def panel():
    return height_panel("d", double_z, double_slope, np.linspace(0, 1, 80), np.linspace(0, 1, 30))


def sampled_nozzle(path, setup, step_mm=3.0):
    """Points of the nozzle's cylinder at and between the poses of a path (n, k, 3), by plain interpolation."""
    tcp = path.Ts_part_tcp
    tip, beam = tcp.xyz_mm, tcp.rotation_matrix[:, :, 2]
    tips, beams = [tip[:1]], [beam[:1]]
    for i in range(len(tip) - 1):
        k = max(int(np.ceil(np.linalg.norm(tip[i + 1] - tip[i]) / step_mm)), 1)
        t = (np.arange(1, k + 1) / k)[:, None]
        tips.append(tip[i] + t * (tip[i + 1] - tip[i]))
        beams.append((1 - t) * beam[i] + t * beam[i + 1])
    tips, beams = np.concatenate(tips), np.concatenate(beams)
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    side = np.cross(beams, [0.3, 0.9, 0.1])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(beams, side)
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = setup.tool.nozzle_radius_mm * (np.cos(turn)[:, None, None] * side + np.sin(turn)[:, None, None] * other)
    back = np.linspace(0, setup.tool.nozzle_length_mm, 5)
    return (tips - back[:, None, None] * beams)[:, None] + ring


@pytest.mark.parametrize("strategy", ["plane", "geodesic"])
def test_no_data_inside_and_nothing_over_a_clamp(strategy):
    setup = setup_of(strategy=strategy, keep_outs=EVERY)
    curved = curved_of(panel())
    path = raster(curved, setup)
    at = path.take(path.is_data).Ts_part_contact.xyz_mm
    assert np.linalg.norm(at[:, :2] - [100.0, 50.0], axis=1).min() > 8.0
    assert np.linalg.norm(at - CLAMP["centre_mm"], axis=1).min() >= 25.0 + 3.0 + 20.0 - 1e-3
    in_bracket = signed_distance_mm(at[:, :2], np.array(BRACKET["points_mm"])[:, :2])
    assert in_bracket.min() > -0.05
    sent = decimate(path)
    # Seen along the panel's own normal there, no point of the nozzle stands over the clamp, links and retracts included.
    up = panel().normals(np.array([CLAMP["centre_mm"]]))[0]
    d = sampled_nozzle(sent, setup) - np.array(CLAMP["centre_mm"])
    assert np.linalg.norm(d - (d @ up)[..., None] * up, axis=-1).min() > 25.0
    assert not [i for i in check(curved, sent, setup).issues if i.code == "keep-out-crossed"]


def test_a_link_that_would_cross_a_clamp_goes_round_and_the_check_sees_one_that_does():
    setup = setup_of(strategy="plane", keep_outs=EVERY)
    curved = curved_of(panel())
    path = raster(curved, setup)
    assert (path.role == Role.LINK).any()
    straight = path.take(path.role != Role.LINK)
    found = check(curved, straight, setup)
    assert [i for i in found.issues if i.code == "keep-out-crossed"]
    assert found.summary()["keep_out_min_mm"] < 0.0


def test_kept_out_area_is_its_own_and_not_missed():
    curved = curved_of(plate(300.0, 200.0))
    setup = crystal(keep_outs=[{"type": "disc", "centre_mm": [120.0, 90.0, 0.0], "radius_mm": 20.0, "margin_mm": 4.0}])
    covered = coverage(curved, raster(curved, setup), setup)
    assert covered.kept_out_mm2 == pytest.approx(np.pi * 20.0**2, rel=0.01)
    ring = np.pi * (24.0**2 - 20.0**2)
    assert 0.5 * ring < covered.beside_mm2 < 1.3 * ring
    total = covered.within_tolerance_mm2 + covered.missed_mm2 + covered.kept_out_mm2
    assert total == pytest.approx(covered.area_mm2)
    assert covered.unexplained_mm2 < 60.0
    plain = coverage(curved, raster(curved, crystal()), crystal())
    assert plain.kept_out_mm2 == 0.0
    lost = plain.within_tolerance_mm2 - covered.within_tolerance_mm2
    assert np.pi * 20.0**2 < lost < np.pi * 24.0**2 + 60.0


def test_fine_triangles_given_by_number_are_a_region():
    shape = panel()
    surface = shape.surface()
    centre = surface.vertices[surface.faces].mean(axis=1)
    rows = np.flatnonzero(np.hypot(centre[:, 0] - 100.0, centre[:, 1]) < 60.0)
    setup = setup_of(keep_outs=[{"type": "faces", "faces": rows.tolist()}])
    curved = curved_of(shape)
    covered = coverage(curved, raster(curved, setup), setup)
    assert covered.kept_out_mm2 == pytest.approx(surface.face_areas_mm2[rows].sum(), rel=1e-6)


def test_the_alignment_scan_keeps_out_and_does_not_cross_edges_under_a_clamp():
    setup = setup_of(keep_outs=EVERY)
    curved = curved_of(panel())
    points = suggest(curved, setup)
    assert not [i for i in verdicts(curved, points, setup) if i.severity == "error"]
    path = alignment_path(curved, points, setup)
    keep = keep_outs_of(curved.surface, setup)
    data = path.take(path.is_data)
    assert (keep.room_mm(data.Ts_part_contact.xyz_mm) > -0.01).all()
    over = data.Ts_part_contact.xyz_mm[data.face < 0]
    beside = (np.abs(over[:, 0]) < 60.0 + 23.0) & (over[:, 1] > 200.0)
    assert len(over)
    assert not beside.any()
    assert not [i for i in check(curved, decimate(path), setup).issues if i.code == "keep-out-crossed"]


def test_a_key_point_in_a_keep_out_is_refused_with_the_reason():
    curved = curved_of(panel())
    setup = Setup.model_validate({"inspection": {"keep_outs": [RIVET]}})
    point = KeyPoint(id="K1", x_mm=103.0, y_mm=50.0, z_mm=z(103.0, 50.0))
    found = [i for i in verdicts(curved, (point,), setup) if i.code == "keypoint-kept-out"]
    assert found[0].severity == "error"
    assert "rivet" in found[0].message


def test_segments_and_polygons_keep_the_distance_of_sampled_points():
    rng = np.random.default_rng(3)
    polygon = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (5.0, 2.0), (0.0, 6.0)])
    start, end = rng.uniform(-10, 20, (60, 2)), rng.uniform(-10, 20, (60, 2))
    t = np.linspace(0, 1, 2001)[:, None, None]
    along = (start + t * (end - start)).reshape(-1, 2)
    sampled = np.maximum(signed_distance_mm(along, polygon).reshape(2001, 60).min(axis=0), 0.0)
    assert segment_distance_mm(start, end, polygon) == pytest.approx(sampled, abs=0.02)
    inside = signed_distance_mm(np.array([[5.0, 1.0], [5.0, 3.0]]), polygon)
    assert inside[0] < 0.0 < inside[1]


def test_a_polygon_that_crosses_itself_or_has_a_thousand_corners_is_a_region():
    """Two triangles that meet in a point, and a star: areas in closed form; distances by a tree as by brute force."""
    surface = curved_of(plate(200.0, 120.0))
    bow = [[-20.0, -20.0, 0.0], [20.0, 20.0, 0.0], [20.0, -20.0, 0.0], [-20.0, 20.0, 0.0]]
    a = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    r = 30.0 + 8.0 * np.sin(40.0 * a)
    star = np.stack([r * np.cos(a), r * np.sin(a), 0.0 * a], axis=1)
    for corners, area in ((bow, 800.0), (star.tolist(), np.pi * (30.0**2 + 8.0**2 / 2.0))):
        setup = crystal(step_mm=20.0, keep_outs=[{"type": "polygon", "points_mm": corners, "margin_mm": 0.0}])
        x, y = np.meshgrid(np.linspace(-60.03, 59.97, 481), np.linspace(-60.07, 59.93, 481))
        points = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
        inside = keep_outs_of(surface.surface, setup).inside(points)
        assert inside.sum() * 0.25**2 == pytest.approx(area, rel=0.02)
    far = np.random.default_rng(0).uniform(-60.0, 60.0, (4000, 2))
    assert signed_distance_mm(far, star[:, :2]) == pytest.approx(
        np.concatenate([signed_distance_mm(p, star[:, :2]) for p in np.array_split(far, 40)]), abs=1e-9
    )
    flat = crystal(step_mm=20.0, keep_outs=[{"type": "polygon", "points_mm": [[-9, 0, 0], [0, 0, 0], [9, 0, 0]]}])
    with pytest.raises(EchoBaseError, match="on a line"):
        keep_outs_of(surface.surface, flat)


def test_an_alignment_scan_of_kilometres_is_refused_with_a_remedy():
    panel = plate(200.0, 120.0)
    large = curved_of(replace(panel, vertices=panel.vertices * 100.0))
    with pytest.raises(EchoBaseError, match="km long"):
        suggest(large, crystal(step_mm=600.0))
