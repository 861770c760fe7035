"""Which way to travel the passes that cross edges, so that a late clock does not pass for a shift of the part.

A clock that is late puts every crossing further along the travel. Two opposite edges both crossed outwards see a part that is
larger, not elsewhere; crossed one after the other on the way, they see a part that has moved.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.crossings import EDGE_SIGMA_MM, Rim, edge_rows, prior_precision
from planner.path.ends import Run
from planner.setup import Setup

# What an unknown clock, and the beam's own threshold, may shift crossings by (mm, one sigma): 5 ms at 100 mm/s.
LAG_SIGMA_MM, BIAS_SIGMA_MM = 0.5, 0.15
# Passes are turned round only for this much of the doubt left (share of its trace); the robot's way is longer then.
WORTH = 0.03


def opposed(
    runs: Sequence[Run], flip: NDArray[np.bool_], rim: Rim, precision: Array, centre: Array, setup: Setup
) -> NDArray[np.bool_]:
    """Return which runs (k,) to travel backwards: as `flip` has it, but turned round where that tells clock from part.

    precision (6, 6): of a motion about `centre`, of the fixture and all that the surface along the runs tells. The pass whose
    turning leaves the least doubt (trace of the posterior, whitened by the prior, clock and threshold unknown) is turned
    first, as long as that is worth it.
    """
    at = [(k, end) for k, run in enumerate(runs) for end in run.over]
    if not at:
        return flip
    which, last = np.array([k for k, _ in at]), np.array([end == 1 for _, end in at])
    points = np.array([runs[k].rim_at(rim, end) for k, end in at])
    j = edge_rows(rim.points[points], rim.conormals[points], rim.along[points], centre, setup)
    bias = np.full((*j.shape[:2], 1), BIAS_SIGMA_MM / EDGE_SIGMA_MM)
    scale = np.sqrt(np.diag(prior_precision(setup)))
    known = np.zeros((8, 8))
    known[:6, :6] = precision / np.outer(scale, scale)
    known[[6, 7], [6, 7]] = 1.0

    def doubt(turned: NDArray[np.bool_]) -> float:
        leaves = np.where(last != turned[which], 1.0, -1.0)[:, None, None]
        lag = np.broadcast_to(leaves * LAG_SIGMA_MM / EDGE_SIGMA_MM, bias.shape)
        x = np.concatenate([j / scale, bias, lag], axis=2).reshape(-1, 8)
        return float(np.trace(np.linalg.inv(known + x.T @ x)[:6, :6]))

    flip = flip.copy()
    least = doubt(flip)
    for _ in range(len(runs)):
        tries = [(doubt(flip ^ (np.arange(len(runs)) == k)), k) for k in np.unique(which)]
        best, k = min(tries)
        if best > (1.0 - WORTH) * least:
            break
        flip[k], least = not flip[k], best
    return flip
