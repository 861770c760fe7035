"""Hyper-parameters of the noise from the residuals themselves, and the posterior of the motion averaged over them.

Restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545, doi:10.1093/biomet/58.3.545) with weak
log-normal priors; its mode by average-information steps (A. R. Gilmour, R. Thompson, B. R. Cullis, Biometrics 51 (1995)
1440, doi:10.2307/2533274); then the posterior is the mixture over hyper-parameters drawn about the mode (importance
sampling with a fixed Sobol set: same input, same bits). Correlation that is as long as the scan cannot be known from one
scan; the mixture says so where plugging in the mode would not.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.stats import norm, qmc

from alignment.estimate.noise_kernel import NAMES, Kernel
from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

DRAWS = 128
STEPS = 25
# The likelihood of the noise must not lean on where the part was expected: prior this many times wider.
WIDE = 10.0
PROPOSAL_WIDTH = 1.2
# How far out, in Gaussian standard deviations, the tails are looked at, and how much they may stretch.
PROBE = 2.0
STRETCH_LIMITS = (0.6, 3.0)


@dataclass(frozen=True, eq=False)
class NoisePrior:
    """Split normals of the logarithms, in the order of `noise_kernel.NAMES`: mode, spread below and above it, (9,) each."""

    centre: Array
    below: Array
    above: Array

    def precision(self, theta: Array) -> Array:
        """Return the inverse variances (9,) on the side where theta (9,) is."""
        return np.where(theta < self.centre, self.below, self.above) ** -2.0

    def log_density(self, theta: Array) -> Array:
        """Return the terms (9,) of the logarithm of the density, but for a constant."""
        return -0.5 * self.precision(theta) * (theta - self.centre) ** 2


def noise_prior(scatter_mm: float, part_size_mm: float, swath_mm: float) -> NoisePrior:
    """Return what is believed before seeing a residual.

    A robot that wanders by a few hundredths of a millimetre and thousandths of a degree, hardly less but easily more,
    over lengths from millimetres to the size of the part; a part whose form differs from CAD by microns or by much more.
    """
    tilt = np.radians(0.005) * 0.5 * swath_mm
    centre = [scatter_mm, 0.03, 60.0, 30.0, max(tilt, 1e-4), 0.002, 0.25 * part_size_mm, 0.1, 0.045]
    below = [0.7, 0.5, 1.6, 1.8, 0.5, 1.0, 0.8, 1.0, 0.6]
    above = [0.7, 1.2, 1.6, 1.5, 1.2, 1.5, 0.8, 1.0, 0.6]
    return NoisePrior(np.log(centre), np.array(below), np.array(above))


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """Posterior over the hyper-parameters of one scan.

    theta (9,): mode, logarithms of `NAMES`. draws (q, 9) and weights (q,): the mixture. effective: how many draws it is
    worth. x (n, k): design it was found with; whitened: per draw L^-1 x (n, k) and the factor's other half of the way,
    K^-1 x (n, k), or None where K is not positive definite. x None: found without residuals.
    """

    theta: Array
    draws: Array
    weights: Array
    effective: float
    x: Array | None = None
    whitened: tuple[tuple[Array, Array] | None, ...] = ()

    def named(self) -> dict[str, float]:
        """Return the mode by name, mm."""
        return {name: float(v) for name, v in zip(NAMES, np.exp(self.theta), strict=True)}


def fit_noise(rows: NoiseRows, prior: NoisePrior, draws: int = DRAWS) -> NoiseFit:
    """Return the noise of a scan from its residuals."""
    kernel = Kernel(rows)
    active = list(kernel.active)
    theta = prior.centre.copy()
    theta = _mode(kernel, rows, prior, theta)
    information = _fisher(kernel, rows, theta) + np.diag(prior.precision(theta)[active])
    value, vector = np.linalg.eigh(np.linalg.inv(information))
    root = vector * np.sqrt(value)
    stretch = _stretch(kernel, rows, prior, theta, root)
    unit = norm.ppf(qmc.Sobol(len(active), scramble=True, rng=np.random.default_rng(20260)).random(draws))
    side = np.where(unit >= 0.0, stretch[0], stretch[1])
    samples = np.tile(theta, (draws, 1))
    samples[:, active] += PROPOSAL_WIDTH * (unit * side) @ root.T
    found = [_at(kernel, rows, prior, sample) for sample in samples]
    log_weight = np.array([-np.inf if at is None else at.value for at in found])
    whitened = [None if at is None else (at.xw, at.solved) for at in found]
    log_weight += (0.5 * unit**2 + np.log(side)).sum(axis=1)
    weights = np.exp(log_weight - log_weight.max())
    weights /= weights.sum()
    return NoiseFit(theta, samples, weights, float(1.0 / (weights**2).sum()), rows.x, tuple(whitened))


def _stretch(kernel: Kernel, rows: NoiseRows, prior: NoisePrior, theta: Array, root: Array) -> Array:
    """Return how much wider than Gaussian the posterior is to either side along each of its axes (2, d).

    Split normals, as H. Rue, S. Martino, N. Chopin, J. R. Statist. Soc. B 71 (2009) 319,
    doi:10.1111/j.1467-9868.2008.00700.x, use them for skewed hyper-parameters.
    """
    active = list(kernel.active)
    top = _at(kernel, rows, prior, theta)
    assert top is not None
    out = np.ones((2, root.shape[1]))
    for i in range(root.shape[1]):
        for side, sign in enumerate((1.0, -1.0)):
            trial = theta.copy()
            trial[active] += sign * PROBE * root[:, i]
            found = _at(kernel, rows, prior, trial)
            drop = np.inf if found is None else top.value - found.value
            out[side, i] = np.clip(PROBE / np.sqrt(2.0 * max(drop, 1e-3)), *STRETCH_LIMITS)
    return out


def factor(k: Array) -> Array | None:
    """Return the lower Cholesky factor in the place of K (n, n), or None if K is not positive definite to rounding.

    Above the diagonal the factor holds nothing of use.
    """
    # K is its own transpose, which lies in memory by columns, as LAPACK wants it.
    lower, failed = dpotrf(k.T, lower=1, clean=0, overwrite_a=1)
    return None if failed else np.asarray(lower, dtype=np.float64)


def whiten(lower: Array, b: Array) -> Array:
    """Return L^-1 b (n, k), L (n, n) the lower factor."""
    return np.asarray(dtrsm(1.0, lower, b, lower=1), dtype=np.float64)


def whiten_back(lower: Array, b: Array) -> Array:
    """Return L^-T b (n, k)."""
    return np.asarray(dtrsm(1.0, lower, b, lower=1, trans_a=1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class At:
    """value: logarithm of the posterior at some theta. lower (n, n): factor of its covariance, until the next is asked for.

    xw (n, k): L^-1 x. solved (n, k): K^-1 x.
    """

    value: float
    lower: Array
    xw: Array
    solved: Array


def _at(kernel: Kernel, rows: NoiseRows, prior: NoisePrior, theta: Array) -> At | None:
    """Return the posterior at theta (9,); None where K is not positive definite."""
    active = list(kernel.active)
    lower = factor(kernel.covariance(theta))
    if lower is None:
        return None
    w = whiten(lower, np.column_stack([rows.x, rows.r]))
    xw, rw = w[:, :-1], w[:, -1]
    inner = np.linalg.cholesky(xw.T @ xw + np.eye(rows.x.shape[1]) / WIDE**2)
    explained = np.linalg.solve(inner, xw.T @ rw)
    value = -np.log(np.diag(lower)).sum() - np.log(np.diag(inner)).sum() - 0.5 * (rw @ rw - explained @ explained)
    return At(float(value + prior.log_density(theta)[active].sum()), lower, xw, whiten_back(lower, xw))


def _projector(rows: NoiseRows, lower: Array) -> Array:
    """Return P = K^-1 - K^-1 X (X' K^-1 X + 1/wide^2)^-1 X' K^-1 (n, n); the factor is used up."""
    half = np.tril(dpotri(lower, lower=1, overwrite_c=1)[0])
    inverse = half + half.T
    inverse[np.diag_indices(len(half))] *= 0.5
    kx = inverse @ rows.x
    inner = rows.x.T @ kx + np.eye(rows.x.shape[1]) / WIDE**2
    inverse -= kx @ np.linalg.solve(inner, kx.T)
    return inverse


def _mode(kernel: Kernel, rows: NoiseRows, prior: NoisePrior, theta: Array) -> Array:
    """Climb to the mode by damped average-information steps."""
    active = list(kernel.active)
    damping, best, here = 1e-2, -np.inf, theta
    step = np.zeros(len(active))
    at: tuple[Array, Array] | None = None
    for _ in range(STEPS):
        trial = here.copy()
        trial[active] += step
        found = _at(kernel, rows, prior, trial)
        if found is not None and found.value >= best - 1e-9:
            gain = found.value - best
            best, here = found.value, trial
            p, by = _projector(rows, found.lower), kernel.derivatives(trial)
            pr = p @ rows.r
            pulled = np.stack([d @ pr for d in by])
            precision = prior.precision(trial)[active]
            u = trial[active] - prior.centre[active]
            gradient = np.array([-0.5 * np.vdot(p, d) for d in by]) + 0.5 * pulled @ pr - precision * u
            at = (gradient, 0.5 * pulled @ p @ pulled.T + np.diag(precision))
            damping = max(damping * 0.3, 1e-4)
            if gain < 1e-3 and np.abs(step).max() < 0.02:
                break
        else:
            damping = max(damping, 0.1) * 5.0
        if at is None or damping > 1e4:
            break
        gradient, information = at
        step = np.asarray(np.linalg.solve(information + damping * np.diag(np.diag(information)), gradient))
        step *= min(1.0, 1.5 / max(float(np.abs(step).max()), 1e-12))
    return here


def _fisher(kernel: Kernel, rows: NoiseRows, theta: Array) -> Array:
    """Return the expected information tr(P Ki P Kj) / 2 of the active logarithms."""
    lower = factor(kernel.covariance(theta))
    assert lower is not None
    p = _projector(rows, lower)
    turned = [p @ d for d in kernel.derivatives(theta)]
    return np.array([[0.5 * np.vdot(a, b.T) for b in turned] for a in turned])
