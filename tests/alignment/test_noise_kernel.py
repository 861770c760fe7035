"""What the error of a robot is taken to share along and between passes, against an Ornstein-Uhlenbeck process by hand."""

import numpy as np
import pytest

from alignment.estimate.noise_kernel import Kernel
from alignment.estimate.noise_rows import NoiseRows


def rows(from_mm, to_mm, passes) -> NoiseRows:
    n = len(from_mm)
    place = np.column_stack([from_mm, np.zeros(n), np.zeros(n)])
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    return NoiseRows(
        np.zeros(n), np.zeros((n, 6)), np.ones(n), np.arange(n, dtype=np.int32), np.zeros(n), place, 1.0,
        np.asarray(from_mm, float), np.asarray(to_mm, float), np.asarray(passes, np.int32), np.zeros(n, bool), up,
    )  # fmt: skip


@pytest.mark.parametrize("way_mm", [2.0, 20.0, 600.0])
def test_the_way_between_passes_is_as_long_as_the_data_say(way_mm):
    """Points (stretches of no length) at 0 and 10 mm of one pass and, after some way, at its start of the next."""
    at = np.array([0.0, 10.0, 10.0 + way_mm])
    found = Kernel(rows(at, at, [0, 0, 1])).block_correlation(30.0, 7.0)
    apart = np.array([[0, 10, 17], [10, 0, 7], [17, 7, 0]])
    assert np.allclose(found, np.exp(-apart / 30.0), rtol=1e-6)


def test_another_scan_shares_nothing():
    at = np.array([0.0, 10.0, 10.0 + 1e4])
    found = Kernel(rows(at, at, [0, 0, 1])).block_correlation(150.0, 7.0)
    assert found[0, 1] == pytest.approx(np.exp(-10 / 150))
    assert np.abs(found[:2, 2]).max() < 1e-9


def test_means_over_stretches_against_sums_of_the_process():
    ends = np.array([[0.0, 8.0], [8.0, 16.0], [30.0, 38.0]])
    found = Kernel(rows(ends[:, 0], ends[:, 1], [0, 0, 0])).block_correlation(5.0, 7.0)
    s = np.linspace(0, 8, 2001)[:-1] + 0.002
    t = ends[:, :1] + s
    wanted = np.array([[np.exp(-np.abs(a[:, None] - b[None, :]) / 5.0).mean() for b in t] for a in t])
    assert np.allclose(found, wanted, atol=1e-3)
