"""From recorded scans to points in the nominal base, against geometry worked out by hand."""

import numpy as np
import pytest

from alignment.point_cloud import point_cloud
from alignment.scan import Scan, SurfacePoints
from planner.couplant import water_speed_m_s
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.setup import Setup

C = water_speed_m_s(20.0) * 1e-3
BASE = {"x_mm": 800, "y_mm": 20, "z_mm": 300, "a_deg": 12, "b_deg": 3, "c_deg": -4}
SHIFT = Transform.from_xyzabc("base", "basecorr", [1, 2, 3, 0.5, -0.4, 0.3])


def scan_of(
    setup: Setup, poses: Transform, distance: np.ndarray, T_world_scan: Transform | None = None, **more
) -> Scan:
    """A scan with all laws at every pose; distance (m, laws), NaN lost."""
    m, laws = distance.shape
    return Scan(
        Ts_scan_tcp=poses,
        pose_index=np.repeat(np.arange(m, dtype=np.int32), laws),
        law=np.tile(np.arange(1, laws + 1, dtype=np.int32), m),
        tof_us=2 * distance.ravel() / C + setup.couplant.delay_us,
        amplitude_pct=np.full(m * laws, 50.0),
        T_world_scan=T_world_scan,
        **more,
    )


def random_poses(n: int) -> Transform:
    random = np.random.default_rng(0)
    six = np.column_stack(
        [random.uniform(-100, 100, (n, 3)), random.uniform(-170, 170, n), random.uniform(-80, 80, (n, 2))]
    )
    return Transform.from_xyzabc("scan", "tcp", six)


def test_origins_directions_and_distances_of_every_law() -> None:
    setup = Setup(probe={"face_offset_mm": 3.0}, couplant={"delay_us": 1.5})
    poses = random_poses(7)
    distance = np.random.default_rng(1).uniform(5, 25, (7, 50))
    cloud = point_cloud([scan_of(setup, poses, distance)], setup)
    matrix = poses.matrix[np.repeat(np.arange(7), 50)]
    x_k = np.tile((np.arange(1, 51) - 25.5) * 0.6, 7)
    np.testing.assert_allclose(cloud.beams_base, matrix[:, :3, 2], atol=1e-12)
    np.testing.assert_allclose(cloud.arrays_base, matrix[:, :3, 0], atol=1e-12)
    origin = np.stack([x_k, 0 * x_k, 0 * x_k - 3.0, 0 * x_k + 1], axis=1)
    np.testing.assert_allclose(cloud.origins_base, np.einsum("nij,nj->ni", matrix, origin)[:, :3], atol=1e-9)
    np.testing.assert_allclose(cloud.distance_mm, distance.ravel(), atol=1e-12)
    points = np.einsum("nij,nj->ni", matrix, origin + np.pad(distance.reshape(-1, 1), ((0, 0), (2, 1))))[:, :3]
    np.testing.assert_allclose(cloud.axial_points_base, points, atol=1e-9)


@pytest.mark.parametrize(
    ("beam", "array", "columns"), [("x", "y", (1, 2, 0)), ("-z", "x", (0, None, 2)), ("y", "-x", (0, None, 1))]
)
def test_axes_of_the_taught_tool(beam, array, columns) -> None:
    setup = Setup(tool={"beam_axis": beam, "array_axis": array})
    poses = random_poses(3)
    cloud = point_cloud([scan_of(setup, poses, np.full((3, 50), 15.0))], setup)
    rotation = poses.rotation_matrix
    sign = {"-": -1.0}
    np.testing.assert_allclose(cloud.beams_base[::50], sign.get(beam[0], 1.0) * rotation[:, :, columns[2]], atol=1e-12)
    np.testing.assert_allclose(
        cloud.arrays_base[::50], sign.get(array[0], 1.0) * rotation[:, :, columns[0]], atol=1e-12
    )


def test_the_base_that_was_active_is_undone() -> None:
    setup = Setup(base=BASE)
    seen_from_nominal = random_poses(5)
    distance = np.full((5, 50), 15.0)
    nominal = point_cloud([scan_of(setup, seen_from_nominal, distance)], setup)
    moved = setup.T_world_base @ SHIFT
    # The same tool poses in space, written in the moved BASE.
    there = Transform("scan", "tcp", (SHIFT.rigid.inv() * seen_from_nominal.rigid))
    said = Transform("world", "scan", moved.rigid)
    in_file = point_cloud([scan_of(setup, there, distance, said)], setup)
    by_choice = point_cloud([scan_of(setup, there, distance)], setup, "corrected", moved)
    for cloud in (in_file, by_choice):
        np.testing.assert_allclose(cloud.origins_base, nominal.origins_base, atol=1e-9)
        np.testing.assert_allclose(cloud.beams_base, nominal.beams_base, atol=1e-12)
    same = Transform("world", "scan", setup.T_world_base.rigid)
    np.testing.assert_allclose(
        point_cloud([scan_of(setup, seen_from_nominal, distance, same)], setup).origins_base,
        nominal.origins_base,
        atol=1e-9,
    )
    with pytest.raises(EchoBaseError, match="no correction"):
        point_cloud([scan_of(setup, there, distance)], setup, "corrected")
    contradiction = point_cloud([scan_of(setup, there, distance, said)], setup, "nominal")
    assert [issue.code for issue in contradiction.issues] == ["base-contradicts-file"]
    np.testing.assert_allclose(contradiction.origins_base, nominal.origins_base, atol=1e-9)


