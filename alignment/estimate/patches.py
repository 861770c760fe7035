"""Readings condensed to patches in one linear pass: robust means that a curved surface does not bias."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from alignment.estimate.cells import Cells
from alignment.estimate.readings import SORTED_READINGS, Readings
from alignment.estimate.robust import mad_sigma, tukey_weights
from alignment.estimate.slices import sum_of_slices
from planner.frames import Array, Transform
from planner.surface.curved import CurvedSurface
from planner.surface.follow import Follower

# The six entries of a symmetric matrix.
PAIRS = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class Patches:
    """p patches; each stands for the weighted mean of its readings.

    origins_base (p, 3), distance_mm (p,): means. spread (p, 3, 3): covariance of the origins within, mm2. hessian_base
    (p, 3, 3): curvature of the distance to the surface, 1/mm. count (p,): readings it is worth. scatter_mm (p,): their
    standard deviation. amplitude_pct (p,). beams_base (p, 3): zero without beams. cells: where on the path.
    looked_at (m,): the readings they were made of, all of the `total` but in very dense scans; kept (m,): those not thrown
    out as not belonging to their neighbours. sigma_mm: scatter of single readings.
    follower: knows where on the surface the patches were when they were made; tracks: what is known of their residuals.
    """

    origins_base: Array
    distance_mm: Array
    spread: Array
    hessian_base: Array
    count: Array
    scatter_mm: Array
    amplitude_pct: Array
    beams_base: Array
    cells: Cells
    looked_at: NDArray[np.int64]
    total: int
    kept: NDArray[np.bool_]
    sigma_mm: float
    follower: Follower | None = None
    tracks: dict[int, Any] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.distance_mm)

    @property
    def bend_mm(self) -> Array:
        """How much farther than its mean origin the surface is for the readings of a patch, on average (p,), mm."""
        return 0.5 * np.einsum("pij,pij->p", self.hessian_base, self.spread)


def condense(readings: Readings, cells: Cells, curved: CurvedSurface, T_base_part: Transform) -> Patches:
    """Return the patches of readings in cells, whose part is already placed to about the robust scatter of the readings.

    Within a patch the distance to the surface is expanded to second order about the patch's middle, so that the robust
    mean and the rejection see no curvature; the expansion's mean (tr H Cov / 2) is kept and added back exactly. Readings
    are taken a slice at a time, so that what is worked out of them stays in the processor's cache.
    """
    cell, c = cells.of_reading, len(cells)
    middle = _middles(readings, cell, c)
    follower = Follower(curved, loose=True)
    foot = follower.closest(T_base_part.inv().points(middle))
    hessian = distance_hessian(curved.shape_operator(foot.face, foot.bary), foot.distance_mm)
    r = T_base_part.rotation_matrix
    hessian = r @ hessian @ r.T
    gradient = T_base_part.directions(foot.normals).T.copy()
    curved_by = (hessian * np.where(np.eye(3, dtype=bool), 0.5, 1.0)).transpose(1, 2, 0).copy()
    residual = np.zeros(len(readings))

    def residuals(rows: slice) -> Array:
        at, origins = cell[rows], readings.origins_base[rows]
        d = [origins[:, k] - middle[:, k].take(at) for k in range(3)]
        left = readings.distance_mm[rows] - foot.distance_mm.take(at)
        for i in range(3):
            slope = gradient[i].take(at)
            for j in range(i, 3):
                slope += curved_by[i, j].take(at) * d[j]
            left -= slope * d[i]
        residual[rows] = left
        return np.zeros(0)

    sum_of_slices(residuals, len(readings), (0,))
    weight, sigma = _robust(residual, readings.weight, cell, c)
    return _weighted(readings, cells, middle, residual, weight, sigma, hessian, follower)


def _middles(readings: Readings, cell: NDArray[np.int32], c: int) -> Array:
    """Return about where each of c cells has its middle (c, 3): the mean of one reading of each of its runs."""
    start = run_starts(cell)
    one = (start + np.r_[start[1:], len(readings)]) // 2
    at, origins = cell[one], readings.origins_base[one]
    sums = np.stack([np.bincount(at, origins[:, k], c) for k in range(3)], axis=1)
    return sums / np.maximum(np.bincount(at, minlength=c), 1)[:, None]


def _weighted(
    readings: Readings,
    cells: Cells,
    middle: Array,
    residual: Array,
    weight: Array,
    sigma_mm: float,
    hessian: Array,
    follower: Follower,
) -> Patches:
    """Return the patches as the weighted means of their readings."""
    cell, c = cells.of_reading, len(cells)

    def moments(rows: slice) -> Array:
        at, w, origins = cell[rows], weight[rows], readings.origins_base[rows]
        x = np.zeros((18, len(at)))
        for k in range(3):
            np.subtract(origins[:, k], middle[:, k].take(at), out=x[k])
        for k, (i, j) in enumerate(zip(*PAIRS, strict=True)):
            np.multiply(x[i], x[j], out=x[3 + k])
        x[9], x[10] = residual[rows], residual[rows] ** 2
        x[11], x[12] = readings.distance_mm[rows], np.nan_to_num(readings.amplitude_pct[rows])
        if readings.beams_base is not None:
            x[13:16] = readings.beams_base[rows].T
        x[16], x[17] = 1.0, w
        x *= w
        return _sums(at, c, x)

    sums = sum_of_slices(moments, len(readings), (c, 18))
    total, squares = sums[:, 16], sums[:, 17]
    mean = sums / np.where(total > 0, total, 1.0)[:, None]
    offset, centre = mean[:, :3], mean[:, 9]
    spread = np.zeros((c, 3, 3))
    spread[:, PAIRS[0], PAIRS[1]] = spread[:, PAIRS[1], PAIRS[0]] = (
        mean[:, 3:9] - offset[:, PAIRS[0]] * offset[:, PAIRS[1]]
    )
    heard = bool(np.isfinite(readings.amplitude_pct).any())
    return Patches(
        middle + offset,
        mean[:, 11].copy(),
        spread,
        hessian,
        np.divide(total**2, squares, out=np.zeros(c), where=total > 0),
        np.sqrt(np.maximum(mean[:, 10] - centre**2, 0.0)),
        mean[:, 12].copy() if heard else np.full(c, np.nan),
        mean[:, 13:16].copy(),
        cells,
        readings.rows,
        readings.total,
        weight > 0,
        sigma_mm,
        follower,
    )


def _sums(cell: NDArray[np.int32], c: int, x: Array) -> Array:
    """Return the sums (c, k) of x (k, m) over cells (m,). Neighbouring readings mostly share a cell: they are summed first."""
    start = run_starts(cell)
    runs = np.add.reduceat(x, start, axis=1)
    n = len(start)
    return np.asarray(csc_array((np.ones(n), cell[start], np.arange(n + 1, dtype=np.int32)), shape=(c, n)) @ runs.T)


def run_starts(cell: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return where runs of equal numbers begin."""
    return np.flatnonzero(np.r_[True, cell[1:] != cell[:-1]])


