"""Hyper-parameters of the noise from the residuals themselves, and the posterior of the motion averaged over them.

Restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545, doi:10.1093/biomet/58.3.545) with weak
log-normal priors; its mode by average-information steps (A. R. Gilmour, R. Thompson, B. R. Cullis, Biometrics 51 (1995)
1440, doi:10.2307/2533274); then the posterior is the mixture over hyper-parameters drawn about the mode (importance
sampling with a fixed Sobol set: same input, same bits). Correlation that is as long as the scan cannot be known from one
scan; the mixture says so where plugging in the mode would not.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, qmc

from alignment.estimate.noise_kernel import NAMES, Kernel
from alignment.estimate.noise_mode import mode, posterior_at
from alignment.estimate.noise_prior import NoisePrior
from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

DRAWS = 128
PROPOSAL_WIDTH = 1.2
# How far out, in Gaussian standard deviations, the tails are looked at, and how much they may stretch.
PROBE = 2.0
STRETCH_LIMITS = (0.6, 3.0)


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
    theta, information = mode(kernel, prior)
    value, vector = np.linalg.eigh(np.linalg.inv(information))
    root = vector * np.sqrt(value)
    stretch = _stretch(kernel, prior, theta, root)
    unit = norm.ppf(qmc.Sobol(len(active), scramble=True, rng=np.random.default_rng(20260)).random(draws))
    side = np.where(unit >= 0.0, stretch[0], stretch[1])
    samples = np.tile(theta, (draws, 1))
    samples[:, active] += PROPOSAL_WIDTH * (unit * side) @ root.T
    found = [posterior_at(kernel, prior, sample) for sample in samples]
    log_weight = np.array([-np.inf if at is None else at.value for at in found])
    whitened = [None if at is None else (at.xw, at.solved) for at in found]
    log_weight += (0.5 * unit**2 + np.log(side)).sum(axis=1)
    weights = np.exp(log_weight - log_weight.max())
    weights /= weights.sum()
    return NoiseFit(theta, samples, weights, float(1.0 / (weights**2).sum()), rows.x, tuple(whitened))


def _stretch(kernel: Kernel, prior: NoisePrior, theta: Array, root: Array) -> Array:
    """Return how much wider than Gaussian the posterior is to either side along each of its axes (2, d).

    Split normals, as H. Rue, S. Martino, N. Chopin, J. R. Statist. Soc. B 71 (2009) 319,
    doi:10.1111/j.1467-9868.2008.00700.x, use them for skewed hyper-parameters.
    """
    active = list(kernel.active)
    top = posterior_at(kernel, prior, theta)
    assert top is not None
    out = np.ones((2, root.shape[1]))
    for i in range(root.shape[1]):
        for side, sign in enumerate((1.0, -1.0)):
            trial = theta.copy()
            trial[active] += sign * PROBE * root[:, i]
            found = posterior_at(kernel, prior, trial)
            drop = np.inf if found is None else top.value - found.value
            out[side, i] = np.clip(PROBE / np.sqrt(2.0 * max(drop, 1e-3)), *STRETCH_LIMITS)
    return out
