"""The posterior of the motion, averaged over what the noise may be, with some directions held at their nominal value."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.stats import chi2, norm, qmc

from alignment.estimate.noise_fit import NoiseFit
from alignment.estimate.noise_kernel import Kernel
from alignment.estimate.noise_mode import factor, whiten, whiten_back
from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

# Draws lighter than this share of the heaviest change nothing.
LIGHT = 3e-3
# Designs that differ by less than this share give the same estimate to this share of its standard deviation.
SAME = 1e-3
# The region that a covariance claims, and how many samples tell how much of a mixture lies in it.
REGION, SAMPLES = 0.95, 8_192
# A direction with less than this share of the motion is one of the nuisances.
HARDLY = 1e-9


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
    lower = factor(len(x), kernel.covariance(theta))
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
    free, steps, inverse = _components(mix, r, z, held, values)
    covariance = free @ np.einsum("q,qij->ij", mix.weights, inverse) @ free.T
    mean = mix.weights @ steps
    d = steps - mean
    covariance += (mix.weights[:, None] * d).T @ d + held @ held.T
    return Posterior(mean, 0.5 * (covariance + covariance.T))


def tail_scale(mix: Mixture, r: Array, z: Array, held: Array, values: Array | None = None, known: int = 6) -> float:
    """Return by how much the covariance of the first `known` unknowns has to grow for its 95 % ellipsoid to hold 95 %.

    A mixture of Gaussians of different widths has heavier tails than the Gaussian of its covariance, as Student's t has;
    never less than 1. Arguments as of `solve`; by quasi-random samples, the same ones every time.
    """
    free, steps, inverse = _components(mix, r, z, held, values)
    basis, size, _ = np.linalg.svd(free[:known], full_matrices=False)
    basis = basis[:, size > HARDLY]
    if not basis.shape[1]:
        return 1.0
    to = basis.T @ free[:known]
    roots = np.linalg.cholesky(to @ inverse @ to.T)
    d = (steps - mix.weights @ steps)[:, :known] @ basis
    covariance = np.einsum("q,qij,qkj->ik", mix.weights, roots, roots) + (mix.weights[:, None] * d).T @ d
    unit = _samples(basis.shape[1] + 1)
    of = np.minimum(np.searchsorted(np.cumsum(mix.weights), unit[:, 0]), len(mix.weights) - 1)
    at = d[of] + np.einsum("nij,nj->ni", roots[of], norm.ppf(unit[:, 1:]))
    m2 = np.einsum("ni,ni->n", at, np.linalg.solve(covariance, at.T).T)
    return max(1.0, float(np.quantile(m2, REGION) / chi2.ppf(REGION, basis.shape[1])))


@lru_cache(maxsize=8)
def _samples(columns: int) -> Array:
    """Return quasi-random points (n, columns) in the unit cube."""
    return np.asarray(qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(20261)).random(SAMPLES))


def _components(mix: Mixture, r: Array, z: Array, held: Array, values: Array | None) -> tuple[Array, Array, Array]:
    """Return a basis of what is free (k, f), and per model its step (q, k) and covariance (q, f, f)."""
    k = mix.unknowns
    free = complement(held, k)
    back = -held @ (held.T @ z if values is None else values)
    info = mix.information
    pull = -np.einsum("qnk,n->qk", mix.solved, r) - info @ back - z
    inverse = np.asarray(np.linalg.inv(free.T @ info @ free + np.eye(free.shape[1])))
    steps = back + np.einsum("qij,qj->qi", inverse, pull @ free) @ free.T
    return free, steps, inverse


def complement(held: Array, k: int) -> Array:
    """Return an orthonormal basis (k, k - h) of what is orthogonal to held (k, h)."""
    if held.shape[1] == 0:
        return np.eye(k)
    u, _, _ = np.linalg.svd(held, full_matrices=True)
    return np.asarray(u[:, held.shape[1] :])
