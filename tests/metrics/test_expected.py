"""What a path is expected to see, on surfaces worked out by hand."""

import numpy as np
import pytest

from alignment.metrics import expected
from planner.frames import Transform
from planner.path.raster import raster
from planner.setup import Setup
from planner.surface.closest import Foot
from planner.surface.curved import CurvedSurface
from tests.simulator.cells import looking_down, plate, sheet


class Plane:
    """The plane z = 0 of `part`, inspected where |x| < 50."""

    def closest(self, points_part):
        n = len(points_part)
        foot = points_part * [1, 1, 0]
        inside = np.abs(points_part[:, 0]) < 50
        up = np.tile([0.0, 0.0, 1.0], (n, 1))
        return Foot(foot, up, points_part[:, 2], np.zeros(n, np.int32), np.zeros((n, 3)), inside)


def row(n: int = 101, reach: float = 60.0):
    x = np.linspace(-reach, reach, n)
    return x, looking_down(np.column_stack([x, 0 * x, np.full(n, 15.0)]), np.array([1.0, 0, 0]))


def test_a_tilted_plane_by_hand() -> None:
    _x, poses = row()
    T_base_part = Transform.from_xyzabc("base", "part", [0, 0, 0.4, 0, 1.0, 0.5])
    seen = expected(Plane(), poses, Setup(), T_base_part)
    normal = T_base_part.directions([0.0, 0, 1])
    distance = (poses.xyz_mm - [0, 0, 0.4]) @ normal
    np.testing.assert_allclose(seen.distance_mm, distance, atol=1e-12)
    np.testing.assert_allclose(seen.standoff_mm, distance, atol=1e-12)
    angle = np.degrees(np.arccos(normal[2]))
    np.testing.assert_allclose(seen.tilt_deg, angle, atol=1e-9)
    # The array lies along y: the part's turn about x (0.5 deg) tilts it, its turn about y (1 deg) goes along the travel.
    np.testing.assert_allclose(np.abs(seen.b_deg), 0.5, atol=1e-3)
    np.testing.assert_allclose(np.abs(seen.c_deg), 1.0, atol=1e-3)
    np.testing.assert_allclose(seen.db, -(2 * seen.b_deg**2 + seen.c_deg**2), atol=1e-12)
    on = np.abs(T_base_part.inv().points(poses.xyz_mm)[:, 0]) < 50
    np.testing.assert_array_equal(seen.on_part, on)
    assert seen.summary.tof_range_mm == pytest.approx(np.ptp(distance[on]))
    assert seen.summary.tof_std_mm == pytest.approx(distance[on].std())
    assert seen.summary.within_2db == 1.0
    assert seen.summary.tilt_max_deg == pytest.approx(angle)
    assert seen.summary.mean_abs_db == pytest.approx(2 * 0.5**2 + 1.0**2, abs=5e-3)


def test_the_share_within_2_db_counts_poses() -> None:
    _x, poses = row(reach=40.0)
    steep = Transform.from_xyzabc("base", "part", [0, 0, 0, 0, 0, 1.1])
    assert expected(Plane(), poses, Setup(), steep).summary.within_2db == 0.0
    assert expected(Plane(), poses, Setup(probe={"tilt_loss_db_per_deg2": {"b": 1.0}}), steep).summary.within_2db == 1.0


def test_face_offset_lengthens_the_path_of_the_sound_but_not_the_standoff() -> None:
    _, poses = row()
    seen = expected(Plane(), poses, Setup(probe={"face_offset_mm": 7.0}), Transform.identity("base", "part"))
    np.testing.assert_allclose(seen.distance_mm, 22.0)
    np.testing.assert_allclose(seen.standoff_mm, 15.0)


def test_nothing_on_the_part_is_not_a_number() -> None:
    _, poses = row()
    summary = expected(Plane(), poses, Setup(), Transform.from_xyzabc("base", "part", [500, 0, 0, 0, 0, 0])).summary
    assert np.isnan(list(summary.to_json().values())).all()


def test_a_planned_raster_sees_its_standoff_where_the_part_is_nominal() -> None:
    setup = Setup(placement={"x_mm": 300, "y_mm": 20, "z_mm": 100, "a_deg": 30})

    def cylinder(u, v):
        return np.stack([400 * np.sin(u / 400), v, 400 * np.cos(u / 400)], axis=1)

    _, surface = sheet(cylinder, 41, 31, (-100.0, 100.0), (-75.0, 75.0))
    curved = CurvedSurface(surface, 4.5)
    path = raster(curved, setup)
    nominal = Transform("base", "part", setup.T_base_partnom.rigid)
    before = expected(curved, path, setup, nominal)
    assert len(before.distance_mm) == int(path.is_data.sum())
    np.testing.assert_allclose(before.distance_mm, 15.0, atol=5e-3)
    assert before.summary.within_2db == 1.0
    moved = nominal @ Transform.from_xyzabc("part", "part", [0, 0, 1.0, 0, 0, 0])
    after = expected(curved, path, setup, moved)
    # Lifted by 1 mm along part z, the distance falls by the cosine of the normal.
    angle = np.arcsin(np.clip(path.take(path.is_data).Ts_part_contact.xyz_mm[:, 0] / 400, -1, 1))
    np.testing.assert_allclose(before.distance_mm - after.distance_mm, np.cos(angle), atol=5e-3)


def test_a_flat_part_needs_no_more_than_its_plane() -> None:
    _, surface = plate()
    poses = looking_down(np.array([[0.0, 0, 20], [10.0, 0, 20]]), np.array([1.0, 0, 0]))
    seen = expected(CurvedSurface(surface, 4.5), poses, Setup(), Transform.identity("base", "part"))
    np.testing.assert_allclose(seen.distance_mm, 15.0, atol=1e-9)
