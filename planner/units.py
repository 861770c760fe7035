"""Units at the edges. Inside: mm, radians, seconds, float64."""

from typing import Literal, get_args

LengthUnit = Literal["mm", "cm", "m", "inch"]
LENGTH_UNITS: tuple[str, ...] = get_args(LengthUnit)
MM_PER: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}


def mm_per(unit: str) -> float:
    """Return the number of mm in one `unit`; raise ValueError for an unknown one."""
    if unit not in MM_PER:
        raise ValueError(f"unknown length unit '{unit}'; one of {', '.join(LENGTH_UNITS)}")
    return MM_PER[unit]
