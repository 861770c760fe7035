"""Inverse kinematics, Status and Turn against a second library (EAIK) and against geometry."""

import numpy as np
import pytest
from eaik.IK_HP import HPRobot

from planner.robot import forward, inverse, load_robot, status, turn
from tests.robot.chain import AXES, TOOL0, URDF_MM

L6_MM = [(0, 0, 675), (260, 0, 0), (680, 0, 0), (970, 0, -35), (0, 0, 0), (0, 0, 0), (115, 0, 0)]
ARMS = {"kuka-kr16-l6-2": L6_MM, **{name: URDF_MM[name] for name in ("kuka-kr6-r900-2", "kuka-kr210-r3100-2")}}


def eaik(name: str) -> HPRobot:
    return HPRobot(AXES, np.asarray(ARMS[name], dtype=float))


def geometric_status(name: str, axes_deg: np.ndarray) -> int:
    """Status from the places of elbow and wrist in space, by rotating the links one after the other."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415

    origins = np.asarray(ARMS[name], dtype=float)
    turn_, at, joints = Rotation.identity(), np.zeros(3), []
    for origin, axis, angle in zip(origins[:6], AXES, axes_deg, strict=True):
        at = at + turn_.apply(origin)
        joints.append(at)
        turn_ = turn_ * Rotation.from_rotvec(np.radians(angle) * axis)
    first = Rotation.from_rotvec(np.radians(axes_deg[0]) * AXES[0])
    shoulder, elbow, wrist = (first.inv().apply(joints[i]) for i in (1, 2, 4))
    overhead = wrist[0] < 0.0
    # Axis 3 turns about +y of the arm plane: beyond the stretched arm the wrist hangs to the right of the upper arm.
    bent = np.cross(elbow - shoulder, wrist - elbow)[1] > 0.0
    return int(overhead) + 2 * int(bent) + 4 * int(axes_deg[4] < 0.0)


@pytest.mark.parametrize("name", sorted(ARMS))
def test_all_solutions_agree_with_eaik_in_axes_status_and_turn(name: str) -> None:
    robot, other = load_robot(name), eaik(name)
    low, high = robot.limits_deg.T
    axes = np.random.default_rng(3).uniform(low, high, (400, 6))
    poses = forward(robot, axes)
    ours = inverse(robot, poses)
    compared = 0
    for i in range(len(axes)):
        pose = poses.matrix[i].copy()
        pose[:3, :3] = pose[:3, :3] @ TOOL0.as_matrix().T
        answer = other.IK(pose)
        theirs = np.degrees(answer.Q)[~np.asarray(answer.is_LS, dtype=bool)]
        theirs = (theirs + 180.0) % 360.0 - 180.0
        mine = ours[i][np.isfinite(ours[i, :, 0])]
        assert len(theirs) == len(mine)
        gap = np.abs((theirs[:, None] - mine[None] + 180.0) % 360.0 - 180.0).max(axis=2)
        match = gap.argmin(axis=1)
        assert gap.min(axis=1).max() < 1e-5
        assert sorted(match) == list(range(len(mine)))
        wanted = [geometric_status(name, row) for row in theirs]
        assert status(robot, mine[match]).tolist() == wanted
        signs = [sum(1 << k for k in range(6) if row[k] < 0.0) for row in theirs]
        assert turn(mine[match]).tolist() == signs
        compared += len(mine)
    assert compared > 1500


@pytest.mark.parametrize("name", sorted(ARMS))
def test_each_branch_keeps_one_status_and_no_two_share_it(name: str) -> None:
    robot = load_robot(name)
    low, high = robot.limits_deg.T
    axes = np.random.default_rng(5).uniform(low, high, (3000, 6))
    found = inverse(robot, forward(robot, axes))
    seen = [set(status(robot, found[np.isfinite(found[:, b, 0]), b]).tolist()) for b in range(8)]
    assert all(len(group) == 1 for group in seen)
    assert set().union(*seen) == set(range(8))


def test_turn_follows_the_written_numbers() -> None:
    # A value that a program writes as 0.0000 is not negative, whatever its sign was.
    assert turn([[1.0, -90.0, 90.0, -1e-12, -0.00006, 0.0]]).tolist() == [0b010010]
    assert turn([[-185.0, 10.0, 10.0, -350.0, 10.0, -1.0]]).tolist() == [0b101001]


def test_status_of_the_home_position() -> None:
    robot = load_robot("kuka-kr16-l6-2")
    assert status(robot, [[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]]).tolist() == [2]
    assert status(robot, [[0.0, -90.0, 90.0, 0.0, -1.0, 0.0]]).tolist() == [6]
    # Elbow: A3 = -2 is beyond the stretched arm of the L6 (-2.07 deg), -2.1 is not.
    assert status(robot, [[0.0, 0.0, -2.0, 0.0, 5.0, 0.0], [0.0, 0.0, -2.1, 0.0, 5.0, 0.0]]).tolist() == [2, 0]
    # Leaning back over axis 1.
    assert status(robot, [[0.0, -150.0, 90.0, 0.0, 5.0, 0.0], [0.0, -150.0, -30.0, 0.0, 5.0, 0.0]]).tolist() == [2, 1]
