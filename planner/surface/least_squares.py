"""Many small least-squares problems at once: one per segment of a list of neighbours."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

# A polynomial that few neighbours leave open takes the smallest coefficients: relative to the trace of its equations.
RIDGE = np.array([1e-12, 1e-12, 1e-12, 1e-9, 1e-9, 1e-9, 1e-6, 1e-6, 1e-6, 1e-6])
# One-sided fits look in this many directions.
DIRECTIONS = 8
# Neighbours that leave less than this share of the directions around a node open do not fix its normal.
LEAST_SPREAD = 0.04
# A one-sided fit must leave less than this share of the two-sided residual.
BETTER = 0.5


def solve_segments(phi: Array, h: Array, weight: Array, starts: NDArray[np.int64]) -> Array:
    """Return weighted least-squares coefficients (n, terms) of h (p,) over features phi (terms, p), in the segments that
    begin at `starts` (n,).
    """
    terms = len(phi)
    matrix = np.zeros((len(starts), terms, terms))
    right = np.zeros((len(starts), terms))
    for i in range(terms):
        weighted = weight * phi[i]
        right[:, i] = np.add.reduceat(weighted * h, starts)
        for j in range(i, terms):
            matrix[:, i, j] = np.add.reduceat(weighted * phi[j], starts)
            matrix[:, j, i] = matrix[:, i, j]
    trace = np.einsum("nii->n", matrix) / terms
    diagonal = np.arange(terms)
    matrix[:, diagonal, diagonal] += RIDGE[:terms] * np.maximum(trace, 1e-30)[:, None]
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])


def residual_slope(phi: Array, h: Array, rho: Array, coefficients: Array) -> Array:
    """Return residual over distance (p,), rad, of coefficients given per pair (p, terms); 0 at the node itself."""
    residual = h - np.einsum("tn,nt->n", phi, coefficients)
    return np.asarray(np.divide(residual, rho, out=np.zeros_like(h), where=rho > 0))


def one_sided(phi: Array, h: Array, weight: Array, rho: Array, sizes: NDArray[np.int64], two_sided: Array) -> Array:
    """Return coefficients (n, terms) where the curvature jumps at a node: fitted to the smoothest side.

    A plane that runs tangentially into a fillet has one normal at the seam but two curvatures; a polynomial through both
    sides has the wrong normal. Of a plane and a quadric through the neighbours in each of eight half-planes, the one with
    the smallest residual gives the normal, as in essentially non-oscillatory schemes (Harten, Engquist, Osher,
    Chakravarthy 1987, doi:10.1016/0021-9991(87)90031-3). Without a clearly better side the two-sided fit stays.
    """
    starts = np.r_[0, np.cumsum(sizes)[:-1]]
    row = np.repeat(np.arange(len(sizes)), sizes)
    best = two_sided.copy()
    slope = residual_slope(phi, h, rho, two_sided[row])
    bound = BETTER * np.sqrt(np.add.reduceat(slope * slope, starts) / np.maximum(sizes - 1, 1))
    flat = np.hypot(phi[1], phi[2])
    cosine = np.divide(phi[1], flat, out=np.zeros_like(flat), where=flat > 0)
    sine = np.divide(phi[2], flat, out=np.zeros_like(flat), where=flat > 0)
    for angle in np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS):
        side = (cosine * np.cos(angle) + sine * np.sin(angle) > -0.05) & (flat > 0)
        count = np.add.reduceat(side.astype(np.int64), starts)
        total = np.maximum(count, 1)
        xx, xy, yy = (
            np.add.reduceat(np.where(side, p, 0.0), starts) / total for p in (cosine**2, cosine * sine, sine**2)
        )
        spread = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
        for terms, least in ((3, 3), (6, 8)):
            found = np.zeros_like(best)
            found[:, :terms] = solve_segments(phi[:terms], h, np.where(side, weight, 1e-12 * weight), starts)
            slope = np.where(side, residual_slope(phi, h, rho, found[row]), 0.0)
            # A quadric has five unknowns; what it leaves is judged per neighbour to spare.
            rms = np.sqrt(np.add.reduceat(slope * slope, starts) / np.maximum(count - (terms - 1), 1))
            better = (rms < bound) & (spread > LEAST_SPREAD) & (count >= least)
            best[better], bound[better] = found[better], rms[better]
    return best
