"""`PointCloud`: what a scan measured, in the nominal base."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.issues import Issue


@dataclass(frozen=True, eq=False)
class PointCloud:
    """n usable readings in the nominal `base`, mm.

    origins_base, beams_base (n, 3): where each law fires from and its direction (unit, TCP z). distance_mm (n,): measured
    distance to the surface (perpendicular, for the ultrasonic point model). A cloud of ready surface points (laser) has
    `origins_base` on the surface, distance 0 and beams None. arrays_base (n, 3): direction of the array axis (TCP x) or
    None. amplitude_pct (n,): NaN if unknown. law, pose_index, pass_id, scan_id (n,): where the reading came from
    (pose_index and pass_id count over all scans, in order of time). law is 1 for ready surface points. Lost echoes are kept
    in `lost_*` (l,), since an edge shows in them: `lost_origins_base`, `lost_beams_base` (l, 3).
    """

    origins_base: Array
    beams_base: Array | None
    arrays_base: Array | None
    distance_mm: Array
    amplitude_pct: Array
    law: NDArray[np.int32]
    pose_index: NDArray[np.int32]
    pass_id: NDArray[np.int32]
    scan_id: NDArray[np.int32]
    lost_origins_base: Array = field(default_factory=lambda: np.zeros((0, 3)))
    lost_pose_index: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    lost_law: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    lost_beams_base: Array = field(default_factory=lambda: np.zeros((0, 3)))
    lost_pass_id: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    total_readings: int = 0
    issues: tuple[Issue, ...] = ()

    def __len__(self) -> int:
        return len(self.distance_mm)

    @property
    def axial_points_base(self) -> Array:
        """Points on the beam axis, origin + d * beam (n, 3), mm: the usual model, off by d sin(tilt) along the surface."""
        if self.beams_base is None:
            return self.origins_base
        return self.origins_base + self.distance_mm[:, None] * self.beams_base
