"""`Scan`: the readings of one scan file, as recorded."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform
from planner.issues import Issue


@dataclass(frozen=True, eq=False)
class Scan:
    """n readings (one firing of one law each) over m poses, in the order recorded.

    Ts_scan_tcp: poses of the tool *as taught* in the BASE that was active (`scan`), stack m. pose_index (n,): row of that
    stack. law (n,): from 1. tof_us (n,): two-way, NaN where the echo was lost. amplitude_pct (n,): %FSH, NaN if unknown.
    T_world_scan: the BASE that was active, in world; None = the file does not say. t_s, pass_id (n,): None if absent.
    simulated: the file says that no transducer took it.
    """

    Ts_scan_tcp: Transform
    pose_index: NDArray[np.int32]
    law: NDArray[np.int32]
    tof_us: Array
    amplitude_pct: Array
    T_world_scan: Transform | None
    t_s: Array | None = None
    pass_id: NDArray[np.int32] | None = None
    name: str = ""
    sha256: str = ""
    issues: tuple[Issue, ...] = field(default=())
    simulated: bool = False

    def __len__(self) -> int:
        return len(self.law)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """A cloud of n measured surface points (laser, or processed ultrasound) in the active BASE (`scan`), mm."""

    points_scan: Array
    amplitude_pct: Array | None
    tof_us: Array | None
    T_world_scan: Transform | None
    name: str = ""
    sha256: str = ""
    issues: tuple[Issue, ...] = field(default=())
    simulated: bool = False

    def __len__(self) -> int:
        return len(self.points_scan)
