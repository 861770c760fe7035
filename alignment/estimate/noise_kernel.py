"""Covariance of the residuals: nugget, a wandering robot, an array that tilts, form error of the part, and edges.

Along the path the robot's error is an exponential (Ornstein-Uhlenbeck) process, the same for all laws of a pose; its
tilt about the travel shows in proportion to the place on the array. Form error is an exponential field in space.
Averages over stretches and cells are taken exactly (path) or closely (space), so that short correlations, which a
condensed row cannot resolve, keep the power they have in the mean.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
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
    def _room(self) -> tuple[Array, Array, Array]:
        """Three (n, n) to work in: asking the system for memory costs as much as the arithmetic."""
        n = len(self.rows)
        return np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))

    def path_correlation(self, length_mm: float, gap_mm: float, out: Array | None = None) -> Array:
        """Return the correlation (n, n) of means over stretches of an exponential process along the path."""
        width = (self.rows.block_to_mm - self.rows.block_from_mm) / length_mm
        safe = np.maximum(width, 1e-9)
        small = width < 1e-4
        mean = np.where(small, 1.0 - 0.5 * width, -np.expm1(-safe) / safe)
        own = np.where(small, 1.0 - width / 3.0, 2.0 * (safe + np.expm1(-safe)) / safe**2)
        c = np.exp((self._apart + gap_mm * self._pass_step) / -length_mm)
        c *= mean[:, None]
        c *= mean
        np.fill_diagonal(c, own)
        # Symmetric, so that whole rows can be copied both times. ("clip" only says that no index can be wrong.)
        half = np.ascontiguousarray(c.take(self.rows.block, axis=0).T)
        return half.take(self.rows.block, axis=0, out=out, mode="clip")

    def field_correlation(self, length_mm: float, out: Array | None = None) -> Array:
        """Return the correlation (n, n) of the form error; edges measure something else."""
        c = np.multiply(self._distance, -1.0 / length_mm, out=out)
        return np.exp(c, out=c)

    def covariance(self, theta: Array) -> Array:
        """Return K (n, n), mm2; the same memory at every call."""
        v = np.exp(theta)
        k, scale, part = self._room
        self.field_correlation(v[FIELD_LENGTH], out=k)
        k *= v[FIELD] ** 2
        if self.rows.has_path:
            self._path_scale(v, scale, part)
            scale *= self.path_correlation(v[LENGTH], v[GAP], out=part)
            k += scale
        k[np.diag_indices(len(self.rows))] += sum(self._nuggets(v))
        return k

    def _path_scale(self, v: Array, out: Array, part: Array) -> Array:
        """Fill in the variance and covariance (n, n) of the error of the pose, were it one for all poses."""
        surface, x, both = self._pair
        np.multiply(surface, v[PATH] ** 2, out=out)
        out += np.multiply(x, v[TILT] ** 2, out=part)
        if both is not None:
            out += np.multiply(both, v[EDGE_PATH] ** 2, out=part)
        return out

    def _nuggets(self, v: Array) -> tuple[Array, Array]:
        """Variances (n,) that each row has for itself: of surface rows and of edge rows."""
        edge, count = self.rows.edge, self.rows.count
        return np.where(edge, 0.0, v[NUGGET] ** 2 / count), np.where(edge, v[EDGE_NUGGET] ** 2 / count, 0.0)

    def derivatives(self, theta: Array) -> list[Array]:
        """Return the derivatives (n, n) of K by the logarithms of the active hyper-parameters."""
        v = np.exp(theta)
        nugget, edge_nugget = self._nuggets(v)
        field = v[FIELD] ** 2 * self.field_correlation(v[FIELD_LENGTH])
        by = {
            NUGGET: np.diag(2.0 * nugget),
            FIELD: 2.0 * field,
            FIELD_LENGTH: field * (self._distance / v[FIELD_LENGTH]),
            EDGE_NUGGET: np.diag(2.0 * edge_nugget),
        }
        if self.rows.has_path:
            surface, x, both = self._pair
            scale = self._path_scale(v, *self._room[1:])
            c, h = self.path_correlation(v[LENGTH], v[GAP]), 1e-4
            by[PATH] = 2.0 * v[PATH] ** 2 * surface * c
            by[TILT] = 2.0 * v[TILT] ** 2 * x * c
            if both is not None:
                by[EDGE_PATH] = 2.0 * v[EDGE_PATH] ** 2 * both * c
            by[LENGTH] = scale * (self.path_correlation(v[LENGTH] * np.exp(h), v[GAP]) - c) / h
            by[GAP] = scale * (self.path_correlation(v[LENGTH], v[GAP] * np.exp(h)) - c) / h
        return [by[i] for i in self.active]
