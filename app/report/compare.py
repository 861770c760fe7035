"""The paper's Table 2 from data: the inspection before any correction, with the key-point method, and with this correction."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from alignment.metrics import Expected
from app.report.document import Cell, Column, Table
from app.report.shown import number, percent, six
from planner.frames import AXES, Array

UNITS = {k: "mm" if k in "xyz" else "deg" for k in AXES}


@dataclass(frozen=True, eq=False)
class State:
    """One state of the inspection. correction: X Y Z (mm) A B C (deg), None before any. seen: what the centre law meets."""

    name: str
    title: str
    correction: tuple[float, ...] | None
    seen: Expected

    @property
    def db(self) -> Array:
        """Amplitude change through tilt of the poses on the part (n,), dB."""
        return self.seen.db[self.seen.on_part]

    def figures(self, before: "State") -> dict[str, float | None]:
        """Return the figures of this state; improvements against `before`, %."""
        seen = self.seen.summary
        return {
            "tof_std_mm": seen.tof_std_mm,
            "tof_range_mm": seen.tof_range_mm,
            "tilt_max_deg": seen.tilt_max_deg,
            "mean_abs_db": seen.mean_abs_db,
            "within_2db": seen.within_2db,
            "tof_std_improvement_pct": _improvement(before.seen.summary.tof_std_mm, seen.tof_std_mm),
            "tof_range_improvement_pct": _improvement(before.seen.summary.tof_range_mm, seen.tof_range_mm),
            "amplitude_improvement_pct": _improvement(before.seen.summary.mean_abs_db, seen.mean_abs_db),
        }


def _improvement(before: float, after: float) -> float | None:
    if not (np.isfinite(before) and np.isfinite(after)) or before <= 0.0:
        return None
    return 100.0 * (before - after) / before


def comparison(states: tuple[State, ...]) -> tuple[Table, dict[str, Any]]:
    """Return the table, and the same as JSON by name of the state; the first state is the one before."""
    first = states[0]
    found = {s.name: s.figures(first) for s in states}
    rows: list[tuple[Cell, ...]] = []
    poses = [six(s.correction, signed=True) if s.correction else (None,) * 6 for s in states]
    for k, axis in enumerate(AXES):
        rows.append((f"Correction {axis.upper()} ({UNITS[axis]})", *(p[k] for p in poses)))
    for label, key, decimals in (
        ("ToF, standard deviation (mm)", "tof_std_mm", 3),
        ("ToF, range (mm)", "tof_range_mm", 3),
        ("Largest tilt (deg)", "tilt_max_deg", 3),
        ("Mean |dB| through tilt", "mean_abs_db", 3),
    ):
        rows.append((label, *(number(found[s.name][key], decimals) for s in states)))
    rows.append(("Within 2 dB of the reference", *(percent(found[s.name]["within_2db"]) for s in states)))
    for label, key in (
        ("Improvement of ToF std", "tof_std_improvement_pct"),
        ("Improvement of ToF range", "tof_range_improvement_pct"),
        ("Improvement of mean |dB|", "amplitude_improvement_pct"),
    ):
        cells = (None if s is first else number(found[s.name][key], 1, unit="%") for s in states)
        rows.append((label, *cells))
    columns = (Column(title="", look="text"), *(Column(title=s.title) for s in states))
    content = {
        s.name: {"correction": None if s.correction is None else list(s.correction), **_plain(found[s.name])}
        for s in states
    }
    return Table(name="comparison", columns=columns, rows=tuple(rows)), content


def _plain(figures: dict[str, float | None]) -> dict[str, float | None]:
    return {k: v if v is not None and np.isfinite(v) else None for k, v in figures.items()}
