"""Poses and echoes in two files, merged by time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignment.readers import read_scan
from planner.errors import EchoBaseError
from tests.scan.files import write_csv


def robot(t):
    """A robot that moves straight at 100 mm/s and turns at a constant rate about a fixed axis."""
    xyz = np.stack([100 * t, 5 + 20 * t, 300 - 10 * t], axis=1)
    turn = Rotation.from_rotvec(np.outer(t, [0.3, -0.4, 0.5])) * Rotation.from_euler("ZYX", [90, 10, 170], degrees=True)
    return xyz, turn


def pose_file(path, t, **extra):
    xyz, turn = robot(t)
    abc = turn.as_euler("ZYX", degrees=True)
    names = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    rows = {"t_s": t} | dict(zip(names, np.hstack([xyz, abc]).T, strict=True)) | extra
    return write_csv(path, rows)


def echo_file(path, t):
    n = len(t)
    return write_csv(
        path, {"t_s": t, "law": np.arange(n) % 50 + 1, "tof_us": np.full(n, 20.0), "amplitude_pct": np.full(n, 50.0)}
    )


def test_poses_are_interpolated_by_lerp_and_slerp(tmp_path) -> None:
    poses = pose_file(tmp_path / "poses.csv", np.arange(0, 2, 0.012), base_x_mm=np.full(167, 5.0), **{
        f"base_{k}": np.zeros(167) for k in ("y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    })  # fmt: skip
    t = np.sort(np.random.default_rng(0).uniform(0.1, 1.9, 400))
    echoes = echo_file(tmp_path / "echoes.csv", t)
    for pair in ([poses, echoes], [echoes, poses]):
        scan = read_scan(pair)
        xyz, turn = robot(t)
        found = scan.Ts_scan_tcp[scan.pose_index]
        np.testing.assert_allclose(found.xyz_mm, xyz, atol=1e-9)
        assert (turn.inv() * found.rotation).magnitude().max() < 1e-9
        np.testing.assert_array_equal(scan.t_s, t)
        np.testing.assert_allclose(scan.T_world_scan.xyz_mm, [5, 0, 0])
        assert scan.issues == ()


def test_nothing_is_extrapolated_and_gaps_are_flagged(tmp_path) -> None:
    t_pose = np.arange(0, 2, 0.01)
    poses = pose_file(tmp_path / "poses.csv", t_pose[(t_pose < 0.8) | (t_pose > 1.2)])
    t = np.arange(-0.5, 2.5, 0.003)
    scan = read_scan([poses, echo_file(tmp_path / "echoes.csv", t)])
    assert scan.t_s.min() >= 0.0
    assert scan.t_s.max() <= t_pose[-1]
    assert not ((scan.t_s > 0.8) & (scan.t_s < 1.2)).any()
    codes = {issue.code: issue for issue in scan.issues}
    assert set(codes) == {"echoes-outside-poses", "pose-gap"}
    outside = np.count_nonzero((t < 0) | (t > t_pose[-1]))
    assert codes["echoes-outside-poses"].message.startswith(f"{outside} of {len(t)} ")


def test_pairs_that_do_not_fit(tmp_path) -> None:
    poses = pose_file(tmp_path / "poses.csv", np.arange(0, 2, 0.01))
    late = echo_file(tmp_path / "late.csv", np.arange(10, 11, 0.01))
    for sources, code in (([poses, late], "times-do-not-meet"), ([poses, poses], "scan-pair"), ([poses], "scan-half")):
        with pytest.raises(EchoBaseError) as caught:
            read_scan(sources)
        assert caught.value.issues[0].code == code
