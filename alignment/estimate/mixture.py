"""The posterior of the motion, averaged over what the noise may be, with some directions held at their nominal value."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from alignment.estimate.noise_fit import NoiseFit, factor
from alignment.estimate.noise_kernel import Kernel
from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

# Draws lighter than this share of the heaviest change nothing.
LIGHT = 3e-3


@dataclass(frozen=True, eq=False)
class Mixture:
    """Generalised least squares for each of q noise models. Unknowns (k,) are in prior standard deviations.

    weights (q,). solved (q, n, k): K^-1 X. information (q, k, k): X' K^-1 X.
    """

    weights: Array
    solved: Array
    information: Array

    @property
    def unknowns(self) -> int:
        """Number of unknowns k: six of the motion, then nuisances."""
        return self.information.shape[1]


@dataclass(frozen=True, eq=False)
class Posterior:
    """step (k,) from the present values, and covariance (k, k), held directions at their prior variance."""

    step: Array
    covariance: Array


def mixture(rows: NoiseRows, fit: NoiseFit, most: int | None = None) -> Mixture:
    """Return the least-squares operators of the noise models of a fit; of the heaviest `most` of them, if given."""
    kernel = Kernel(rows)
    kept = np.flatnonzero(fit.weights > LIGHT * fit.weights.max())
    if most is not None:
        kept = np.sort(kept[np.argsort(-fit.weights[kept], kind="stable")[:most]])
    solved, information, weights = [], [], []
    for i in kept:
        lower = factor(kernel.covariance(fit.draws[i]))
        if lower is None:
            continue
        xw = solve_triangular(lower, rows.x, lower=True, check_finite=False)
        solved.append(solve_triangular(lower.T, xw, lower=False, check_finite=False))
        information.append(xw.T @ xw)
        weights.append(fit.weights[i])
    w = np.array(weights)
    return Mixture(w / w.sum(), np.array(solved), np.array(information))


def solve(mix: Mixture, r: Array, z: Array, held: Array, values: Array | None = None) -> Posterior:
    """Return the posterior of unknowns that stand at z (k,) with residuals r (n,).

    held (k, h): orthonormal directions whose component of z + step is exactly zero; the rest is solved with them fixed.
    values (h,): how far off nominal they stand, if that is better known than held' z.
    """
    k = mix.unknowns
    free = complement(held, k)
    back = -held @ (held.T @ z if values is None else values)
    steps, covariance = np.zeros((len(mix.weights), k)), np.zeros((k, k))
    for i, w in enumerate(mix.weights):
        info = mix.information[i]
        pull = -mix.solved[i].T @ r - info @ back - z
        inverse = np.linalg.inv(free.T @ info @ free + np.eye(free.shape[1]))
        steps[i] = back + free @ (inverse @ (free.T @ pull))
        covariance += w * free @ inverse @ free.T
    mean = mix.weights @ steps
    d = steps - mean
    covariance += (mix.weights[:, None] * d).T @ d + held @ held.T
    return Posterior(mean, 0.5 * (covariance + covariance.T))


def complement(held: Array, k: int) -> Array:
    """Return an orthonormal basis (k, k - h) of what is orthogonal to held (k, h)."""
    if held.shape[1] == 0:
        return np.eye(k)
    u, _, _ = np.linalg.svd(held, full_matrices=True)
    return np.asarray(u[:, held.shape[1] :])
