"""Following a whole path in one configuration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.probe import tool_axes
from planner.robot import first_axes, flange_poses, forward, load_robot, reach, status, turn
from planner.setup import Base, Pose, Setup, Tool

L6 = load_robot("kuka-kr16-l6-2")


def joint_path(start, stop, n: int = 200) -> np.ndarray:
    return np.linspace(np.asarray(start, dtype=float), np.asarray(stop, dtype=float), n)


def test_a_joint_path_comes_back_unwrapped_beyond_half_a_turn() -> None:
    axes = joint_path([10, -80, 100, -20, 40, -340], [40, -60, 70, 30, 60, 330])
    found = reach(L6, forward(L6, axes))
    assert found.reachable.all()
    # The whole-turn choice is free where limits allow it; here A6 spans 670 of 700 deg, so it is not.
    assert np.abs(found.axes_deg - axes).max() < 1e-6
    assert (found.status, found.turn) == (int(status(L6, axes[:1])[0]), int(turn(axes[:1])[0]))


def test_the_path_keeps_its_status_and_its_pose() -> None:
    rng = np.random.default_rng(11)
    for _ in range(10):
        a = rng.uniform([-90, -110, 60, -60, 20, -100], [90, -50, 120, 60, 80, 100])
        axes = joint_path(a, a + rng.uniform(-15, 15, 6))
        flange = forward(L6, axes)
        found = reach(L6, flange)
        assert found.reachable.all()
        assert np.abs(forward(L6, found.axes_deg).matrix - flange.matrix).max() < 1e-6
        assert len(set(status(L6, found.axes_deg).tolist())) == 1
        assert np.abs(np.diff(found.axes_deg, axis=0)).max() < 10.0


def test_limits_decide_even_where_a_pose_exists() -> None:
    # A6 has to turn through 720 deg: no whole turn brings all of it inside +-350.
    axes = joint_path([10, -80, 100, 20, 40, -360], [10, -80, 100, 20, 40, 360], 721)
    found = reach(L6, forward(L6, axes))
    assert found.exists.all()
    assert found.reachable.sum() == 701
    assert found.margin_deg.min() == pytest.approx(-10.0, abs=1e-6)


def test_out_of_reach_is_not_reachable() -> None:
    axes = joint_path([0, -80, 90, 0, 40, 0], [0, -40, 60, 0, 40, 0], 50)
    flange = forward(L6, axes)
    far = Transform.from_parts("robroot", "flange", flange.rotation, flange.xyz_mm + np.array([1500.0, 0, 0]))
    found = reach(L6, far)
    assert not found.reachable.any()
    wrist = far.points(np.tile([0.0, 0.0, -115.0], (50, 1))) - [0.0, 0.0, 675.0]
    beyond = np.hypot(np.hypot(wrist[:, 0], wrist[:, 1]) - 260.0, wrist[:, 2]) > 680.0 + np.hypot(970.0, 35.0)
    assert (~found.exists == beyond).all()


def test_a_gap_in_reach_does_not_break_the_unwrapping() -> None:
    axes = joint_path([0, -80, 100, 0, 50, -300], [0, -80, 100, 0, 50, 300], 301)
    flange = forward(L6, axes)
    xyz = flange.xyz_mm.copy()
    xyz[140:145, 0] += 3000.0
    found = reach(L6, Transform.from_parts("robroot", "flange", flange.rotation, xyz))
    assert (~found.exists).sum() == 5
    assert np.abs(np.delete(found.axes_deg - axes, slice(140, 145), axis=0)).max() < 1e-6


def test_singularities_are_seen_where_they_are() -> None:
    wrist = reach(L6, forward(L6, joint_path([0, -80, 100, 10, 2, 0], [0, -80, 100, 10, 12, 0], 101)))
    a5 = np.abs(wrist.axes_deg[:, 4])
    assert (wrist.wrist_singular == (a5 < 5.0)).all()
    assert 0 < wrist.wrist_singular.sum() < 101
    stretched = reach(L6, forward(L6, [[0, -30, -1.5, 10, 40, 0], [0, -30, 30, 10, 40, 0]]))
    assert stretched.elbow_singular.tolist() == [True, False]
    # Wrist above axis 1: A2 = -90 (upper arm upright) and the forearm leaning back by asin(260 / 970).
    lean = np.degrees(np.arcsin((260.0) / np.hypot(970.0, 35.0))) + np.degrees(np.arctan2(35.0, 970.0))
    over = reach(L6, forward(L6, [[0, -90, -lean, 20, 40, 0], [0, -90, 40, 20, 40, 0]]))
    assert over.overhead.tolist() == [True, False]


def test_flange_poses_put_the_tcp_where_it_was_asked() -> None:
    setup = Setup(
        tool=Tool(beam_axis="x", array_axis="-z", tcp=Pose(x_mm=30, y_mm=-20, z_mm=250, a_deg=10, b_deg=-80, c_deg=5)),
        base=Base(x_mm=900, y_mm=100, z_mm=400, a_deg=20, b_deg=3, c_deg=-2),
        robot_root=Pose(x_mm=-50, y_mm=10, z_mm=300, a_deg=15),
    )
    rng = np.random.default_rng(2)
    poses = Transform.from_parts("base", "tcp", Rotation.random(20, rng=rng), rng.uniform(-200, 200, (20, 3)))
    flange = flange_poses(setup, poses)
    tool = setup.tool.tcp.transform("flange", "tcp")
    world = setup.robot_root.transform("world", "robroot") @ flange @ tool
    wanted = setup.T_world_base @ poses
    assert np.abs(world.xyz_mm - wanted.xyz_mm).max() < 1e-9
    # The taught tool's x is the beam, its -z the array.
    assert np.abs(world.rotation_matrix[:, :, 0] - wanted.rotation_matrix[:, :, 2]).max() < 1e-12
    assert np.abs(-world.rotation_matrix[:, :, 2] - wanted.rotation_matrix[:, :, 0]).max() < 1e-12
    assert np.abs((world @ tool_axes(setup.tool)).matrix - wanted.matrix).max() < 1e-9


def setup_and_poses() -> tuple[Setup, Transform]:
    setup = Setup(base=Base(x_mm=1100, y_mm=-100, z_mm=500), tool=Tool(tcp=Pose(z_mm=200)))
    x = np.linspace(-200.0, 200.0, 60)
    flat = np.column_stack([x, 0 * x, np.full_like(x, 15.0), np.full_like(x, 90.0), 0 * x, np.full_like(x, 180.0)])
    return setup, Transform.from_xyzabc("base", "tcp", flat)


def test_first_axes_bring_the_tool_to_the_first_pose() -> None:
    setup, poses = setup_and_poses()
    first = first_axes(L6, setup, poses)
    tcp = setup.T_world_base.inv() @ setup.robot_root.transform("world", "robroot") @ forward(L6, first.axes_deg)
    tcp = tcp @ setup.tool.tcp.transform("flange", "tcp")
    assert np.abs(tcp.matrix - poses.matrix[0]).max() < 1e-7
    assert first.status == int(status(L6, first.axes_deg[None])[0])
    assert first.turn == int(turn(first.axes_deg[None])[0])
    low, high = L6.limits_deg.T
    assert ((first.axes_deg > low) & (first.axes_deg < high)).all()


def test_first_axes_in_a_corrected_base_differ_by_the_correction() -> None:
    setup, poses = setup_and_poses()
    correction = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.8, 0.5])
    renamed = Transform("basecorr", "tcp", poses.rigid)
    first = first_axes(L6, setup, renamed, setup.T_world_base @ correction)
    moved = first_axes(L6, setup, correction @ renamed)
    assert np.abs(first.axes_deg - moved.axes_deg).max() < 1e-9
    assert np.abs(first.axes_deg - first_axes(L6, setup, poses).axes_deg).max() > 1e-3


def test_first_axes_out_of_reach_are_an_error() -> None:
    setup, poses = setup_and_poses()
    far = setup.model_copy(update={"base": Base(x_mm=4000)})
    with pytest.raises(EchoBaseError, match="beyond the arm's reach") as error:
        first_axes(L6, far, poses)
    assert error.value.issues[0].code == "robot-out-of-reach"
    with pytest.raises(EchoBaseError, match="no pose"):
        first_axes(L6, setup, poses[:0])
