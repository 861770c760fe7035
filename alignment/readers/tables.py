"""From the columns of a table to arrays ready for a `Scan`: checked, and poses stored once. Runs inside the sandbox.

A payload is a dict of arrays and JSON values, so that it can leave a child process:
`kind` and per kind
readings: `poses (m, 6)` mm and deg, `pose_index (n,)`, `law`, `tof_us`, `amplitude_pct`, `t_s` or None, `pass_id` or None
poses:    `t_s (m,)`, `poses (m, 6)`, `pass_id` or None
echoes:   `t_s (n,)`, `law`, `tof_us`, `amplitude_pct`, `pass_id` or None
points:   `points (n, 3)`, `amplitude_pct` or None, `tof_us` or None
and always `base` (six numbers or None), `issues` (list of JSON issues); `simulated` (true or false) where the format can say.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.readers import checks
from alignment.readers.arrays import Array
from alignment.readers.columns import BASE, POSE, POSITION, SIMULATED, Layout
from planner.errors import fail


def payload(found: Layout, columns: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the payload of a table. `columns` maps contract names to polars series or arrays, empty cells null or NaN."""
    rows = len(next(iter(columns.values())))
    if rows == 0:
        raise fail("scan-empty", "the file has a header but no readings.", "Export the scan again.", name)
    issues = [issue.to_json() for issue in found.issues]
    out: dict[str, Any] = {"kind": found.kind, "base": _base(columns, name), "issues": issues}
    out["simulated"] = SIMULATED in columns and bool(np.any(_numbers(columns[SIMULATED]) > 0.0))
    if found.kind == "points":
        points = _stack(columns, POSITION)
        keep = checks.finite_rows(points, POSITION, name, issues)
        out["points"] = checks.length_unit(points[keep], name)
        for key in ("amplitude_pct", "tof_us"):
            out[key] = _numbers(columns[key])[keep] if key in columns else None
        return out
    passes = _whole(columns["pass"], "pass", name) if "pass" in columns else None
    time = checks.time(_numbers(columns["t_s"]), name) if "t_s" in columns else None
    if found.kind != "echoes":
        out |= _poses(columns, name)
    if found.kind != "poses":
        out["law"] = checks.law(_whole(columns["law"], "law", name), name)
        out["tof_us"] = checks.time_of_flight(_numbers(columns["tof_us"]), name)
        out["amplitude_pct"] = _numbers(columns["amplitude_pct"])
    if found.kind == "poses":
        out["poses"] = out["poses"][out.pop("pose_index")]
    return out | {"t_s": time, "pass_id": passes}


def _poses(columns: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Poses stored once: a row whose six numbers equal those of the row before shares its pose."""
    six = [_numbers(columns[key]) for key in POSE]
    n = len(six[0])
    new = np.zeros(n, dtype=bool)
    new[0] = True
    for values in six:
        new[1:] |= values[1:] != values[:-1]
    poses = np.stack([values[new] for values in six], axis=1)
    checks.poses(poses, name, np.flatnonzero(new))
    pose_index = np.cumsum(new, dtype=np.int32) - np.int32(1)
    return {"poses": poses, "pose_index": pose_index}


def _base(columns: Mapping[str, Any], name: str) -> list[float] | None:
    if BASE[0] not in columns:
        return None
    six = []
    for key in BASE:
        values = _numbers(columns[key])
        low, high = float(values.min()), float(values.max())
        if not (np.isfinite(low) and low == high):
            raise fail(
                "base-not-constant",
                f"column '{key}' is not one number: it runs from {low:g} to {high:g}.",
                "A scan is taken in one BASE; split the file where the BASE changed.",
                name,
            )
        six.append(low)
    return six


def _stack(columns: Mapping[str, Any], keys: tuple[str, ...]) -> Array:
    return np.stack([_numbers(columns[key]) for key in keys], axis=1)


def _numbers(column: Any) -> Array:
    """A column as float64, empty cells NaN."""
    if hasattr(column, "to_numpy"):
        column = column.to_numpy()
    return np.asarray(column, dtype=np.float64)


def _whole(column: Any, key: str, name: str) -> NDArray[np.int32]:
    values = _numbers(column)
    bad = ~(np.abs(values) < 2**31) | (values != np.rint(values))
    if bad.any():
        row = int(np.argmax(bad))
        what = f"{values[row]:g} is not a whole number" if np.isfinite(values[row]) else "the cell is empty"
        raise fail(
            f"{key}-not-whole",
            f"column '{key}', reading {row + 1}: {what}.",
            f"Every reading needs its {key} number; leave out rows of lost echoes, or leave their tof_us empty.",
            name,
        )
    return values.astype(np.int32)
