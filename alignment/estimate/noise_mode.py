"""The likelihood of the noise at given hyper-parameters, and the climb to where it is largest.

Restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545, doi:10.1093/biomet/58.3.545); its mode by
average-information steps (A. R. Gilmour, R. Thompson, B. R. Cullis, Biometrics 51 (1995) 1440, doi:10.2307/2533274).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsymm
from scipy.linalg.lapack import dpftrf, dpftri, dtfsm, dtfttr

from alignment.estimate.noise_kernel import Kernel
from alignment.estimate.noise_prior import NoisePrior
from planner.frames import Array

STEPS = 25
# A step that raises the logarithm of the posterior by less than this has led to the mode, as near as draws about it need it.
SMALL_GAIN = 0.02
# The likelihood of the noise must not lean on where the part was expected: prior this many times wider.
WIDE = 10.0


def factor(n: int, k: Array) -> Array | None:
    """Return the lower Cholesky factor of K, both packed, in its place; None if K (n, n) is not positive definite."""
    lower, failed = dpftrf(n, k, uplo="L", overwrite_a=1)
    return None if failed else np.asarray(lower, dtype=np.float64)


def whiten(lower: Array, b: Array) -> Array:
    """Return L^-1 b (n, k), L the lower factor, packed."""
    return np.asarray(dtfsm(1.0, lower, b, uplo="L"), dtype=np.float64)


def whiten_back(lower: Array, b: Array) -> Array:
    """Return L^-T b (n, k)."""
    return np.asarray(dtfsm(1.0, lower, b, uplo="L", trans="T"), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class At:
    """value: logarithm of the posterior at some theta. lower: packed factor of its covariance, until the next is asked for.

    xw (n, k): L^-1 x. solved (n, k): K^-1 x. solved_r (n,): K^-1 r. inner (k, k): x' K^-1 x + 1 / wide^2.
    """

    value: float
    lower: Array
    xw: Array
    solved: Array
    solved_r: Array
    inner: Array


def posterior_at(kernel: Kernel, prior: NoisePrior, theta: Array) -> At | None:
    """Return the posterior at theta (9,); None where K is not positive definite."""
    rows, active = kernel.rows, list(kernel.active)
    lower = factor(len(rows), kernel.covariance(theta))
    if lower is None:
        return None
    w = whiten(lower, kernel.x_and_r)
    xw, rw = w[:, :-1], w[:, -1]
    inner = xw.T @ xw + np.eye(rows.x.shape[1]) / WIDE**2
    root = np.linalg.cholesky(inner)
    explained = np.linalg.solve(root, xw.T @ rw)
    value = (
        -np.log(lower[kernel.diagonal]).sum() - np.log(np.diag(root)).sum() - 0.5 * (rw @ rw - explained @ explained)
    )
    back = whiten_back(lower, w)
    return At(float(value + prior.log_density(theta)[active].sum()), lower, xw, back[:, :-1], back[:, -1], inner)


def slope(kernel: Kernel, prior: NoisePrior, theta: Array, at: At) -> tuple[Array, Array]:
    """Return the gradient (d,) and the average information (d, d) of the active logarithms; the factor is used up.

    With P = K^-1 - K^-1 X (X' K^-1 X + 1 / wide^2)^-1 X' K^-1 the gradient is (-tr(P Ki) + r' P Ki P r) / 2 and the average
    information r' P Ki P Kj P r / 2, and no product of two matrices (n, n) is needed.
    """
    n, active = len(kernel.rows), list(kernel.active)
    pr = at.solved_r - at.solved @ np.linalg.solve(at.inner, at.solved.T @ kernel.rows.r)
    right = np.asfortranarray(np.column_stack([at.solved, pr]))
    by = kernel.derivatives(theta)
    turned = np.stack([dsymm(1.0, dtfttr(n, d, uplo="L")[0], right, lower=1) for d in by])
    pulled = turned[:, :, -1]
    white = whiten(at.lower, pulled.T)
    along = at.solved.T @ pulled.T
    inverse = dpftri(n, at.lower, uplo="L", overwrite_a=1)[0]
    on = inverse[kernel.diagonal]
    trace = np.array([2.0 * inverse @ d - on @ d[kernel.diagonal] for d in by])
    trace -= np.einsum("kl,dlk->d", np.linalg.inv(at.inner), at.solved.T @ turned[:, :, :-1])
    precision = prior.precision(theta)[active]
    gradient = 0.5 * (pulled @ pr - trace) - precision * (theta - prior.centre)[active]
    information = 0.5 * (white.T @ white - along.T @ np.linalg.solve(at.inner, along)) + np.diag(precision)
    return gradient, information


def mode(kernel: Kernel, prior: NoisePrior) -> tuple[Array, Array]:
    """Return where the posterior is largest (9,), by damped steps, and the average information (d, d) there."""
    active = list(kernel.active)
    damping, best, here = 1e-2, -np.inf, prior.centre.copy()
    step = np.zeros(len(active))
    there: tuple[Array, Array] | None = None
    for _ in range(STEPS):
        trial = here.copy()
        trial[active] += step
        found = posterior_at(kernel, prior, trial)
        if found is not None and found.value >= best - 1e-9:
            gain = found.value - best
            best, here = found.value, trial
            there = slope(kernel, prior, trial, found)
            damping = max(damping * 0.3, 1e-4)
            if gain < SMALL_GAIN:
                break
        else:
            damping = max(damping, 0.1) * 5.0
        if there is None or damping > 1e4:
            break
        gradient, information = there
        step = np.asarray(np.linalg.solve(information + damping * np.diag(np.diag(information)), gradient))
        step *= min(1.0, 1.5 / max(float(np.abs(step).max()), 1e-12))
    assert there is not None, "the prior's own noise is positive definite"
    return here, there[1]
