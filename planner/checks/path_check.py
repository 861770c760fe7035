"""`PathCheck`: everything the checks found on a path, pose by pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.issues import Issue


@dataclass(frozen=True, eq=False)
class PathCheck:
    """Findings on a path of n poses; every array has n rows, NaN where a quantity does not apply.

    tilt_deg, standoff_mm, curvature_loss_db, sagitta_mm, effective_swath_mm: what the ultrasound sees (data poses).
    clearance_mm: nozzle to part, at the pose and on the way to the next, a lower bound; wrist_clearance_mm likewise, and
    to keep-outs of known height. keep_out_mm: nozzle beside what must not be crossed or stands there, at the pose and on
    the way to the next; inf where nothing is. fixture_mm: two sigma of the fixture's tolerance along the normal. axes_deg
    (n, 6): robot axes. reachable, singular, jumped (n,). margin_deg: to the nearest axis limit. speed_share: axis speed
    to the next pose over its limit. status, turn: KUKA's, of the first pose. robot: name of the robot file. issues:
    collected, most severe first.
    """

    tilt_deg: Array
    standoff_mm: Array
    curvature_loss_db: Array
    sagitta_mm: Array
    effective_swath_mm: Array
    clearance_mm: Array
    wrist_clearance_mm: Array
    keep_out_mm: Array
    fixture_mm: Array
    axes_deg: Array
    reachable: NDArray[np.bool_]
    singular: NDArray[np.bool_]
    jumped: NDArray[np.bool_]
    margin_deg: Array
    speed_share: Array
    status: int
    turn: int
    robot: str
    issues: tuple[Issue, ...]

    @property
    def ok(self) -> bool:
        """True when no issue is an error."""
        return all(issue.severity != "error" for issue in self.issues)

    def summary(self) -> dict[str, float | int | str | None]:
        """Return the figures for plan.json; null where a quantity does not apply."""
        return {
            "poses": len(self.tilt_deg),
            "tilt_max_deg": _largest(self.tilt_deg),
            "standoff_min_mm": _smallest(self.standoff_mm),
            "standoff_max_mm": _largest(self.standoff_mm),
            "curvature_loss_max_db": _largest(self.curvature_loss_db),
            "effective_swath_min_mm": _smallest(self.effective_swath_mm),
            "clearance_min_mm": _smallest(self.clearance_mm),
            "wrist_clearance_min_mm": _smallest(self.wrist_clearance_mm),
            "keep_out_min_mm": _smallest(self.keep_out_mm),
            "fixture_two_sigma_mm": _largest(self.fixture_mm),
            "robot": self.robot,
            "reachable_share": float(self.reachable.mean()) if len(self.reachable) else None,
            "axis_margin_min_deg": _smallest(self.margin_deg),
            "singular_poses": int(self.singular.sum()),
            "axis_jumps": int(self.jumped.sum()),
            "axis_speed_share_max": _largest(self.speed_share),
        }


def _largest(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if len(finite) else None


def _smallest(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(finite.min()) if len(finite) else None
