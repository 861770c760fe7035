"""The posterior of the motion, averaged over what the noise may be, with some directions held at their nominal value."""

from dataclasses import dataclass

import numpy as np

from alignment.estimate.noise_fit import NoiseFit, factor, whiten, whiten_back
from alignment.estimate.noise_kernel import Kernel
from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

# Draws lighter than this share of the heaviest change nothing.
LIGHT = 3e-3
# Designs that differ by less than this share give the same estimate to this share of its standard deviation.
SAME = 1e-3


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
    """Return the least-squares operators of the noise models of a fit; of the heaviest `most` of them, if given.

    Where the design is still that of the fit, what the fit found is all there is to it, and all models are taken.
    """
    kept = np.flatnonzero(fit.weights > LIGHT * fit.weights.max())
    known = fit.x is not None and _same(rows.x, fit.x)
    if most is not None and not known:
        kept = np.sort(kept[np.argsort(-fit.weights[kept], kind="stable")[:most]])
    kernel = Kernel(rows)
    solved, information, weights = [], [], []
    for i in kept:
        found = fit.whitened[i] if known else _whitened(kernel, fit.draws[i], rows.x)
        if found is None:
            continue
        solved.append(found[1])
        information.append(found[0].T @ found[0])
        weights.append(fit.weights[i])
    w = np.array(weights)
    return Mixture(w / w.sum(), np.array(solved), np.array(information))


def _whitened(kernel: Kernel, theta: Array, x: Array) -> tuple[Array, Array] | None:
    lower = factor(kernel.covariance(theta))
    if lower is None:
        return None
    xw = whiten(lower, x)
    return xw, whiten_back(lower, xw)


def _same(x: Array, other: Array) -> bool:
    """Return whether two designs differ by nothing that an estimate would feel."""
    return x.shape == other.shape and bool((np.abs(x - other).max(axis=0) <= SAME * np.abs(other).max(axis=0)).all())


def solve(mix: Mixture, r: Array, z: Array, held: Array, values: Array | None = None) -> Posterior:
    """Return the posterior of unknowns that stand at z (k,) with residuals r (n,).

    held (k, h): orthonormal directions whose component of z + step is exactly zero; the rest is solved with them fixed.
    values (h,): how far off nominal they stand, if that is better known than held' z.
    """
    k = mix.unknowns
    free = complement(held, k)
    back = -held @ (held.T @ z if values is None else values)
    info = mix.information
    pull = -np.einsum("qnk,n->qk", mix.solved, r) - info @ back - z
    inverse = np.linalg.inv(free.T @ info @ free + np.eye(free.shape[1]))
    steps = back + np.einsum("qij,qj->qi", inverse, pull @ free) @ free.T
    covariance = free @ np.einsum("q,qij->ij", mix.weights, inverse) @ free.T
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
