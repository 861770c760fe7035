"""What the point cloud formats have in common: names of fields, and the payload. Runs inside the sandbox."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from alignment.readers import checks
from alignment.readers.columns import POSITION
from planner.errors import fail
from planner.issues import Issue

# Field names met in the wild, lower case, by what they mean here.
ALIASES = {
    "x": "x_mm",
    "y": "y_mm",
    "z": "z_mm",
    "amplitude": "amplitude_pct",
    "amplitudes": "amplitude_pct",
    "timeofflight": "tof_us",
    "tof": "tof_us",
}


def cloud_payload(fields: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the points payload of named fields, each (n,). Positions are mm; `x` means `x_mm`, `Amplitudes` %FSH."""
    by_name = {
        ALIASES.get(key.lower(), key.lower()): np.asarray(values, dtype=np.float64) for key, values in fields.items()
    }
    missing = [key for key in POSITION if key not in by_name]
    if missing:
        raise fail(
            "column-missing",
            f"field {', '.join(missing)} missing; the file has {', '.join(fields)}.",
            "A point cloud needs x, y and z in mm.",
            name,
        )
    points = np.stack([by_name[key] for key in POSITION], axis=1)
    if len(points) == 0:
        raise fail("scan-empty", "the file holds no points.", "Export the cloud again.", name)
    issues: list[dict[str, Any]] = []
    keep = checks.finite_rows(points, POSITION, name, issues)
    extra = [key for key in by_name if key not in (*POSITION, "amplitude_pct", "tof_us")]
    if extra:
        issues.append(Issue("info", "columns-unused", f"fields not used: {', '.join(extra[:12])}.", "", name).to_json())
    tof = by_name.get("tof_us")
    return {
        "kind": "points",
        "points": checks.length_unit(points[keep], name),
        "amplitude_pct": by_name["amplitude_pct"][keep] if "amplitude_pct" in by_name else None,
        "tof_us": None if tof is None else tof[keep],
        "base": None,
        "issues": issues,
    }
