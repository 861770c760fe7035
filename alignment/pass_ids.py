"""Passes of a scan whose file does not number them: from gaps in time, jumps in position and reversals of travel."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

GAP = 5.0
"""A step this many times the usual one, in time or in length, ends a pass."""
LEAST_JUMP_MM = 3.0
LEAST_STEP_MM = 0.3
"""Directions of shorter steps are noise."""
TURN_COS = 0.5
"""A step that turns by more than 60 deg from the one before ends a pass."""


def pass_ids(xyz_mm: Array, t_s: Array | None) -> NDArray[np.int32]:
    """Return the pass of each pose (m,), counted from 0. xyz_mm (m, 3): TCP positions in order; t_s (m,) or None."""
    m = len(xyz_mm)
    if m < 3:
        return np.zeros(m, dtype=np.int32)
    step = np.diff(xyz_mm, axis=0)
    length = np.linalg.norm(step, axis=1)
    usual = float(np.median(length[length > 0])) if (length > 0).any() else 0.0
    ends = length > max(GAP * usual, LEAST_JUMP_MM)
    if t_s is not None:
        dt = np.diff(t_s)
        usual_dt = float(np.median(dt[dt > 0])) if (dt > 0).any() else 0.0
        if usual_dt > 0.0:
            ends |= dt > GAP * usual_dt
    if usual >= LEAST_STEP_MM:
        clear = length > 0.5 * usual
        cos = np.einsum("ij,ij->i", step[1:], step[:-1]) / np.maximum(length[1:] * length[:-1], 1e-300)
        turned = np.concatenate([[False], (cos < TURN_COS) & clear[1:] & clear[:-1]])
        # The short step across to the next pass turns twice; only its first turn ends a pass.
        again = turned & np.concatenate([[False], (turned | ends)[:-1]])
        ends |= turned & ~again
    return np.concatenate([[0], np.cumsum(ends)]).astype(np.int32)
