"""The correction that a plan folder already holds."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from alignment.scan import Scan, SurfacePoints
from planner.errors import fail
from planner.frames import AXES, Transform
from planner.issues import Issue

POSE = tuple(f"{k}_{'mm' if k in 'xyz' else 'deg'}" for k in AXES)


def last_correction(folder: Path) -> Transform | None:
    """Return `T_base_basecorr` of correction/correction.json, or None if there is none or it failed."""
    path = folder / "correction" / "correction.json"
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["verdict"] == "fail":
            return None
        six = [float(content["correction"][f"{k}_{'mm' if k in 'xyz' else 'deg'}"]) for k in AXES]
    except (ValueError, KeyError, TypeError) as error:
        raise fail("correction-damaged", "correction.json cannot be read.", "Align again.", str(path)) from error
    return Transform.from_xyzabc("base", "basecorr", six)


def earlier_in(folder: Path) -> dict[str, Any] | None:
    """Return the content of the folder's correction.json with its own `sha256`; None if there is none or it failed."""
    if last_correction(folder) is None:
        return None
    data = (folder / "correction" / "correction.json").read_bytes()
    content: dict[str, Any] = json.loads(data)
    return {**content, "sha256": hashlib.sha256(data).hexdigest()}


def replaced(earlier: dict[str, Any] | None, correction: dict[str, float] | None) -> dict[str, Any] | None:
    """Return what `replaces` of a new correction.json says: the correction that stood there before, if it was another one."""
    if earlier is None:
        return None
    if earlier["correction"] == correction:
        # The same once more: what it replaced is still the other one that programs and scans may stand in.
        return earlier.get("replaces")
    return {key: earlier[key] for key in ("correction", "base", "sha256")}


def base_issues(
    earlier: dict[str, Any] | None, scans: Sequence[Scan | SurfacePoints], base: str | None
) -> tuple[Issue, ...]:
    """Return a warning for scans that cannot say in which BASE they were taken, where there were two corrected ones."""
    silent = [scan.name for scan in scans if scan.T_world_scan is None]
    before = None if earlier is None else earlier.get("replaces")
    if base != "corrected" or earlier is None or before is None or not silent:
        return ()
    now, then = (_said(content["base"]) for content in (earlier, before))
    columns = ", ".join(f"base_{key}" for key in POSE)
    return (
        Issue(
            "warning",
            "corrected-base-replaced",
            f"the correction of this folder was replaced by another one: the scan is taken as run in the newest BASE ({now}), "
            f"not in the one before ({then}).",
            f"If the program that ran was exported before, say so in the scan itself: columns {columns} with those numbers.",
            ", ".join(silent),
        ),
    )


def _said(base: dict[str, float]) -> str:
    return " ".join(
        f"{name} {base[key]:.{3 if key.endswith('mm') else 4}f}" for name, key in zip("XYZABC", POSE, strict=True)
    )
