"""What a scan shows of a part beyond its placement and its field: said in words, in figures, and in the prediction."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.metrics import Expected
from alignment.metrics.figures import Prediction, spread
from alignment.non_rigid import LeftOver
from planner.frames import Array
from planner.issues import Issue
from planner.setup import Setup
from planner.toolpath import ToolPath

STEP, REST = "step-unfollowed", "rest-unfollowed"
# Steps said one by one; of more only the number.
MOST_SAID = 3
# Poses that the scan must have seen for them to speak for all.
LEAST_SEEN = 20


def left_issues(left: LeftOver | None, setup: Setup) -> list[Issue]:
    """Return one warning per step that poses cannot follow, with its place; else one where slow rest is left."""
    if left is None or not left.counts:
        return []
    if not left.steps.found:
        return [
            Issue(
                "warning",
                REST,
                f"over stretches of some centimetres the readings stand {left.slow_rms_mm:.2f} mm rms off what is believed of "
                "the part, be it the part's shape or the robot's own error: nothing of it is followed, and the prediction "
                "after the correction counts it.",
                "Scan with passes closer together (the inspection path itself will do), and align as non-rigid.",
                "scan",
            )
        ]
    found = left.steps.found
    more = f"; {len(found) - MOST_SAID} more are in correction.json" if len(found) > MOST_SAID else ""
    out = []
    for k, step in enumerate(found[:MOST_SAID]):
        a, b = (_place(p) for p in step.ends_part)
        passes = "one pass" if step.passes == 1 else f"{step.passes} passes"
        out.append(
            Issue(
                "warning",
                STEP,
                f"a step of {step.height_mm:.2f} mm, seen by {passes} over {step.extent_mm:.0f} mm, from {a} to {b}, is too "
                f"steep to follow: beside it the standoff stays up to {left.off_mm(step):.2f} mm off. Between passes "
                f"nothing was seen{more if k == 0 else ''}.",
                "If the part is meant to have it (a ply drop, a joggle), align against a CAD that has it; if not, look at the "
                "part. Do not trust echoes within the beam's width of it.",
                f"part {_place(step.point_part)}",
            )
        )
    return out


def _place(point: Array) -> str:
    return "({:.0f}, {:.0f}, {:.0f})".format(*(point + 0.0))


def left_json(left: LeftOver | None, poses: ToolPath) -> dict[str, Any]:
    """Return what correction.json says of it: the share of data poses where the scan went, and steps, mm in `part`."""
    if left is None:
        return {"seen_share": None, "steps": []}
    steps = [
        {
            "height_mm": step.height_mm,
            "extent_mm": step.extent_mm,
            "passes": step.passes,
            "point_part_mm": step.point_part.tolist(),
            "ends_part_mm": step.ends_part.tolist(),
        }
        for step in left.steps.found
    ]
    return {"seen_share": left.seen_share(poses.take(poses.is_data).Ts_part_contact.xyz_mm), "steps": steps}


def with_shape(error: Prediction, shape: Prediction, left: LeftOver | None) -> Prediction:
    """Return what is foreseen of the estimate's own error, with what is left of the part's shape."""
    if left is None or not left.counts:
        return error
    return replace(
        error,
        tof_std_mm=float(np.hypot(error.tof_std_mm, shape.tof_std_mm)),
        tof_range_mm=float(np.hypot(error.tof_range_mm, shape.tof_range_mm)),
    )


def with_left(
    seen: Expected, left: LeftOver, places_part: Array, on: NDArray[np.bool_]
) -> tuple[Expected, NDArray[np.bool_]]:
    """Return what poses (n,) at places (n, 3) of the part see with what is left over, and which of them the scan speaks for.

    Spread and range are of the poses `on` the part where the scan went: what lies between its passes is not known.
    """
    off = left.at(places_part)
    known = on & np.isfinite(off)
    if known.sum() < LEAST_SEEN:
        known, off = on, np.nan_to_num(off)
    distance = np.where(known, seen.distance_mm - off, seen.distance_mm)
    std, width = spread(distance[known])
    return replace(seen, distance_mm=distance, summary=replace(seen.summary, tof_std_mm=std, tof_range_mm=width)), known
