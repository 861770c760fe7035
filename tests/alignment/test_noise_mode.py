"""The likelihood of the noise against scipy's normal distribution, its slope against differences, all with dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from alignment.estimate.noise_kernel import MEAN_DISTANCE, NAMES, Kernel
from alignment.estimate.noise_mode import WIDE, mode, posterior_at, slope
from alignment.estimate.noise_prior import noise_prior
from alignment.estimate.noise_rows import NoiseRows

BLOCKS, SIZE_MM = 9, 6.0
PRIOR = noise_prior(0.01, 300.0, 30.0)


@pytest.fixture(params=[False, True], ids=["surface", "with edges"])
def rows(request) -> NoiseRows:
    """Three passes of three stretches, two bands of laws each; perhaps two crossings of an edge."""
    rng = np.random.default_rng(7)
    block = np.repeat(np.arange(BLOCKS), 2)
    start = np.arange(BLOCKS) * 8.0 + np.repeat([0.0, 20.0, 60.0], 3)
    across = np.tile([-0.5, 0.5], BLOCKS)
    n = len(block)
    place = np.column_stack([start[block], 10.0 * across, np.zeros(n)])
    out = NoiseRows(
        0.03 * rng.standard_normal(n), rng.standard_normal((n, 6)), rng.integers(5, 40, n).astype(float),
        block.astype(np.int32), across, place, SIZE_MM, start, start + 8.0, np.repeat([0, 1, 2], 3).astype(np.int32),
        np.zeros(n, dtype=bool), np.tile([0.0, 0.0, 1.0], (n, 1)),
    )  # fmt: skip
    if not request.param:
        return out
    return replace(
        out,
        r=np.r_[out.r, 0.05, -0.02],
        x=np.vstack([out.x, rng.standard_normal((2, 6))]),
        count=np.r_[out.count, 3.0, 4.0],
        block=np.r_[out.block, BLOCKS, BLOCKS + 1].astype(np.int32),
        across=np.r_[out.across, 0.0, 0.0],
        position_base=np.vstack([out.position_base, [[-1.0, 0.0, 0.0], [200.0, 0.0, 0.0]]]),
        block_from_mm=np.r_[start, 0.0, 30.0],
        block_to_mm=np.r_[start + 8.0, 2.0, 33.0],
        block_pass=np.r_[out.block_pass, 0, 1].astype(np.int32),
        edge=np.r_[out.edge, True, True],
        direction_base=np.vstack([out.direction_base, [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]]),
    )


def dense(rows: NoiseRows, theta) -> np.ndarray:
    """K entry by entry, as docs/alignment.md says it is."""
    v = dict(zip(NAMES, np.exp(theta), strict=True))
    path = Kernel(rows).block_correlation(v["path_length_mm"], v["gap_mm"])
    n = len(rows)
    k = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            c = path[rows.block[i], rows.block[j]]
            along = rows.direction_base[i] @ rows.direction_base[j]
            if rows.edge[i] and rows.edge[j]:
                k[i, j] = v["edge_path_mm"] ** 2 * along * c + (i == j) * v["edge_nugget_mm"] ** 2 / rows.count[i]
            elif not (rows.edge[i] or rows.edge[j]):
                d = np.linalg.norm(rows.position_base[i] - rows.position_base[j])
                d = np.hypot(d, MEAN_DISTANCE * rows.size_mm)
                tilt = rows.across[i] * rows.across[j]
                k[i, j] = v["field_mm"] ** 2 * np.exp(-d / v["field_length_mm"])
                k[i, j] += (v["path_mm"] ** 2 * along + v["tilt_mm"] ** 2 * tilt) * c
                k[i, j] += (i == j) * v["nugget_mm"] ** 2 / rows.count[i]
            elif i == j:
                raise AssertionError
    return k


def full(kernel: Kernel, packed) -> np.ndarray:
    n = len(kernel.rows)
    out = np.zeros((n, n))
    out.ravel()[kernel._place] = packed
    return out + np.tril(out, -1).T


def test_the_packed_covariance_is_the_dense_one(rows):
    kernel = Kernel(rows)
    assert np.allclose(full(kernel, kernel.covariance(PRIOR.centre)), dense(rows, PRIOR.centre), rtol=1e-12, atol=1e-15)


def test_the_likelihood_is_that_of_a_normal_distribution(rows):
    kernel, (a, b) = Kernel(rows), (PRIOR.centre, PRIOR.centre + 0.3)
    wide = WIDE**2 * rows.x @ rows.x.T
    active = list(kernel.active)

    def by_scipy(theta):
        return multivariate_normal(np.zeros(len(rows)), dense(rows, theta) + wide).logpdf(rows.r) + (
            PRIOR.log_density(theta)[active].sum()
        )

    ours = [posterior_at(kernel, PRIOR, theta).value for theta in (a, b)]
    # scipy's matrix holds numbers from 1e-4 to 1e4: it has eight digits left.
    assert ours[0] - ours[1] == pytest.approx(by_scipy(a) - by_scipy(b), abs=1e-5)


def test_slope_and_information_against_differences_and_dense_algebra(rows):
    kernel = Kernel(rows)
    theta, active, h = PRIOR.centre + 0.2, list(kernel.active), 1e-4
    gradient, information = slope(kernel, PRIOR, theta, posterior_at(kernel, PRIOR, theta))
    by, numeric = [], []
    for i in active:
        up, down = theta.copy(), theta.copy()
        up[i], down[i] = theta[i] + h, theta[i] - h
        by.append((dense(rows, up) - dense(rows, down)) / (2 * h))
        numeric.append((posterior_at(kernel, PRIOR, up).value - posterior_at(kernel, PRIOR, down).value) / (2 * h))
    assert np.allclose(gradient, numeric, rtol=2e-3, atol=2e-3)
    p = np.linalg.inv(dense(rows, theta) + WIDE**2 * rows.x @ rows.x.T)
    pulled = np.stack([d @ p @ rows.r for d in by])
    wanted = 0.5 * pulled @ p @ pulled.T + np.diag(PRIOR.precision(theta)[active])
    assert np.allclose(information, wanted, rtol=1e-3, atol=1e-3)


def test_the_mode_is_a_top(rows):
    kernel = Kernel(rows)
    theta, _ = mode(kernel, PRIOR)
    top = posterior_at(kernel, PRIOR, theta).value
    for i in kernel.active:
        for step in (-0.5, 0.5):
            beside = theta.copy()
            beside[i] += step
            assert posterior_at(kernel, PRIOR, beside).value < top
