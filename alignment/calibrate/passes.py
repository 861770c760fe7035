"""Where passes begin in a calibration scan, for drawings over its poses."""

import numpy as np
from numpy.typing import NDArray

from alignment.scan import Scan
from planner.frames import Array


def pass_starts(scan: Scan, poses: NDArray[np.int64]) -> Array:
    """Return the poses (of those given, ascending) with which another pass begins, as float64 (k,); empty if unknown."""
    if scan.pass_id is None or len(poses) == 0:
        return np.zeros(0)
    first_pose, first = np.unique(scan.pose_index, return_index=True)
    of_pose = scan.pass_id[first][np.searchsorted(first_pose, poses)]
    return poses[1:][np.diff(of_pose) != 0].astype(np.float64)
