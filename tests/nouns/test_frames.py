"""Transforms: group axioms, frame names that must meet, KUKA A B C against scipy and robodk, gimbal and near-identity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robodk.robomath import KUKA_2_Pose
from scipy.spatial.transform import Rotation

from planner.frames import FRAMES, FrameMismatchError, Transform, abc_deg

angles = st.floats(-360.0, 360.0)
near_gimbal = st.sampled_from([-90.0, 90.0, -90.0 + 1e-7, 90.0 - 1e-7, 89.9995, -89.9985])
tiny = st.floats(-1e-7, 1e-7)
lengths = st.floats(-5000.0, 5000.0)
abc_triples = st.one_of(
    st.tuples(angles, angles, angles), st.tuples(angles, near_gimbal, angles), st.tuples(tiny, tiny, tiny)
)
poses = st.builds(lambda xyz, abc: np.array([*xyz, *abc]), st.tuples(lengths, lengths, lengths), abc_triples)


def rotation_gap(a: np.ndarray, b: np.ndarray) -> float:
    """Angle (rad) between rotation matrices, exact for small ones too."""
    return float(np.linalg.norm(a - b) / np.sqrt(2.0))


@given(poses, poses, poses)
def test_composition_is_associative(p, q, r):
    a = Transform.from_xyzabc("world", "base", p)
    b = Transform.from_xyzabc("base", "part", q)
    c = Transform.from_xyzabc("part", "tcp", r)
    np.testing.assert_allclose(((a @ b) @ c).matrix, (a @ (b @ c)).matrix, atol=1e-8)


@given(poses)
def test_inverse_and_identity(p):
    t = Transform.from_xyzabc("world", "base", p)
    np.testing.assert_allclose((t @ t.inv()).matrix, np.eye(4), atol=1e-9)
    np.testing.assert_allclose((Transform.identity("world", "world") @ t).matrix, t.matrix, atol=1e-12)


@given(poses)
def test_matrix_is_homogeneous_and_points_agree_with_it(p):
    t = Transform.from_xyzabc("world", "base", p)
    point = np.array([12.0, -7.0, 1500.0])
    np.testing.assert_allclose(t.points(point), (t.matrix @ [*point, 1.0])[:3], atol=1e-8)
    np.testing.assert_allclose(t.directions(point), t.matrix[:3, :3] @ point, atol=1e-8)


@given(poses)
def test_kuka_angles_round_trip_as_rotations(p):
    t = Transform.from_xyzabc("world", "base", p)
    back = Transform.from_xyzabc("world", "base", t.xyzabc)
    # Inside 0.001 deg of the gimbal C is set to 0, which costs at most that angle.
    limit = np.radians(0.0015) if abs(abs(t.xyzabc[4]) - 90.0) < 0.001 else 1e-9
    assert rotation_gap(t.rotation_matrix, back.rotation_matrix) < limit
    np.testing.assert_array_equal(back.xyz_mm, t.xyz_mm)
    assert ((t.xyzabc[3:] > -180.0) & (t.xyzabc[3:] <= 180.0)).all()


@given(poses)
def test_abc_is_the_kuka_convention_of_robodk(p):
    reference = np.array(KUKA_2_Pose(list(p)).rows)
    np.testing.assert_allclose(Transform.from_xyzabc("world", "base", p).matrix, reference, atol=1e-9)


@given(abc_triples)
def test_abc_matches_elementary_rotations(abc):
    a, b, c = np.radians(abc)
    rz = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    rx = np.array([[1, 0, 0], [0, np.cos(c), -np.sin(c)], [0, np.sin(c), np.cos(c)]])
    t = Transform.from_xyzabc("world", "base", [0, 0, 0, *abc])
    np.testing.assert_allclose(t.rotation_matrix, rz @ ry @ rx, atol=1e-12)


def test_no_negative_zero_and_gimbal_gives_c_zero():
    assert not np.signbit(abc_deg(np.eye(3))).any()
    for b in (90.0, -90.0):
        a, b_out, c = abc_deg(Rotation.from_euler("ZYX", [20.0, b, 50.0], degrees=True).as_matrix())
        assert c == 0.0
        assert b_out == pytest.approx(b)
        assert np.isfinite(a)


@given(st.tuples(*[st.floats(-2.5, 2.5)] * 3), st.tuples(*[st.floats(-100, 100)] * 3))
def test_exp_and_log_are_inverse_and_rotation_comes_first(rotation, translation):
    xi = np.array([*rotation, *translation])
    if np.linalg.norm(rotation) > 3.0:
        xi[:3] *= 3.0 / np.linalg.norm(rotation)
    t = Transform.from_exp("base", "basecorr", xi)
    np.testing.assert_allclose(t.exp, xi, atol=1e-7)
    np.testing.assert_allclose(t.rotation.as_rotvec(), xi[:3], atol=1e-9)


@given(poses)
def test_quaternion_is_scalar_first(p):
    t = Transform.from_xyzabc("world", "base", p)
    back = Transform.from_xyz_wxyz("world", "base", t.xyz_mm, t.wxyz)
    np.testing.assert_allclose(back.matrix, t.matrix, atol=1e-9)
    np.testing.assert_allclose(Transform.identity("world", "base").wxyz, [1, 0, 0, 0])


def test_stacks_compose_with_single_transforms_and_with_stacks():
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.uniform(-100, 100, (7, 3)), rng.uniform(-180, 180, (7, 3))], axis=1)
    stack = Transform.from_xyzabc("part", "tcp", values)
    single = Transform.from_xyzabc("base", "part", values[0])
    composed = single @ stack
    assert composed.is_stack
    assert len(composed) == 7
    np.testing.assert_allclose(composed.matrix[3], single.matrix @ stack.matrix[3], atol=1e-9)
    np.testing.assert_allclose((stack.inv() @ stack).matrix, np.tile(np.eye(4), (7, 1, 1)), atol=1e-9)
    points = rng.uniform(-10, 10, (7, 3))
    np.testing.assert_allclose(stack.points(points)[5], stack[5].points(points[5]), atol=1e-9)


@pytest.mark.parametrize("right", [name for name in FRAMES if name != "base"])
def test_frames_that_do_not_meet_raise(right):
    with pytest.raises(FrameMismatchError, match="do not meet"):
        Transform.identity("world", "base") @ Transform.identity(right, "tcp")


def test_unknown_frames_reflections_and_scales_are_refused():
    with pytest.raises(FrameMismatchError, match="not a frame"):
        Transform.identity("robot", "base")
    with pytest.raises(ValueError, match="rigid"):
        Transform.from_matrix("world", "base", np.diag([1, 1, -1, 1.0]))
    with pytest.raises(ValueError, match="rigid"):
        Transform.from_matrix("world", "base", np.diag([1.001, 1.001, 1.001, 1.0]))
    with pytest.raises(ValueError, match="rigid"):
        Transform.from_matrix("world", "base", np.full((4, 4), np.nan))