def distance_hessian(shape_operator: Array, distance_mm: Array) -> Array:
    """Return the second derivative (n, 3, 3) of the distance to a surface, at a distance from it: W (I + d W)^-1."""
    system = np.eye(3) + distance_mm[:, None, None] * shape_operator
    # At a centre of curvature the distance has no second derivative; the surface is then far too curved for a patch.
    low = np.linalg.eigvalsh(system)[:, 0]
    system[low < 0.2] = np.eye(3)
    return np.asarray(np.linalg.solve(system, shape_operator))


def _robust(residual: Array, weight: Array, cell: NDArray[np.int32], c: int) -> tuple[Array, float]:
    """Return weights (n,) and the scatter of single readings, by Tukey's biweight about each cell's location."""
    n = len(residual)
    look = np.arange(0, n, max(1, n // SORTED_READINGS))
    look = look[weight[look] > 0]
    # By cell, and within it by residual, in one sort: residuals squeezed into less than the step between cells.
    low, high = (float(f(residual[look], initial=0.0)) for f in (np.min, np.max))
    order = look[np.argsort(cell[look] + (residual[look] - low) / (1.0 + 1e-9 + high - low), kind="stable")]
    counts = np.bincount(cell[look], minlength=c)
    first = np.cumsum(counts) - counts
    lower, upper = first + np.maximum(counts - 1, 0) // 2, first + counts // 2
    sorted_residual = np.append(residual[order], 0.0)
    last = len(order)
    centre = 0.5 * (sorted_residual[np.minimum(lower, last)] + sorted_residual[np.minimum(upper, last)])
    unseen = counts == 0
    if unseen.any():
        centre[unseen] = float(np.median(residual[look])) if len(look) else 0.0
    many = counts[cell[look]] > 2
    inside = residual[look][many] - centre[cell[look]][many]
    sigma = mad_sigma(inside, 1e-4, about_zero=True)
    out = np.zeros(n)

    def weigh(rows: slice) -> Array:
        at, r = cell[rows], residual[rows]
        w = weight[rows] * tukey_weights(r - centre.take(at), 1.2 * sigma)
        out[rows] = w
        return _sums(at, c, np.stack([w, w * r]))

    for _ in range(2):
        sums = sum_of_slices(weigh, n, (c, 2))
        centre = np.where(sums[:, 0] > 0, sums[:, 1] / np.where(sums[:, 0] > 0, sums[:, 0], 1.0), centre)
    return out, sigma
