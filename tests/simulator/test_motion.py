"""How the robot moves between programmed poses."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from alignment.simulator.motion import ProgramMotion, firing_places
from planner.frames import Transform
from tests.simulator.cells import looking_down, program

RADIUS = 400.0


def on_arc(angle):
    """Poses on a circle in x z, beam to its centre."""
    z = np.stack([-np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
    x = np.tile([0.0, 1.0, 0.0], (len(angle), 1))
    return Transform.from_axes("base", "tcp", x, np.cross(z, x), z, -RADIUS * z)


def test_a_spline_through_poses_on_a_circle_stays_on_it() -> None:
    angle = np.radians(np.arange(-20, 21, 2.0))
    n = len(angle)
    path = program(on_arc(angle), np.arange(n) > 0, block=np.where(np.arange(n) > 0, 0, -1))
    motion = ProgramMotion(path)
    poses = motion.poses(np.linspace(0, motion.length_mm, 2000))
    off = np.linalg.norm(poses.xyz_mm[:, [0, 2]], axis=1) - RADIUS
    assert np.abs(off).max() < 2e-4
    across = np.einsum(
        "ij,ij->i", poses.rotation_matrix[:, :, 2], poses.xyz_mm / np.linalg.norm(poses.xyz_mm, axis=1)[:, None]
    )
    assert np.degrees(np.arccos(np.clip(-across, -1, 1))).max() < 0.01


def test_straight_motions_cut_the_chord_and_turn_by_slerp() -> None:
    poses = on_arc(np.radians([-10.0, 10.0]))
    motion = ProgramMotion(program(poses, [False, True]))
    middle = motion.poses(np.array([0.3 * motion.length_mm]))
    np.testing.assert_allclose(middle.xyz_mm[0], 0.7 * poses.xyz_mm[0] + 0.3 * poses.xyz_mm[1])
    wanted = Slerp([0, 1], Rotation.from_matrix(poses.rotation_matrix))(0.3)
    assert (wanted.inv() * middle.rotation[0]).magnitude() < 1e-12


def test_two_blocks_are_two_splines() -> None:
    xyz = np.array([[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [30, 10, 0], [30, 20, 0], [30, 30, 0]], float)
    path = program(looking_down(xyz, np.array([1.0, 0, 0])), np.ones(7), block=[-1, 0, 0, 0, 1, 1, 1])
    poses = ProgramMotion(path).poses(np.linspace(0, 60, 601)).xyz_mm
    # The corner between the blocks stays a corner: one spline through all would swing out.
    assert np.abs(poses[:301, 1]).max() < 1e-9
    assert np.abs(poses[301:, 0] - 30).max() < 1e-9


def test_data_are_taken_only_where_the_signal_is_on_and_every_spacing() -> None:
    xyz = np.array([[0, 0, 0], [10, 0, 0], [110, 0, 0], [120, 0, 0], [120, 20, 0], [110, 20, 0], [10, 20, 0]], float)
    on = [False, False, True, False, False, False, True]
    path = program(looking_down(xyz, np.array([1.0, 0, 0])), on, pass_id=[0, 0, 0, 0, 1, 1, 1])
    motion = ProgramMotion(path)
    s, pass_id, stretches = firing_places(path, motion, 2.0)
    x = motion.poses(s).xyz_mm
    np.testing.assert_allclose(x[:51, 0], np.arange(10, 111, 2.0))
    np.testing.assert_allclose(x[51:, 0], np.arange(110, 9, -2.0))
    np.testing.assert_array_equal(pass_id, np.repeat([0, 1], 51))
    assert [(part.start, part.stop) for part in stretches] == [(0, 51), (51, 102)]
    np.testing.assert_allclose(np.diff(motion.seconds(s))[:50], 0.02)


def test_quaternion_signs_do_not_matter() -> None:
    angle = np.radians(np.arange(150, 211, 4.0))
    turns = Rotation.from_euler("ZYX", np.stack([np.degrees(angle), 0 * angle, 180 + 0 * angle], 1), degrees=True)
    poses = Transform.from_parts("base", "tcp", turns, np.stack([10 * np.arange(len(angle)), 0 * angle, 0 * angle], 1))
    n = len(angle)
    motion = ProgramMotion(program(poses, np.ones(n), block=np.zeros(n)))
    found = motion.poses(np.array([35.0, 75.0, 105.0]))
    a = np.degrees(np.interp([3.5, 7.5, 10.5], np.arange(n), angle))
    wanted = Rotation.from_euler("ZYX", np.stack([a, 0 * a, 180 + 0 * a], 1), degrees=True)
    assert np.degrees((wanted.inv() * found.rotation).magnitude()).max() < 1e-3
