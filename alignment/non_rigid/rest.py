"""What single readings leave of a part once it is placed and its field followed: a fine grid over every pass."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.cells import cells_along_passes
from alignment.estimate.patches import condense
from alignment.estimate.pose_line import pose_line
from alignment.estimate.problem import Problem
from alignment.estimate.readings import look_at
from alignment.estimate.robust import mad_sigma
from alignment.estimate.surface_rows import patch_rows
from alignment.non_rigid.field import Field
from planner.frames import Array, Transform
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# Size of a cell (mm), and how many at most: a cell must hold some readings for its own middle to be known.
FINE_MM, MOST_FINE = 3.0, 15_000
# Of a cell's readings this share must agree with its middle; and it must be no farther from the middle of the cells around than
# this (mm, and robust standard deviations of all). Beside a step most of those around a cell stand on its own side.
MOST_AGREE, LONE_MM, LONE_SIGMAS = 0.6, 0.1, 8.0
# Empty rows between two passes, so that nothing is compared across.
APART = 16
AROUND = 2


@dataclass(frozen=True, eq=False)
class Rest:
    """Cells of every pass, one pass above the other: b rows along the passes, k columns across the laws.

    value_mm (b, k): how far the part stands out of what is believed of it along the normal, NaN where nothing was heard.
    points_part (b, k, 3): where, NaN where there is no cell; height_mm (b, k): from how far. pass_id (b,): -1 in the rows
    between passes. size_mm (2,): of a cell along and across.
    """

    value_mm: Array
    points_part: Array
    height_mm: Array
    pass_id: NDArray[np.int32]
    size_mm: Array

    @property
    def known(self) -> NDArray[np.bool_]:
        """Cells (b, k) where something was heard of the surface."""
        return np.asarray(np.isfinite(self.value_mm))

    @property
    def placed(self) -> NDArray[np.bool_]:
        """Cells (b, k) that have a place: over a step readings may agree on nothing."""
        return np.asarray(np.isfinite(self.points_part[..., 0]))

    def followed(self, field: Field) -> "Rest":
        """Return what is left once a field is followed. Slopes g shorten distances by h |g|^2 / 2, to second order."""
        known = self.known
        foot = field.curved.closest(self.points_part[known])
        f, g = field.on(foot.face, foot.bary)
        value = self.value_mm.copy()
        value[known] -= f + 0.5 * self.height_mm[known] * (g**2).sum(axis=1)
        return replace(self, value_mm=value)


def rest_of(cloud: PointCloud, curved: CurvedSurface, setup: Setup, T_base_part: Transform) -> Rest | None:
    """Return what readings leave of a rigid part at its placement; None for readings without a path."""
    if cloud.beams_base is None or len(cloud) == 0:
        return None
    problem = Problem(curved, setup)
    line = pose_line(cloud, setup.probe)
    readings = look_at(cloud, setup.alignment.point_model)
    cells = cells_along_passes(readings, line, setup.probe, max(FINE_MM, line.spacing_mm), MOST_FINE)
    patches = condense(readings, cells, curved, T_base_part)
    rows = patch_rows(patches, curved, T_base_part, problem.centre_mm(T_base_part))
    points = T_base_part.inv().points(rows.foot_base)
    total = np.bincount(cells.of_reading, minlength=len(cells))
    agree = np.bincount(cells.of_reading, patches.kept, len(cells)) >= MOST_AGREE * total
    good = rows.valid & agree & (np.abs(rows.r) < 2.0 * setup.tolerances.standoff_mm)
    value = np.where(good, -rows.r, np.nan)
    at_row, of_row = _rows_apart(cells.block, cells.pass_id)
    column = np.unique(cells.across_mm, return_inverse=True)[1].ravel()
    shape = (len(of_row), int(column.max()) + 1)
    grid, places, height = np.full(shape, np.nan), np.full((*shape, 3), np.nan), np.zeros(shape)
    grid[at_row, column], places[at_row, column] = value, points
    height[at_row, column] = np.maximum(patches.distance_mm, 0.0)
    along = float(np.median(cells.s_to_mm - cells.s_from_mm))
    across = setup.probe.swath_mm / shape[1]
    return Rest(_without_lone(grid), places, height, of_row, np.array([max(along, 1e-3), across]))


def _rows_apart(block: NDArray[np.int32], pass_id: NDArray[np.int32]) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Return the row (c,) of each cell, passes `APART` rows apart, and the pass of each row (b,), -1 between passes."""
    order, of_block = np.unique(block, return_inverse=True)
    passes = np.zeros(len(order), dtype=np.int32)
    passes[of_block.ravel()] = pass_id
    number = np.cumsum(np.r_[1, np.diff(passes) != 0])[of_block.ravel()]
    row = (block - int(block.min()) + APART * number).astype(np.intp)
    of_row = np.full(int(row.max()) + 1 + APART, -1, dtype=np.int32)
    of_row[row] = pass_id
    return row, of_row


def _without_lone(grid: Array) -> Array:
    """Return the grid without cells far from the middle of those around: bubbles, splash, what lies on the part."""
    around = np.pad(grid, AROUND, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(around, (2 * AROUND + 1, 2 * AROUND + 1))
    known = np.isfinite(grid)
    off = grid[known] - np.nanmedian(windows[known].reshape(int(known.sum()), -1), axis=1)
    out = grid.copy()
    out[known] = np.where(
        np.abs(off) < LONE_MM + LONE_SIGMAS * mad_sigma(off, 1e-3, about_zero=True), grid[known], np.nan
    )
    return out
