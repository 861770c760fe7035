"""Frames of readings from HDF5: `poses (n, 6)`, `tof_us (n, laws)`, `amplitude_pct (n, laws)`. Runs inside the sandbox."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from alignment.readers import checks
from alignment.readers.arrays import Array
from alignment.readers.columns import BASE
from planner.errors import fail
from planner.issues import Issue

KNOWN = {"poses", "tof_us", "amplitude_pct", "t_s", "pass", *BASE}


def parse_hdf5(source: Path, name: str) -> dict[str, Any]:
    """Return the payload (see `tables.payload`) of an HDF5 file; data sets may stand in the root or in one group.

    `t_s` and `pass` may be (n,) or (n, laws). The base may be six scalar data sets or attributes `base_x_mm ..`.
    """
    try:
        with h5py.File(source, "r") as file:
            return _payload(_group(file, name), name)
    except OSError as error:
        raise fail("hdf5-unreadable", f"not a readable HDF5 file ({error}).", "Export it again.", name) from error


def _group(file: h5py.File, name: str) -> h5py.Group:
    wanted = ("poses", "tof_us", "amplitude_pct")
    groups = [file, *(item for item in file.values() if isinstance(item, h5py.Group))]
    best = max(groups, key=lambda group: sum(key in group for key in wanted))
    missing = [key for key in wanted if key not in best]
    if missing:
        raise fail(
            "dataset-missing",
            f"data set {', '.join(missing)} missing; the file has {', '.join(sorted(best)) or 'none'}.",
            "EchoBase reads poses (n, 6), tof_us (n, laws) and amplitude_pct (n, laws).",
            name,
        )
    return best


def _payload(group: h5py.Group, name: str) -> dict[str, Any]:
    poses = _array(group, "poses", name)
    tof = np.atleast_1d(_array(group, "tof_us", name))
    amplitude = np.atleast_1d(_array(group, "amplitude_pct", name))
    if poses.ndim != 2 or poses.shape[1] != 6:
        raise fail(
            "dataset-shape", f"'poses' is {poses.shape}, not (n, 6).", "Store X Y Z (mm) A B C (deg) a row.", name
        )
    tof, amplitude = (v[:, None] if v.ndim == 1 else v for v in (tof, amplitude))
    if tof.shape != amplitude.shape or tof.ndim != 2 or len(tof) != len(poses):
        raise fail(
            "dataset-shape",
            f"'tof_us' is {tof.shape} and 'amplitude_pct' {amplitude.shape}, not both ({len(poses)}, laws).",
            "Store one row a pose and one column a law; NaN where the echo was lost.",
            name,
        )
    if len(poses) == 0:
        raise fail("scan-empty", "the file holds no readings.", "Export the scan again.", name)
    checks.poses(poses, name)
    n, laws = tof.shape
    extra = sorted(set(group) - KNOWN)
    issues = (
        [Issue("info", "datasets-unused", f"data sets not used: {', '.join(extra[:12])}.", "", name)] if extra else []
    )
    passes = _per_reading(group, "pass", n, laws, name)
    times = _per_reading(group, "t_s", n, laws, name)
    return {
        "kind": "readings",
        "poses": poses,
        "pose_index": np.repeat(np.arange(n, dtype=np.int32), laws),
        "law": np.tile(np.arange(1, laws + 1, dtype=np.int32), n),
        "tof_us": checks.time_of_flight(tof.ravel(), name),
        "amplitude_pct": amplitude.ravel(),
        "t_s": None if times is None else checks.time(times, name),
        "pass_id": None if passes is None else passes.astype(np.int32),
        "base": _base(group, name),
        "issues": [issue.to_json() for issue in issues],
    }


def _array(group: h5py.Group, key: str, name: str) -> Array:
    data = group[key]
    if not isinstance(data, h5py.Dataset) or data.dtype.kind not in "iuf":
        raise fail("dataset-type", f"'{key}' does not hold numbers.", "Store it as float64.", name)
    return np.asarray(data[()], dtype=np.float64)


def _per_reading(group: h5py.Group, key: str, n: int, laws: int, name: str) -> Array | None:
    if key not in group:
        return None
    values = _array(group, key, name)
    if values.shape == (n,):
        return np.repeat(values, laws)
    if values.shape == (n, laws):
        return values.ravel()
    raise fail("dataset-shape", f"'{key}' is {values.shape}, not ({n},) or ({n}, {laws}).", "One value a pose.", name)


def _base(group: h5py.Group, name: str) -> list[float] | None:
    values = {}
    for key in BASE:
        if key in group:
            values[key] = np.unique(_array(group, key, name))
        elif key in group.attrs:
            values[key] = np.unique(np.asarray(group.attrs[key], dtype=np.float64))
    if not values:
        return None
    for key in BASE:
        if key not in values or len(values[key]) != 1 or not np.isfinite(values[key][0]):
            raise fail(
                "base-not-constant",
                f"'{key}' is missing or not one number.",
                "Give all six of base_x_mm .. base_c_deg, each one number, or none.",
                name,
            )
    return [float(values[key][0]) for key in BASE]
