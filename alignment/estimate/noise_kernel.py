"""Covariance of the residuals: nugget, a wandering robot, an array that tilts, form error of the part, and edges.

Along the path the robot's error is an exponential (Ornstein-Uhlenbeck) process, the same for all laws of a pose; its
tilt about the travel shows in proportion to the place on the array. Form error is an exponential field in space.
Averages over stretches and cells are taken exactly (path) or closely (space), so that short correlations, which a
condensed row cannot resolve, keep the power they have in the mean.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrttf
from scipy.spatial.distance import pdist, squareform

from alignment.estimate.noise_rows import NoiseRows
from planner.frames import Array

NAMES = (
    "nugget_mm",
    "path_mm",
    "path_length_mm",
    "gap_mm",
    "tilt_mm",
    "field_mm",
    "field_length_mm",
    "edge_nugget_mm",
    "edge_path_mm",
)
NUGGET, PATH, LENGTH, GAP, TILT, FIELD, FIELD_LENGTH, EDGE_NUGGET, EDGE_PATH = range(len(NAMES))
# Mean distance between two points of a rectangle, per its diagonal (0.37 for a square).
MEAN_DISTANCE = 0.37
FAR_MM = 1e9
# So much path between two passes says that they belong to different scans, of which one knows nothing of the other.
ANOTHER_SCAN_MM = 5e3


@dataclass(frozen=True, eq=False)
class Kernel:
    """Covariances of the rows of one scan for any hyper-parameters theta (9,): logarithms of `NAMES`."""

    rows: NoiseRows

    @cached_property
    def x_and_r(self) -> Array:
        """The design and the residuals side by side (n, k + 1)."""
        return np.asfortranarray(np.column_stack([self.rows.x, self.rows.r]))

    @cached_property
    def _distance(self) -> Array:
        """Distances (n, n), never shorter than within a cell, mm; infinite to and from edges, which know no form error."""
        d = squareform(pdist(self.rows.position_base))
        d = np.sqrt(d**2 + (MEAN_DISTANCE * self.rows.size_mm) ** 2)
        d[self.rows.edge] = FAR_MM
        d[:, self.rows.edge] = FAR_MM
        return d

    @cached_property
    def _pass_step(self) -> Array:
        """How many passes lie between two blocks."""
        number = np.unique(self.rows.block_pass, return_inverse=True)[1]
        return np.abs(number[:, None] - number[None, :]).astype(np.float64)

    @cached_property
    def _apart(self) -> Array:
        """Path between the end of one block and the start of the other (b, b), mm, without the way between the passes.

        How much of its error a robot forgets on that way no one knows: it may stand still, or come back to the same place
        from the other side. `gap_mm` says it, from the data.
        """
        of_pass = np.unique(self.rows.block_pass, return_inverse=True)[1]
        passes = 1 + int(of_pass.max(initial=-1))
        start, end = np.full(passes, np.inf), np.full(passes, -np.inf)
        np.minimum.at(start, of_pass, self.rows.block_from_mm)
        np.maximum.at(end, of_pass, self.rows.block_to_mm)
        way = np.maximum(start[1:] - end[:-1], 0.0)
        between = np.r_[0.0, np.cumsum(np.where(way < ANOTHER_SCAN_MM, way, 0.0))][:passes]
        a, b = self.rows.block_from_mm - between[of_pass], self.rows.block_to_mm - between[of_pass]
        return np.maximum(np.maximum(a[:, None] - b[None, :], a[None, :] - b[:, None]), 0.0)

    @cached_property
    def _pair(self) -> tuple[Array, Array, Array | None]:
        """How an error of the pose is shared, (n, n) each: by surface rows, by their places on the array, by edge rows.

        The pose errs in space: two rows share it as far as they measure along the same direction. Opposite edges see it
        with opposite signs, which is a shift of the part, not a bias.
        """
        along = self.rows.direction_base @ self.rows.direction_base.T
        surface = (~self.rows.edge).astype(np.float64)
        across = np.where(self.rows.edge, 0.0, self.rows.across)
        both = along * np.outer(self.rows.edge, self.rows.edge) if self.rows.edge.any() else None
        return along * np.outer(surface, surface), np.outer(across, across), both

    @cached_property
    def active(self) -> tuple[int, ...]:
        """Hyper-parameters that these rows can feel."""
        out = [NUGGET, FIELD, FIELD_LENGTH]
        if self.rows.has_path:
            out += [PATH, LENGTH, GAP]
            if np.ptp(self.rows.across) > 0:
                out.append(TILT)
        if self.rows.edge.any():
            out += [EDGE_NUGGET, EDGE_PATH]
        return tuple(sorted(out))

    @cached_property
    def _place(self) -> NDArray[np.int64]:
        """Where in a matrix (n, n), flat, the entries of its packed lower triangle are (m,), m = n (n + 1) / 2.

        Rectangular full packed (F. G. Gustavson et al., ACM Trans. Math. Softw. 37 (2010) 18, doi:10.1145/1731022.1731028):
        half the work of filling a matrix in, and LAPACK factors it as fast as a whole one.
        """
        n = len(self.rows)
        return np.asarray(dtrttf(np.arange(float(n * n)).reshape(n, n), uplo="L")[0]).astype(np.int64)

    @cached_property
    def diagonal(self) -> NDArray[np.int64]:
        """Where the diagonal (n,) is in what `covariance` returns."""
        row, column = np.divmod(self._place, len(self.rows))
        on = np.flatnonzero(row == column)
        return on[np.argsort(row[on])]

    @cached_property
    def _packed(self) -> tuple[Array, Array, Array, Array | None, NDArray[np.int64]]:
        """`_distance`, the three of `_pair`, and the place in a matrix of blocks, all packed (m,)."""
        surface, x, both = self._pair
        row, column = np.divmod(self._place, len(self.rows))
        block = self.rows.block.astype(np.int64)
        pair = np.maximum(block[row], 0) * len(self._apart) + np.maximum(block[column], 0)
        take = lambda full: full.ravel().take(self._place)  # noqa: E731
        return take(self._distance), take(surface), take(x), None if both is None else take(both), pair

    @cached_property
    def _room(self) -> tuple[Array, Array, Array]:
        """Three (m,) to work in: asking the system for memory costs as much as the arithmetic."""
        m = len(self._place)
        return np.zeros(m), np.zeros(m), np.zeros(m)

    def block_correlation(self, length_mm: float, gap_mm: float) -> Array:
        """Return the correlation (b, b) of means over stretches of an exponential process along the path."""
        width = (self.rows.block_to_mm - self.rows.block_from_mm) / length_mm
        safe = np.maximum(width, 1e-9)
        small = width < 1e-4
        mean = np.where(small, 1.0 - 0.5 * width, -np.expm1(-safe) / safe)
        own = np.where(small, 1.0 - width / 3.0, 2.0 * (safe + np.expm1(-safe)) / safe**2)
        c = np.exp((self._apart + gap_mm * self._pass_step) / -length_mm)
        c *= mean[:, None]
        c *= mean
        np.fill_diagonal(c, own)
        return c

    def covariance(self, theta: Array) -> Array:
        """Return K, mm2, packed (m,); the same memory at every call."""
        v = np.exp(theta)
        k, scale, part = self._room
        distance, surface, x, both, pair = self._packed
        np.exp(np.multiply(distance, -1.0 / v[FIELD_LENGTH], out=k), out=k)
        k *= v[FIELD] ** 2
        if self.rows.has_path:
            np.multiply(surface, v[PATH] ** 2, out=scale)
            scale += np.multiply(x, v[TILT] ** 2, out=part)
            if both is not None:
                scale += np.multiply(both, v[EDGE_PATH] ** 2, out=part)
            # ("clip" only says that no index can be wrong.)
            scale *= self.block_correlation(v[LENGTH], v[GAP]).ravel().take(pair, out=part, mode="clip")
            k += scale
        k[self.diagonal] += sum(self._nuggets(v))
        return k

    def _nuggets(self, v: Array) -> tuple[Array, Array]:
        """Variances (n,) that each row has for itself: of surface rows and of edge rows."""
        edge, count = self.rows.edge, self.rows.count
        return np.where(edge, 0.0, v[NUGGET] ** 2 / count), np.where(edge, v[EDGE_NUGGET] ** 2 / count, 0.0)

    def derivatives(self, theta: Array) -> list[Array]:
        """Return the derivatives, packed (m,), of K by the logarithms of the active hyper-parameters."""
        v = np.exp(theta)
        nugget, edge_nugget = self._nuggets(v)
        distance, surface, x, both, pair = self._packed
        field = v[FIELD] ** 2 * np.exp(distance * (-1.0 / v[FIELD_LENGTH]))
        by = {
            NUGGET: self._on_diagonal(2.0 * nugget),
            FIELD: 2.0 * field,
            FIELD_LENGTH: field * distance * (1.0 / v[FIELD_LENGTH]),
            EDGE_NUGGET: self._on_diagonal(2.0 * edge_nugget),
        }
        if self.rows.has_path:
            at, h = self.block_correlation(v[LENGTH], v[GAP]), 1e-4
            by_length = (self.block_correlation(v[LENGTH] * np.exp(h), v[GAP]) - at) / h
            by_gap = (self.block_correlation(v[LENGTH], v[GAP] * np.exp(h)) - at) / h
            c, by_length, by_gap = (each.ravel().take(pair, mode="clip") for each in (at, by_length, by_gap))
            by[PATH] = surface * c
            by[PATH] *= 2.0 * v[PATH] ** 2
            by[TILT] = x * c
            by[TILT] *= 2.0 * v[TILT] ** 2
            scale = v[PATH] ** 2 * surface + v[TILT] ** 2 * x
            if both is not None:
                by[EDGE_PATH] = both * c
                by[EDGE_PATH] *= 2.0 * v[EDGE_PATH] ** 2
                scale += v[EDGE_PATH] ** 2 * both
            by[LENGTH], by[GAP] = scale * by_length, scale * by_gap
        return [by[i] for i in self.active]

    def _on_diagonal(self, values: Array) -> Array:
        out = np.zeros(len(self._place))
        out[self.diagonal] = values
        return out
