"""Everything measured, as one linear problem about a placement: patches of the surface, crossings of its edges."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.edge_points import EdgePoints
from alignment.estimate.edge_rows import EdgeMap, EdgeRows, edge_rows
from alignment.estimate.motion import motion_between
from alignment.estimate.noise_rows import NoiseRows, coarse_of, has_path, noise_rows
from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.surface_rows import Rows, patch_rows
from planner.frames import Array, Transform

# Crossings of one stretch of this length, one way of crossing and one side are one row (mm).
EDGE_CELL_MM = 8.0
MOST_EDGE_ROWS = 90
LAWS_PER_ROW = 12.0
COARSENINGS = 20
# What the beam's asymmetry and the detection may shift every crossing by, as a share of the beam width, and what a late
# clock may shift it by along the travel (mm); and tilt takes more or less of the echo at a curved
# rim than the set-up says. All are estimated along: opposite edges, opposite passes, rims of different slope tell them apart.
BIAS_SHARE = 0.04
LAG_SIGMA_MM = 0.1
NUISANCES = 3
# As good as none.
AS_SAID_MM = 1e-3
# Residuals are taken as linear within so much (mm) of a placement that was asked about: over a rim of 20 mm radius that is off
# by 2e-5 mm. So many placements are remembered.
LINEAR_MM, REMEMBERED = 0.03, 3
# How far off what the set-up says of tilt at the rim may be, in differences between its two extremes.
TILT_DOUBT = 2.0


@dataclass(frozen=True, eq=False)
class EdgeData:
    """The crossings of a scan, the CAD edges, which crossings belong to them (k,), and how unsure bias and lag are.

    shift_mm (k,): how far the part's own shape moves the feet outward, if that is known.
    """

    points: EdgePoints
    map: EdgeMap
    used: NDArray[np.bool_]
    bias_sigma_mm: float
    lag_sigma_mm: float = LAG_SIGMA_MM
    shift_mm: Array | None = None
    _known: list[tuple[EdgePoints, Transform, Array, EdgeRows]] = field(default_factory=list, kw_only=True)

    def rows(self, problem: Problem, T_base_part: Transform) -> EdgeRows:
        """Return the residuals of all crossings, from their feet on the part's own shape if that is known."""
        found = self.cad_rows(problem, T_base_part)
        return found if self.shift_mm is None else replace(found, r=found.r - self.shift_mm)

    def cad_rows(self, problem: Problem, T_base_part: Transform) -> EdgeRows:
        """Return the residuals of all crossings from their feet on the CAD."""
        for points, T_known, centre_mm, rows in self._known:
            if points is self.points:
                xi = motion_between(T_known, T_base_part, centre_mm)
                reach_mm = np.linalg.norm(rows.point_base - centre_mm, axis=1).max(initial=0.0)
                if np.linalg.norm(xi[3:]) + reach_mm * np.linalg.norm(xi[:3]) < LINEAR_MM:
                    return replace(rows, r=rows.r + rows.jacobian @ xi)
        centre_mm = problem.centre_mm(T_base_part)
        found = edge_rows(self.points, self.map, problem.curved, T_base_part, centre_mm)
        self._known[:] = [*self._known[1 - REMEMBERED :], (self.points, T_base_part, centre_mm, found)]
        return found

    def as_said(self) -> "EdgeData":
        """Return the same crossings with bias, lag and tilt taken as the set-up has them."""
        points = replace(self.points, window_other=self.points.window, at_other=self.points.at)
        return replace(self, points=points, bias_sigma_mm=AS_SAID_MM, lag_sigma_mm=AS_SAID_MM)


@dataclass(frozen=True, eq=False)
class System:
    """Patches used (p,) and, perhaps, crossings of edges. Unknowns: six of the motion, then the edges' nuisances."""

    problem: Problem
    patches: Patches
    used: NDArray[np.bool_]
    edges: EdgeData | None = None
    edge_row: NDArray[np.int64] | None = None

    def grouped(self, T_base_part: Transform) -> "System":
        """Return the system with its crossings shared out to rows once and for all, as they lie at this placement.

        A noise model belongs to one sharing-out: rows that changed places under it would be weighted as others.
        """
        if self.edges is None:
            return self
        return replace(self, edge_row=_edge_row(self.edges, self.edges.rows(self.problem, T_base_part)))

    @property
    def unknowns(self) -> int:
        """6, or 9 with edges."""
        return 6 if self.edges is None else 6 + NUISANCES

    @cached_property
    def _coarse(self) -> tuple[NDArray[np.int64], Array] | None:
        return coarse_of(self.patches, self.used) if has_path(self.patches) else None

    def surface(self, T_base_part: Transform) -> Rows:
        """Return the residuals of all patches."""
        p = self.problem
        return patch_rows(self.patches, p.curved, T_base_part, p.centre_mm(T_base_part))

    def rows(self, T_base_part: Transform, nuisance: Array) -> NoiseRows:
        """Return the condensed rows at a placement, with the edges' nuisances as they stand (3,), in their sigmas."""
        p = self.problem
        swath = p.setup.probe.swath_mm
        surface = noise_rows(self.patches, self.surface(T_base_part), self.used, p.prior_sigma, swath, self._coarse)
        if self.edges is None:
            return surface
        found = self.edges.rows(p, T_base_part)
        at = _edge_row(self.edges, found) if self.edge_row is None else self.edge_row
        return _joined(surface, self.edges, found, at, p.prior_sigma, nuisance)


