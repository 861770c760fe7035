"""Which readings belong together: cells along the pass and across the laws, or cubes for ready surface points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import PoseLine
from planner.frames import Array
from planner.probe import law_offsets_mm
from planner.setup import Probe


@dataclass(frozen=True, eq=False)
class Cells:
    """c cells over n readings.

    of_reading (n,): cell of each reading. pass_id (c,): its pass. s_from_mm, s_to_mm (c,): its stretch of path; NaN for
    ready surface points. across_mm (c,): position of its middle on the array axis. block (c,): cells of one stretch of one
    pass, whatever their laws, share a number.
    """

    of_reading: NDArray[np.int32]
    pass_id: NDArray[np.int32]
    s_from_mm: Array
    s_to_mm: Array
    across_mm: Array
    block: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.across_mm)


def cells_along_passes(cloud: PointCloud, line: PoseLine, probe: Probe, cell_mm: float) -> Cells:
    """Return cells of about `cell_mm` along each pass and across the laws."""
    block_of_pose, s_from, s_to, block_pass = _stretches(line, cell_mm)
    x = law_offsets_mm(probe)
    bands = max(1, round(float(np.ptp(x) + probe.pitch_mm) / cell_mm)) if len(x) > 1 else 1
    band_of_law = (np.arange(len(x)) * bands) // len(x)
    key = block_of_pose[cloud.pose_index] * bands + band_of_law[cloud.law - 1]
    used = np.bincount(key, minlength=len(s_from) * bands) > 0
    number = np.cumsum(used) - 1
    cell = np.flatnonzero(used)
    block, band = cell // bands, cell % bands
    middle = np.bincount(band_of_law, x, bands) / np.bincount(band_of_law, minlength=bands)
    return Cells(
        number[key].astype(np.int32),
        block_pass[block],
        s_from[block],
        s_to[block],
        middle[band],
        block.astype(np.int32),
    )


def _stretches(line: PoseLine, cell_mm: float) -> tuple[NDArray[np.int64], Array, Array, NDArray[np.int32]]:
    """Return block of each pose (m,), and start, end and pass of each block. Every pass is cut into equal stretches."""
    m = len(line.present)
    rows = np.flatnonzero(line.present)
    starts = np.flatnonzero(np.r_[True, np.diff(line.pass_id[rows]) != 0])
    ends = np.r_[starts[1:], len(rows)]
    length = line.s_mm[rows[ends - 1]] - line.s_mm[rows[starts]]
    pieces = np.maximum(1, np.round(length / cell_mm)).astype(np.int64)
    first = np.r_[0, np.cumsum(pieces)[:-1]]
    run = np.repeat(np.arange(len(starts)), ends - starts)
    width = length / pieces
    within = (line.s_mm[rows] - line.s_mm[rows[starts]][run]) / np.where(width > 0, width, 1.0)[run]
    block_of_pose = np.zeros(m, dtype=np.int64)
    block_of_pose[rows] = first[run] + np.minimum(within.astype(np.int64), pieces[run] - 1)
    of_run = np.repeat(np.arange(len(starts)), pieces)
    number = np.arange(len(of_run)) - first[of_run]
    s_from = line.s_mm[rows[starts]][of_run] + number * width[of_run]
    return block_of_pose, s_from, s_from + width[of_run], line.pass_id[rows[starts]][of_run]


def cells_in_space(points: Array, cell_mm: float) -> Cells:
    """Return cubic cells of surface points (n, 3) without a path."""
    low = points.min(axis=0)
    index = np.floor((points - low) / cell_mm).astype(np.int64)
    shape = index.max(axis=0) + 1
    flat = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
    used, of_reading = np.unique(flat, return_inverse=True)
    c = len(used)
    nan = np.full(c, np.nan)
    return Cells(
        of_reading.astype(np.int32),
        np.zeros(c, dtype=np.int32),
        nan,
        nan.copy(),
        np.zeros(c),
        np.arange(c, dtype=np.int32),
    )