def test_lost_echoes_are_kept_apart_whether_marked_or_missing() -> None:
    setup = Setup()
    poses = random_poses(6)
    distance = np.full((6, 50), 15.0)
    distance[2, 10:20] = np.nan
    full = scan_of(setup, poses, distance)
    whole = point_cloud([full], setup)
    assert len(whole) == 290
    assert whole.total_readings == 300
    np.testing.assert_array_equal(whole.lost_law, np.arange(11, 21))
    np.testing.assert_array_equal(whole.lost_pose_index, np.full(10, 2))
    assert any(issue.code == "echoes-lost" and "10 of 300" in issue.message for issue in whole.issues)
    rows = np.isfinite(full.tof_us)
    sparse = Scan(poses, full.pose_index[rows], full.law[rows], full.tof_us[rows], full.amplitude_pct[rows], None)
    missing = point_cloud([sparse], setup)
    for key in ("lost_law", "lost_pose_index", "lost_origins_base", "lost_beams_base", "lost_pass_id", "distance_mm"):
        np.testing.assert_array_equal(getattr(missing, key), getattr(whole, key))
    x_k = (np.arange(11, 21) - 25.5) * 0.6
    expected = poses.xyz_mm[2] + x_k[:, None] * poses.rotation_matrix[2, :, 0]
    np.testing.assert_allclose(whole.lost_origins_base, expected, atol=1e-12)


def test_times_shorter_than_the_delay_are_dropped_and_counted() -> None:
    setup = Setup(couplant={"delay_us": 2.0})
    distance = np.full((3, 50), 15.0)
    distance[1, :4] = -0.5
    cloud = point_cloud([scan_of(setup, random_poses(3), distance)], setup)
    assert len(cloud) == 146
    assert any(issue.code == "distance-negative" and issue.message.startswith("4 ") for issue in cloud.issues)
    assert len(cloud.lost_law) == 0 or not np.isin(cloud.lost_law, [1, 2, 3, 4]).all()


def test_several_scans_count_on() -> None:
    setup = Setup()
    one = scan_of(setup, random_poses(4), np.full((4, 50), 15.0), pass_id=np.repeat([0, 0, 1, 1], 50).astype(np.int32))
    cloud = point_cloud([one, one], setup)
    np.testing.assert_array_equal(cloud.scan_id, np.repeat([0, 1], 200))
    np.testing.assert_array_equal(np.unique(cloud.pose_index), np.arange(8))
    np.testing.assert_array_equal(cloud.pass_id[::50], [0, 0, 1, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(one.pass_id, np.repeat([0, 0, 1, 1], 50))


def test_a_law_the_probe_does_not_have_and_nothing_left() -> None:
    few = Setup(probe={"elements": 32})
    with pytest.raises(EchoBaseError, match="goes up to 50, but the probe has 18"):
        point_cloud([scan_of(Setup(), random_poses(3), np.full((3, 50), 15.0))], few)
    with pytest.raises(EchoBaseError, match="not one reading"):
        point_cloud([scan_of(Setup(), random_poses(3), np.full((3, 50), np.nan))], Setup())


def test_surface_points_go_to_the_nominal_base_and_do_not_mix() -> None:
    setup = Setup(base=BASE)
    points = np.random.default_rng(0).uniform(-100, 100, (50, 3))
    said = Transform("world", "scan", (setup.T_world_base @ SHIFT).rigid)
    cloud = point_cloud([SurfacePoints(points, None, None, said)], setup)
    np.testing.assert_allclose(cloud.origins_base, SHIFT.points(points), atol=1e-9)
    assert cloud.beams_base is None
    np.testing.assert_array_equal(cloud.distance_mm, 0.0)
    assert np.isnan(cloud.amplitude_pct).all()
    np.testing.assert_array_equal(cloud.axial_points_base, cloud.origins_base)
    scan = scan_of(setup, random_poses(3), np.full((3, 50), 15.0))
    with pytest.raises(EchoBaseError, match="mixed"):
        point_cloud([SurfacePoints(points, None, None, None), scan], setup)