def nuisance_columns(edges: EdgeData, found: EdgeRows) -> Array:
    """Return how the residuals of crossings change with edge bias, lag and tilt loss (k, 3), per sigma of theirs."""
    points = edges.points
    tilted = TILT_DOUBT * (points.at - points.at_other) * points.gap_mm * found.cosine
    return np.column_stack([np.full(len(found.r), -edges.bias_sigma_mm), -edges.lag_sigma_mm * found.lag, tilted])


def _edge_row(edges: EdgeData, found: EdgeRows) -> NDArray[np.int64]:
    """Return the row of each used crossing: one stretch of a pass, one band of laws, one side of the part is one row."""
    picked = np.flatnonzero(edges.used)
    points, cell, laws = edges.points, EDGE_CELL_MM, LAWS_PER_ROW
    leaving = (found.lag[picked] > 0).astype(np.int64)
    side = np.where(np.abs(found.lag[picked]) > 0.3, leaving, 2 + _side(found, picked))
    at = np.zeros(len(picked), dtype=np.int64)
    # Coarser along the stretch and across the laws until it fits; one row a pass and side is as coarse as it gets.
    for _ in range(COARSENINGS):
        stretch = np.floor(points.s_mm[picked] / cell).astype(np.int64)
        band = np.where(points.along[picked], np.floor(points.law[picked] / laws), 0).astype(np.int64)
        key = np.column_stack([points.pass_id[picked], stretch, points.along[picked], band, side])
        _, at = np.unique(key, axis=0, return_inverse=True)
        if int(at.max(initial=-1)) < MOST_EDGE_ROWS:
            break
        cell, laws = 1.3 * cell, 1.3 * laws
    return at.astype(np.int64)


def _joined(
    surface: NoiseRows,
    edges: EdgeData,
    found: EdgeRows,
    at: NDArray[np.int64],
    prior_sigma: Array,
    nuisance: Array,
) -> NoiseRows:
    picked, points = np.flatnonzero(edges.used), edges.points
    n = 1 + int(at.max(initial=-1))
    # Crossings count as well as they are known.
    weight = points.weight[picked]
    count = np.bincount(at, weight, n)

    def mean(values: Array) -> Array:
        columns = values.reshape(len(picked), -1)
        return np.stack([np.bincount(at, weight * c, n) / count for c in columns.T], axis=1)

    columns = nuisance_columns(edges, found)[picked]
    x = np.hstack([mean(found.jacobian[picked] * prior_sigma), mean(columns)])
    r = mean(found.r[picked] + columns @ nuisance)[:, 0]
    s_from, s_to = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(s_from, at, points.s_mm[picked])
    np.maximum.at(s_to, at, points.s_mm[picked])
    pass_id = np.zeros(n, dtype=np.int32)
    pass_id[at] = points.pass_id[picked]
    blocks = len(surface.block_from_mm)
    wide = np.zeros((len(surface), NUISANCES))
    return replace(
        surface,
        r=np.r_[surface.r, r],
        x=np.vstack([np.hstack([surface.x, wide]), x]),
        count=np.r_[surface.count, count],
        block=np.r_[surface.block, blocks + np.arange(n, dtype=np.int32)].astype(np.int32),
        across=np.r_[surface.across, np.zeros(n)],
        position_base=np.vstack([surface.position_base, mean(found.point_base[picked])]),
        block_from_mm=np.r_[surface.block_from_mm, s_from],
        block_to_mm=np.r_[surface.block_to_mm, s_to],
        block_pass=np.r_[surface.block_pass, pass_id].astype(np.int32),
        edge=np.r_[surface.edge, np.ones(n, dtype=bool)],
        direction_base=np.vstack([surface.direction_base, mean(found.jacobian[picked, 3:])]),
    )


def _side(found: EdgeRows, picked: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return 0 or 1 for edges on either side of the travel, by the direction of their conormal."""
    b = found.jacobian[picked, 3:]
    if len(b) == 0:
        return np.zeros(0, dtype=np.int64)
    axis = np.linalg.svd(b.T @ b)[0][:, 0]
    return (b @ axis > 0).astype(np.int64)
