"""A common value and a scatter from values that each have an uncertainty of their own (random effects), one direction."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import chi2, norm
from scipy.stats import t as student

from planner.frames import Array

LEAST_FOR_SCATTER = 3
LEAST_FOR_OUTLIERS = 5
LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Common:
    """What k parts have in common along one direction, and how much they differ.

    mean, with the half width of its 95 % interval; scatter: standard deviation of the parts about the mean beyond what
    their scans explain, with its 95 % interval; None with fewer than three parts. next_sigma: standard deviation for the
    next part about the mean, such that two of it hold 95 %. odd (k,): two-sided p-value of each part against the others,
    NaN with fewer than five parts.
    """

    mean: float
    half_95: float
    scatter: float | None
    scatter_95: tuple[float, float] | None
    next_sigma: float | None
    odd: Array


def common(values: Array, variances: Array, prior_sigma: float = 1.0) -> Common:
    """Return the common value of k >= 1 parts: values (k,), variances (k,) of their scans.

    Scatter by restricted likelihood; interval of the mean by Hartung, Knapp, Statist. Med. 20, 2001, doi:10.1002/sim.791;
    interval of the scatter by the Q-profile: Viechtbauer, Statist. Med. 26, 2007, doi:10.1002/sim.2514. With fewer than
    three parts the scatter is taken from the setup: prior_sigma, of the fixture.
    """
    y, s2 = np.asarray(values, dtype=np.float64), np.asarray(variances, dtype=np.float64)
    k = len(y)
    if k < LEAST_FOR_SCATTER:
        w = 1.0 / (s2 + prior_sigma**2)
        mean = float(w @ y / w.sum())
        return Common(mean, float(norm.ppf(0.5 + LEVEL / 2) / np.sqrt(w.sum())), None, None, None, np.full(k, np.nan))
    tau2 = _scatter2(y, s2)
    mean, error = _mean(y, s2, tau2)
    factor = float(student.ppf(0.5 + LEVEL / 2, k - 1))
    # The scans of the next part and of these are alike, and the mean is not known exactly either.
    ahead = np.sqrt(tau2 + float(s2.mean()) + error**2) * factor / 2.0
    return Common(mean, factor * error, float(np.sqrt(tau2)), _interval(y, s2), float(ahead), _odd(y, s2))


def _scatter2(y: Array, s2: Array) -> float:
    """Return the variance between parts of greatest restricted likelihood."""

    def cost(log_tau2: float) -> float:
        w = 1.0 / (s2 + np.exp(log_tau2))
        mean = w @ y / w.sum()
        return float(-np.log(w).sum() + np.log(w.sum()) + w @ (y - mean) ** 2)

    top = np.log(max(float(np.var(y, ddof=1)), 1e-18) * 10.0)
    low = np.log(float(s2.min()) * 1e-4 + 1e-24)
    if low >= top:
        return 0.0
    grid = np.linspace(low, top, 40)
    w = 1.0 / (s2 + np.exp(grid)[:, None])
    means = (w * y).sum(axis=1, keepdims=True) / w.sum(axis=1, keepdims=True)
    costs = (w * (y - means) ** 2 - np.log(w)).sum(axis=1) + np.log(w.sum(axis=1))
    at = int(np.argmin(costs))
    if at == 0:
        return 0.0
    around = (grid[at - 1], grid[min(at + 1, len(grid) - 1)])
    return float(np.exp(minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 1e-4}).x))


def _mean(y: Array, s2: Array, tau2: float) -> tuple[float, float]:
    """Return the mean and its standard error (Hartung, Knapp)."""
    w = 1.0 / (s2 + tau2)
    mean = float(w @ y / w.sum())
    return mean, float(np.sqrt(w @ (y - mean) ** 2 / ((len(y) - 1) * w.sum())))


def _interval(y: Array, s2: Array) -> tuple[float, float]:
    """Return the 95 % interval of the scatter: between the values that make Q too large and too small for chance."""
    dof = len(y) - 1

    def q(tau2: float) -> float:
        w = 1.0 / (s2 + tau2)
        return float(w @ (y - w @ y / w.sum()) ** 2)

    ends = []
    for limit in (chi2.ppf(0.5 + LEVEL / 2, dof), chi2.ppf(0.5 - LEVEL / 2, dof)):
        if q(0.0) <= limit:
            ends.append(0.0)
            continue
        top = float(np.var(y)) + float(s2.max())
        while q(top) > limit:
            top *= 4.0
        ends.append(float(np.sqrt(brentq(lambda v, limit=limit: q(v) - limit, 0.0, top, xtol=1e-15, rtol=1e-10))))
    return ends[0], ends[1]


def _odd(y: Array, s2: Array) -> Array:
    """Return how probable it is that a part is as far from the others as it is (k,): each left out in turn."""
    k = len(y)
    out = np.full(k, np.nan)
    if k < LEAST_FOR_OUTLIERS:
        return out
    for i in range(k):
        others = np.arange(k) != i
        tau2 = _scatter2(y[others], s2[others])
        mean, error = _mean(y[others], s2[others], tau2)
        plain = 1.0 / np.sqrt((1.0 / (s2[others] + tau2)).sum())
        spread = np.sqrt(tau2 + s2[i] + max(error, plain) ** 2)
        out[i] = 2.0 * student.sf(abs(y[i] - mean) / spread, k - 2)
    return out
