"""Which columns a table has, and therefore what kind of scan data it is. Names are those of docs/scan-formats.md."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from planner.errors import fail
from planner.issues import Issue

Kind = Literal["readings", "poses", "echoes", "points"]

POSITION = ("x_mm", "y_mm", "z_mm")
ANGLES = ("a_deg", "b_deg", "c_deg")
POSE = POSITION + ANGLES
BASE = ("base_x_mm", "base_y_mm", "base_z_mm", "base_a_deg", "base_b_deg", "base_c_deg")
ECHO = ("law", "tof_us", "amplitude_pct")
SIMULATED = "simulated"
"""1 in every row of a scan that no transducer took: reports say so in large type."""

REQUIRED: dict[str, tuple[str, ...]] = {
    "readings": POSE + ECHO,
    "poses": ("t_s", *POSE),
    "echoes": ("t_s", *ECHO),
    "points": POSITION,
}
OPTIONAL: dict[str, tuple[str, ...]] = {
    "readings": ("t_s", "pass", SIMULATED, *BASE),
    "poses": ("pass", SIMULATED, *BASE),
    "echoes": ("pass", SIMULATED),
    "points": ("amplitude_pct", "tof_us", SIMULATED, *BASE),
}


@dataclass(frozen=True)
class Layout:
    """What a table holds: its kind, the columns to read (as the file spells them, by contract name) and its issues."""

    kind: Kind
    spelled: dict[str, str]
    issues: tuple[Issue, ...]


def layout(present: Sequence[str], name: str) -> Layout:
    """Decide what a table with these column names is; fail, naming the column, if one is missing."""
    by_name: dict[str, str] = {}
    for column in present:
        key = column.strip().lower()
        if key in by_name:
            raise fail(
                "column-twice",
                f"column '{key}' appears twice.",
                "Keep one of the two columns and load the file again.",
                name,
            )
        by_name[key] = column
    kind = _kind(set(by_name))
    missing = [column for column in REQUIRED[kind] if column not in by_name]
    if missing:
        raise fail("column-missing", *_missing_text(missing, list(by_name)), name)
    base = [column for column in BASE if column in by_name]
    if base and len(base) < len(BASE) and kind != "echoes":
        lacking = [column for column in BASE if column not in by_name]
        raise fail(
            "base-columns-incomplete",
            f"the BASE is given only in part: {', '.join(lacking)} missing.",
            "Write all six base_x_mm .. base_c_deg columns, or none (then the nominal BASE is taken).",
            name,
        )
    wanted = [column for column in REQUIRED[kind] + OPTIONAL[kind] if column in by_name]
    extra = [column for column in by_name if column not in wanted]
    issues = []
    if extra:
        listed = ", ".join(extra[:12]) + (", ..." if len(extra) > 12 else "")
        issues.append(Issue("info", "columns-unused", f"{len(extra)} further column(s) not used: {listed}.", "", name))
    return Layout(kind, {column: by_name[column] for column in wanted}, tuple(issues))


def _kind(have: set[str]) -> Kind:
    has_echo = bool(have & {"law", "tof_us"})
    has_pose = bool(have & set(POSE))
    if "t_s" in have and has_echo and not has_pose:
        return "echoes"
    if "t_s" in have and has_pose and not (have & set(ECHO)):
        return "poses"
    if have.issuperset(POSITION) and not (have & set(ANGLES)) and "law" not in have and "t_s" not in have:
        return "points"
    return "readings"


def _missing_text(missing: list[str], present: list[str]) -> tuple[str, str]:
    hints = []
    for column in missing:
        near = difflib.get_close_matches(column, [p for p in present if p not in ALL_NAMES], n=1, cutoff=0.6)
        near = near or [p for p in present if p not in ALL_NAMES and p == column.rsplit("_", 1)[0]]
        if near:
            hints.append(f"'{near[0]}' to '{column}'")
    listed = ", ".join(present[:24]) + (", ..." if len(present) > 24 else "")
    column_s = "column" if len(missing) == 1 else "columns"
    message = f"{column_s} {', '.join(missing)} missing; the file has {listed or 'no columns'}."
    remedy = (
        f"Rename {', '.join(hints)} if that is what is meant (and check the unit)."
        if hints
        else ("Add it under exactly this name; the unit is part of the name.")
    )
    return message, remedy


ALL_NAMES = frozenset(column for group in (*REQUIRED.values(), *OPTIONAL.values()) for column in group)
