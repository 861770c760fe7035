"""Arun's fit against constructed truth and scipy's own solution."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from alignment.rigid import fit_rigid
from planner.errors import EchoBaseError


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
def test_recovers_any_rigid_motion(seed, n):
    rng = np.random.default_rng(seed)
    rotation, offset = Rotation.random(rng=rng), rng.uniform(-500, 500, 3)
    p = rng.uniform(-100, 100, (n, 3))
    r, t = fit_rigid(p, rotation.apply(p) + offset)
    np.testing.assert_allclose(r, rotation.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(t, offset, atol=1e-6)


def test_noisy_weighted_fit_is_that_of_kabsch():
    rng = np.random.default_rng(3)
    p, w = rng.normal(0, 50, (20, 3)), rng.uniform(0.1, 3, 20)
    q = np.add(Rotation.from_rotvec([0.1, -0.2, 0.3]).apply(p), [1, 2, 3]) + rng.normal(0, 0.5, (20, 3))
    r, t = fit_rigid(p, q, w)
    p0, q0 = p - np.average(p, axis=0, weights=w), q - np.average(q, axis=0, weights=w)
    expected, _ = Rotation.align_vectors(q0, p0, weights=w)
    np.testing.assert_allclose(r, expected.as_matrix(), atol=1e-10)
    np.testing.assert_allclose(t, np.average(q - p @ r.T, axis=0, weights=w), atol=1e-9)


def test_a_mirror_image_is_never_the_answer():
    rng = np.random.default_rng(4)
    p = rng.normal(0, 50, (10, 3))
    r, _ = fit_rigid(p, p * [1, 1, -1])
    assert np.linalg.det(r) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("points", "code"),
    [
        (np.array([[0.0, 0, 0], [1, 0, 0]]), "points-too-few"),
        (np.outer(np.arange(5.0), [1, 2, 3]), "points-collinear"),
        (np.zeros((4, 3)), "points-collinear"),
    ],
)
def test_undefined_rotations_are_refused(points, code):
    with pytest.raises(EchoBaseError) as caught:
        fit_rigid(points, points + 1.0)
    assert caught.value.issues[0].code == code
