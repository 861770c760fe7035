"""Which readings belong together: cells along the pass and across the laws, or cubes for ready surface points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.pose_line import PoseLine
from alignment.estimate.readings import Readings
from planner.frames import Array
from planner.probe import law_offsets_mm
from planner.setup import Probe

# Cells that are too many become so many times longer.
COARSER = 1.25


@dataclass(frozen=True, eq=False)
class Cells:
    """c cells over m readings.

    of_reading (m,): cell of each reading that is looked at. pass_id (c,): its pass. s_from_mm, s_to_mm (c,): its stretch of
    path; NaN for ready surface points. across_mm (c,): position of its middle on the array axis. block (c,): cells of one
    stretch of one pass, whatever their laws, share a number.
    """

    of_reading: NDArray[np.int32]
    pass_id: NDArray[np.int32]
    s_from_mm: Array
    s_to_mm: Array
    across_mm: Array
    block: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.across_mm)


def cells_along_passes(
    readings: Readings, line: PoseLine, probe: Probe, cell_mm: float, most: int | None = None
) -> Cells:
    """Return cells of about `cell_mm` along each pass and across the laws; larger ones until there are at most `most`."""
    x = law_offsets_mm(probe)
    heard = np.zeros((len(line.present), len(x)), dtype=bool)
    heard.reshape(-1)[readings.pose_index * np.int64(len(x)) + (readings.law - 1)] = True
    while True:
        block_of_pose, s_from, s_to, block_pass = _stretches(line, cell_mm)
        bands = max(1, round(float(np.ptp(x) + probe.pitch_mm) / cell_mm)) if len(x) > 1 else 1
        band_of_law = (np.arange(len(x)) * bands) // len(x)
        # Bands without a law have no cells either.
        band, first = np.unique(band_of_law, return_index=True)
        pose, k = np.nonzero(np.logical_or.reduceat(heard, first, axis=1))
        key = block_of_pose[pose] * bands + band[k]
        used = np.bincount(key, minlength=len(s_from) * bands) > 0
        if most is None or int(used.sum()) <= most:
            break
        cell_mm *= COARSER
    number = (np.cumsum(used) - 1).astype(np.int32)
    cell = np.flatnonzero(used)
    block, band = cell // bands, cell % bands
    middle = np.bincount(band_of_law, x, bands) / np.maximum(np.bincount(band_of_law, minlength=bands), 1)
    at = (block_of_pose * bands).astype(np.int32)[readings.pose_index]
    at += np.r_[0, band_of_law].astype(np.int32)[readings.law]
    return Cells(
        number[at],
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


def cells_in_space(points: Array, cell_mm: float, most: int | None = None) -> Cells:
    """Return cubic cells of surface points (n, 3) without a path; larger ones until there are at most `most`."""
    low = points.min(axis=0)
    while True:
        index = np.floor((points - low) / cell_mm).astype(np.int64)
        shape = index.max(axis=0) + 1
        flat = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
        used, of_reading = np.unique(flat, return_inverse=True)
        if most is None or len(used) <= most:
            break
        cell_mm *= COARSER
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
