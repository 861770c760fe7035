"""Jumps in a grid of cells: on both sides of every cell a line of the same slope, and how far one stands above the other."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import correlate1d

from alignment.estimate.robust import mad_sigma
from alignment.non_rigid.rest import Rest
from planner.frames import Array

# Length of each side that tells the slope, and of what next to each cell tells the height (mm): the farther, the more a robot
# wanders.
SIDE_MM, CLOSE_MM = 24.0, 6.0
# Breadth over which a jump is looked at (mm).
BREADTH_MM = 9.0
# Of a side this share must be heard.
LEAST_HEARD = 0.5
# No jump is known better than this (mm): laws differ by delays, triangles by their chords.
FLOOR_MM = 0.008


@dataclass(frozen=True, eq=False)
class Jumps:
    """height_mm (b, k): jump at each cell of a grid, NaN where a side was not heard. sigma_mm: what chance makes of it."""

    height_mm: Array
    sigma_mm: float

    @property
    def sigmas(self) -> Array:
        """Heights in standard deviations (b, k), 0 where unknown."""
        return np.asarray(np.nan_to_num(self.height_mm) / self.sigma_mm)


def jumps(rest: Rest, axis: int, beside_mm: float = 0.0) -> Jumps:
    """Return the jumps along the passes (axis 0) or across the laws (axis 1).

    beside_mm: what is left out on both sides, so that a slow rise shows its whole height, less surely.

    Least squares of one line on each side with a slope in common: smooth shape that the field left over, and a robot that
    drifts, are no jump. The robot's own jumps are judged by what most of the scan shows.
    """
    size = rest.size_mm[axis]
    n, near = max(2, round(SIDE_MM / size)), max(1, round(CLOSE_MM / size))
    if axis == 1:
        n = max(2, min(n, (rest.value_mm.shape[1] - 1) // 2))
    skip = min(round(beside_mm / size), n - 1)
    breadth = max(1, 2 * round(0.5 * (BREADTH_MM / rest.size_mm[1 - axis] - 1.0)) + 1)
    height = np.where(rest.placed, _Sides(rest.value_mm, axis, breadth).heights(n, min(near, n - skip), skip), np.nan)
    known = np.isfinite(height)
    sigma = mad_sigma(height[known], FLOOR_MM, about_zero=True) if known.any() else np.inf
    return Jumps(height, float(sigma))


@dataclass(frozen=True, eq=False)
class _Sides:
    """Sums over what lies on either side of each cell of a grid (b, k), `breadth` cells wide."""

    grid: Array
    axis: int
    breadth: int

    def heights(self, n: int, near: int, skip: int) -> Array:
        """Return the jumps (b, k): slopes are those of n cells on each side, jumps those of `near`, without `skip`."""
        t = np.arange(-n, n + 1, dtype=np.float64)
        mean, off, heard = [], [], np.ones(self.grid.shape, dtype=bool)
        square, product = np.zeros(self.grid.shape), np.zeros(self.grid.shape)
        for side in (t < -skip, t > skip):
            count, t1, t2, y0, y1 = self._moments(side.astype(np.float64), t)
            full = self._total(np.ones(self.grid.shape), side.astype(np.float64))
            heard &= (count >= LEAST_HEARD * full) & (full >= 0.5 * (n - skip) * self.breadth)
            square += t2 - t1 * t1 / np.maximum(count, 1.0)
            product += y1 - t1 * y0 / np.maximum(count, 1.0)
            if near < n:
                count, t1, _, y0, _ = self._moments((side & (np.abs(t) <= skip + near)).astype(np.float64), t)
                heard &= count >= LEAST_HEARD * near * self.breadth
            mean.append(y0 / np.maximum(count, 1.0))
            off.append(t1 / np.maximum(count, 1.0))
        slope = product / np.maximum(square, 1e-9)
        return np.where(heard & (square > 0.5), (mean[1] - mean[0]) - slope * (off[1] - off[0]), np.nan)

    def _moments(self, window: Array, t: Array) -> tuple[Array, ...]:
        """Return count, sum of t, of t^2, of values and of t times values, each (b, k)."""
        known = np.isfinite(self.grid)
        weight, value = known.astype(np.float64), np.where(known, self.grid, 0.0)
        sums = [self._total(weight, window * t**k) for k in range(3)]
        return (*sums, self._total(value, window), self._total(value, window * t))

    def _total(self, what: Array, kernel: Array) -> Array:
        along = correlate1d(what, kernel, axis=self.axis, mode="constant")
        return np.asarray(correlate1d(along, np.ones(self.breadth), axis=1 - self.axis, mode="constant"))
