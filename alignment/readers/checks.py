"""What a scan file may not be: each fault is one sentence with its remedy. Values are returned as they came."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.readers.arrays import Array
from alignment.readers.columns import POSE
from planner.errors import fail

# Two-way times through water lie between 1.4 us (1 mm) and 1,400 us (1 m): a median far outside is another unit.
LEAST_TOF_US, MOST_TOF_US = 0.3, 3_000.0
# No robot samples a scan every 0.02 mm over less than 20 mm; one that works in metres does.
METRE_STEP, METRE_EXTENT = 0.02, 20.0


def time_of_flight(tof_us: Array, name: str) -> Array:
    """Refuse a column without any echo, or one that is plainly not in microseconds."""
    finite = np.isfinite(tof_us)
    if not finite.any():
        raise fail(
            "tof-all-lost",
            "not one reading has a time of flight.",
            "Check the gate and the export of the acquisition: column 'tof_us' must hold two-way times in microseconds.",
            name,
        )
    sample = tof_us[finite] if finite.mean() < 1.0 else tof_us
    sample = sample[:: max(1, len(sample) // 20_000)]
    typical = float(np.median(np.abs(sample)))
    for low, high, unit in (
        (0.0, 1e-3, "seconds"),
        (1e-3, LEAST_TOF_US, "milliseconds"),
        (MOST_TOF_US, np.inf, "nanoseconds"),
    ):
        if low <= typical < high:
            raise fail(
                "tof-unit",
                f"the median time of flight is {typical:.3g}: that looks like {unit}, not microseconds.",
                "Convert column 'tof_us' to microseconds (15 mm of water are about 20 us).",
                name,
            )
    return tof_us


def law(values: NDArray[np.int32], name: str) -> NDArray[np.int32]:
    """Refuse law numbers below 1."""
    if values.min() < 1:
        row = int(np.argmax(values < 1))
        raise fail(
            "law-below-one",
            f"column 'law', reading {row + 1}: {values[row]} is below 1.",
            "Laws count from 1; add 1 if your acquisition counts from 0.",
            name,
        )
    return values


def time(t_s: Array, name: str) -> Array:
    """Refuse times that are missing or run backwards."""
    if not np.isfinite(t_s).all():
        raise fail("time-missing", "column 't_s' has empty cells.", "Every row needs its time, in seconds.", name)
    back = np.flatnonzero(np.diff(t_s) < 0)
    if len(back):
        row = int(back[0])
        raise fail(
            "time-backwards",
            f"column 't_s' runs backwards at row {row + 2} of the data ({t_s[row]:g} s, then {t_s[row + 1]:g} s).",
            "Sort the file by time; if the clock was reset, split the file there.",
            name,
        )
    return t_s


def poses(values: Array, name: str, first: NDArray[np.integer] | None = None) -> None:
    """Refuse poses that are not numbers, do not move, or are plainly in metres.

    values (m, 6), mm and deg. first (m,): the first reading of each pose, from 0; None: there is one row a pose.
    """
    finite = np.isfinite(values)
    if not finite.all():
        row, axis = np.argwhere(~finite)[0]
        at = f"pose {row + 1}" if first is None else f"reading {first[row] + 1}"
        raise fail(
            "pose-missing",
            f"column '{POSE[axis]}' is empty or not finite (first at {at}).",
            "A reading without a pose cannot be used: leave out its row.",
            name,
        )
    moved = np.ptp(values, axis=0)
    if not moved.any():
        raise fail(
            "poses-all-equal",
            "the robot does not move: all poses are equal.",
            "Check that the export writes the pose of each reading, not of the last one.",
            name,
        )
    length_unit(values[:, :3], name)


def length_unit(points: Array, name: str) -> Array:
    """Refuse positions (n, 3) that are plainly in metres."""
    if len(points) < 20:
        return points
    step = float(np.median(np.linalg.norm(np.diff(points[:20_000], axis=0), axis=1)))
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if 0.0 < extent < METRE_EXTENT and step < METRE_STEP:
        raise fail(
            "length-unit",
            f"all positions lie within {extent:.3g} and follow each other every {step:.2g}: that looks like metres, not mm.",
            "Convert x_mm, y_mm and z_mm to millimetres.",
            name,
        )
    return points


def finite_rows(points: Array, keys: tuple[str, ...], name: str, issues: list[dict[str, Any]]) -> NDArray[np.bool_]:
    """Return which rows are whole; say how many are not; refuse if none is."""
    keep: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    lost = int(len(keep) - np.count_nonzero(keep))
    if lost == len(keep):
        raise fail("points-all-lost", f"no row has all of {', '.join(keys)}.", "Export the cloud again.", name)
    if lost:
        issues.append(
            {
                "severity": "info",
                "code": "points-lost",
                "message": f"{lost} of {len(keep)} points have no coordinates and were left out.",
                "remedy": "",
                "where": name,
            }
        )
    return keep
