"""Many small least-squares problems at once: one per segment of a list of neighbours."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

# A polynomial that few neighbours leave open takes the smallest coefficients: relative to the trace of its equations.
# Mixed terms count by their share of the symmetric tensor, or the smallest would depend on how the tangents lie: on a
# cylinder given by its two rims alone a tilt would be made up wherever they do not happen to follow the axis.
RIDGE = np.array([1e-12, 1e-12, 1e-12, 1e-9, 0.5e-9, 1e-9, 1e-6, 1e-6 / 3.0, 1e-6 / 3.0, 1e-6])
# A cubic leaves at least this much (rad) at the farthest neighbour; a slope is never surer of being nought than this.
MODEL_RAD, LEAST_TURN_RAD = 5e-4, 1e-3
MOST_TURN2 = 0.6
# One-sided fits look in this many directions.
DIRECTIONS = 8
# Neighbours that leave less than this share of the directions around a node open do not fix its normal.
LEAST_SPREAD = 0.04
# Neighbours agree with a quadric within this residual (rad).
AGREE_RAD = 0.002
# A one-sided fit must leave less than this share of the two-sided residual.
BETTER = 0.5


def solve_segments(
    phi: Array,
    h: Array,
    weight: Array,
    starts: NDArray[np.int64],
    through: bool = False,
    slope_precision: Array | None = None,
) -> Array:
    """Return weighted least-squares coefficients (n, terms) of h (p,) over features phi (terms, p), in the segments that
    begin at `starts` (n,).

    through: the first feature is zero throughout (the polynomial goes through its node), and so is its coefficient.
    slope_precision (n, 2, 2): how surely both slopes are nought, in units of the weights.
    """
    if through:
        rest = _solve(phi[1:], h, weight, starts, RIDGE[1 : len(phi)], slope_precision)
        return np.hstack([np.zeros((len(starts), 1)), rest])
    return _solve(phi, h, weight, starts, RIDGE[: len(phi)], None)


def slope_precision(
    turn: tuple[Array, Array], place: tuple[Array, Array], turn2: Array, starts: NDArray[np.int64]
) -> Array:
    """Return how surely the slopes at n nodes over their guessed normals are nought (n, 2, 2), in units of the weights.

    turn: how the guessed normals of the neighbours (p,) turn along both tangents; place: where these are, u and v; turn2:
    squares of their turns. Where normals do not turn along a direction, as along a cylinder given by its rims, no neighbour
    says anything of the slope but those at the far end, whose height curvature and slope explain equally well. What
    of the turns goes with the place (a linear regression) is what may be wrong with the guess.
    """
    count = np.diff(np.r_[starts, len(turn2)])

    def mean(a: Array, b: Array) -> Array:
        return np.asarray(np.add.reduceat(a * b, starts) / count)

    square = np.stack([np.stack([mean(a, b) for b in place], axis=1) for a in place], axis=1)
    square[:, [0, 1], [0, 1]] += 1e-9 * np.trace(square, axis1=1, axis2=2)[:, None] + 1e-30
    mixed = np.stack([np.stack([mean(t, x) for x in place], axis=1) for t in turn], axis=1)
    spread = mixed @ np.linalg.inv(square) @ mixed.transpose(0, 2, 1)
    spread[:, [0, 1], [0, 1]] += LEAST_TURN_RAD**2
    # A cubic leaves a fourth-order rest: of an arc, turn^4 / 24 over the turn; the mean square turn is about a third of the
    # largest. Normals of folded triangles count little.
    left = MODEL_RAD + (np.add.reduceat(np.minimum(turn2, MOST_TURN2), starts) / count) ** 1.5 / 8.0
    return np.asarray((left**2)[:, None, None] * np.linalg.inv(spread))


def _solve(phi: Array, h: Array, weight: Array, starts: NDArray[np.int64], ridge: Array, slopes: Array | None) -> Array:
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
    matrix[:, diagonal, diagonal] += ridge * np.maximum(trace, 1e-30)[:, None]
    if slopes is not None:
        matrix[:, :2, :2] += slopes
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])


def residual_slope(phi: Array, h: Array, rho: Array, coefficients: Array, sizes: NDArray[np.int64]) -> Array:
    """Return residual over distance (p,), rad, of coefficients (n, terms) of segments of `sizes` (n,); 0 at the node."""
    residual = h.copy()
    for feature, c in zip(phi, np.ascontiguousarray(coefficients.T), strict=False):
        if c.any():
            residual -= feature * c.repeat(sizes)
    return np.asarray(np.divide(residual, rho, out=np.zeros_like(h), where=rho > 0))


def one_sided(
    phi: Array,
    h: Array,
    weight: Array,
    rho: Array,
    adjacent: NDArray[np.bool_],
    sizes: NDArray[np.int64],
    two_sided: Array,
    slopes: Array | None = None,
) -> Array:
    """Return coefficients (n, terms) where the curvature jumps at or near a node: fitted to its smoothest surroundings.

    Where a cylinder runs tangentially into a fillet there is one normal at the seam but two curvatures, and a polynomial
    through both sides has the wrong normal. Candidates are quadrics through the neighbours in each of eight half-planes
    and through those that agree with the nearest ring (`adjacent` (p,)); the one with the smallest residual per neighbour
    to spare is taken, as in essentially non-oscillatory schemes (Harten, Engquist, Osher, Chakravarthy 1987,
    doi:10.1016/0021-9991(87)90031-3). Without a clearly better one the fit to all stays. slopes (n, 2, 2):
    `slope_precision`.
    """
    starts = np.r_[0, np.cumsum(sizes)[:-1]]
    best = two_sided.copy()
    slope = residual_slope(phi, h, rho, two_sided, sizes)
    bound = BETTER * np.sqrt(np.add.reduceat(slope * slope, starts) / np.maximum(sizes - 1, 1))
    flat = np.hypot(phi[1], phi[2])
    cosine = np.divide(phi[1], flat, out=np.zeros_like(flat), where=flat > 0)
    sine = np.divide(phi[2], flat, out=np.zeros_like(flat), where=flat > 0)
    sides = [(_agreeing(phi[:6], h, weight, rho, adjacent, starts, sizes), 5)]
    angles = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    sides += [(cosine * np.cos(angle) + sine * np.sin(angle) > -0.05, 8) for angle in angles]
    for side, least in sides:
        chosen = side & (flat > 0)
        count = np.add.reduceat(chosen.astype(np.int64), starts)
        total = np.maximum(count, 1)
        products = (cosine**2, cosine * sine, sine**2)
        xx, xy, yy = (np.add.reduceat(np.where(chosen, p, 0.0), starts) / total for p in products)
        spread = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
        found = np.zeros_like(best)
        found[:, :6] = solve_segments(
            phi[:6], h, np.where(chosen, weight, 0.0), starts, through=True, slope_precision=slopes
        )
        slope = np.where(chosen, residual_slope(phi, h, rho, found, sizes), 0.0)
        rms = np.sqrt(np.add.reduceat(slope * slope, starts) / np.maximum(count - 5, 1))
        better = (rms < bound) & (spread > LEAST_SPREAD) & (count >= least)
        best[better], bound[better] = found[better], rms[better]
    return best


def _agreeing(
    phi: Array,
    h: Array,
    weight: Array,
    rho: Array,
    adjacent: NDArray[np.bool_],
    starts: NDArray[np.int64],
    sizes: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Return which neighbours (p,) lie on one quadric with the nearest ring: reweighted least squares, Cauchy weights."""
    trust = np.where(adjacent, 1.0, 1e-3)
    slope = np.zeros_like(h)
    for scale in (AGREE_RAD, AGREE_RAD, AGREE_RAD / 2.0, AGREE_RAD / 4.0):
        slope = residual_slope(phi, h, rho, solve_segments(phi, h, weight * trust, starts), sizes)
        trust = 1.0 / (1.0 + (slope / scale) ** 2)
    return np.asarray(np.abs(slope) < AGREE_RAD)
