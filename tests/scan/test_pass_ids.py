"""Passes found in scans that do not number them."""

import numpy as np
import pytest

from alignment.pass_ids import pass_ids


def raster(pitch: float, spacing: float, noise: float = 0.0):
    xs = np.arange(0, 100.1, spacing)
    rows = [
        np.column_stack([xs if k % 2 == 0 else xs[::-1], np.full(len(xs), k * pitch), np.zeros(len(xs))])
        for k in range(5)
    ]
    xyz = np.concatenate(rows) + noise * np.random.default_rng(0).standard_normal((5 * len(xs), 3))
    return xyz, np.repeat(np.arange(5), len(xs))


@pytest.mark.parametrize("pitch", [22.5, 10.0, 2.0])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_passes_of_a_raster(pitch, noise) -> None:
    xyz, truth = raster(pitch, 2.0, noise)
    found = pass_ids(xyz, None)
    assert found.max() == 4
    # A turn shows one pose late at most.
    assert np.count_nonzero(found != truth) <= 4


def test_a_pause_ends_a_pass_that_goes_straight_on() -> None:
    xyz = np.column_stack([np.arange(100.0), np.zeros(100), np.zeros(100)])
    t = np.arange(100) * 0.01 + np.where(np.arange(100) >= 40, 2.0, 0.0)
    np.testing.assert_array_equal(pass_ids(xyz, t), np.arange(100) >= 40)


def test_slow_noisy_sampling_is_one_pass() -> None:
    x = np.arange(2000) * 0.05
    xyz = np.column_stack([x, 0 * x, 0 * x]) + 0.03 * np.random.default_rng(0).standard_normal((2000, 3))
    assert pass_ids(xyz, None).max() == 0


def test_a_curved_pass_is_one_pass() -> None:
    angle = np.linspace(0, 3, 300)
    assert pass_ids(100 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), None).max() == 0


def test_nothing_and_little() -> None:
    assert len(pass_ids(np.zeros((0, 3)), None)) == 0
    np.testing.assert_array_equal(pass_ids(np.zeros((2, 3)), None), [0, 0])
