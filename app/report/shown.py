"""Numbers as a report shows them: fixed decimals, a real minus sign, a dash for what is not there."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from app.report.document import Cell, Number
from planner.frames import AXES, Array

DASH = "–"
MINUS = "\N{MINUS SIGN}"
POSE_TITLES = ("X mm", "Y mm", "Z mm", "A deg", "B deg", "C deg")


def shown(cell: Cell) -> str:
    """Return a cell as text."""
    if cell is None:
        return DASH
    if isinstance(cell, str):
        return cell
    if cell.value is None or not np.isfinite(cell.value):
        return DASH
    text = f"{cell.value:.{cell.decimals}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    plus = "+" if cell.signed and float(text) > 0.0 else ""
    unit = f" {cell.unit}" if cell.unit else ""
    return plus + text.replace("-", MINUS) + unit


def number(value: Any, decimals: int = 3, signed: bool = False, unit: str = "") -> Number:
    """Return a number as a cell; what is not finite becomes a dash."""
    known = value is not None and np.isfinite(value)
    return Number(value=float(value) if known else None, decimals=decimals, signed=signed, unit=unit)


def percent(share: Any, decimals: int = 1) -> Number:
    """Return a share (0..1) as %."""
    return number(None if share is None else 100.0 * share, decimals, unit="%")


def whole(value: Any) -> Number:
    """Return a count."""
    return number(value, 0)


def six(pose: dict[str, float] | Sequence[float], signed: bool = False) -> tuple[Number, ...]:
    """Return X Y Z (mm) and A B C (deg) as cells."""
    values = [pose[f"{k}_{'mm' if k in 'xyz' else 'deg'}"] for k in AXES] if isinstance(pose, dict) else list(pose)
    return tuple(number(v, 3 if i < 3 else 4, signed) for i, v in enumerate(values))


def limit_of(*values: Array, least: float = 0.02) -> float:
    """Return a round symmetric limit that holds 99 % of all values: 1, 1.5, 2, 3, 5 or 8 times a power of ten."""
    known = np.abs(np.concatenate([v[np.isfinite(v)].ravel() for v in values])) if values else np.zeros(0)
    top = max(float(np.quantile(known, 0.99)) if len(known) else 0.0, least)
    decade = 10.0 ** np.floor(np.log10(top))
    return float(next(k * decade for k in (1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 10.0) if k * decade >= top * 0.999))
