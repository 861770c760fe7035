"""`ProgramPath`: the motion a robot program commands, as read back from its text. What the robot will really do."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform


class Motion(IntEnum):
    """How the robot moves to a pose."""

    LIN = 0
    """Straight line with slerp of the orientation (LIN, SLIN)."""
    SPL = 1
    """Smooth spline through the poses of one block (SPL in SPLINE ... ENDSPLINE)."""


@dataclass(frozen=True, eq=False)
class ProgramPath:
    """The n Cartesian motions of a program in the order they run; axis motions (PTP to axis values, HOME) are not among them.

    Ts_base_tcp: target poses of the tool *as taught* in the program's active BASE (named `base` whatever its numbers are),
    stack n. motion (n,): `Motion` leading to the pose. block (n,): number of the spline block, -1 outside. data_on (n,):
    TRUE when the data signal is on during the motion that ends at the pose. speed_mm_s (n,): commanded speed of that
    motion. pass_id (n,): pass (fold) the motion belongs to, -1 outside.
    """

    Ts_base_tcp: Transform
    motion: NDArray[np.uint8]
    block: NDArray[np.int32]
    data_on: NDArray[np.bool_]
    speed_mm_s: Array
    pass_id: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.Ts_base_tcp)
