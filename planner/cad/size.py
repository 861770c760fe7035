"""The unit and the size of a part: never guessed, always shown, refused where they cannot be right."""

import numpy as np

from planner.cad.formats import WITH_UNIT, WORDS, Format
from planner.errors import EchoBaseError, fail
from planner.frames import Array
from planner.units import LENGTH_UNITS, MM_PER

SMALLEST_MM, LARGEST_MM = 5.0, 30_000.0
FARTHEST_MM = 50_000.0


def expect_unit(kind: Format, unit: str | None, file_unit: str | None, extents: Array, name: str) -> str:
    """Return the unit of the file's numbers; `extents` (3,) are in these numbers. STEP and GLB bring theirs.

    Raises EchoBaseError: `unit-unknown`, `unit-missing` (with the size in each unit), `unit-contradicts`.
    """
    if unit is not None and unit not in MM_PER:
        raise fail(
            "unit-unknown", f"'{unit}' is not a unit of length here.", f"Use one of {', '.join(LENGTH_UNITS)}.", name
        )
    if kind in WITH_UNIT:
        own = "m" if kind == "glb" else file_unit
        if unit is not None and own is not None and unit != own:
            raise fail(
                "unit-contradicts",
                f"The unit given is {unit}, but the {WORDS[kind]} file itself says {own}.",
                f"Leave the unit out, or give {own}; if the file is wrong, export it again.",
                name,
            )
        return own or "mm"
    if unit is None:
        raise fail(
            "unit-missing",
            f"{WORDS[kind]} files carry no unit. The part would measure {sizes(extents)}.",
            f"Say which it is: {', '.join(LENGTH_UNITS)}.",
            name,
        )
    return unit


def sizes(extents: Array) -> str:
    """Return the size (3,), in the file's numbers, read in each unit, in words."""
    return "; ".join(f"{_size(extents * MM_PER[u])} if in {u}" for u in LENGTH_UNITS)


def expect_size(low_mm: Array, high_mm: Array, unit: str, kind: Format, name: str) -> None:
    """Raise EchoBaseError `part-size` unless the largest extent is 5 mm to 30 m, `part-far` if it lies over 50 m away."""
    extents = high_mm - low_mm
    largest = float(extents.max())
    if not SMALLEST_MM <= largest <= LARGEST_MM:
        raise _wrong_size(extents, unit, kind, name)
    far = float(max(np.abs(low_mm).max(), np.abs(high_mm).max()))
    if far > FARTHEST_MM:
        raise fail(
            "part-far",
            f"The part lies up to {far / 1000.0:.0f} m from its origin.",
            "Move it near the origin in the CAD system, so that rounding does not blur it.",
            name,
        )


def _wrong_size(extents: Array, unit: str, kind: Format, name: str) -> EchoBaseError:
    numbers = extents / MM_PER[unit]
    sane = [u for u in LENGTH_UNITS if SMALLEST_MM <= float((numbers * MM_PER[u]).max()) <= LARGEST_MM]
    likely = [u for u in sane if u in ("mm", "m")] or sane
    factor = MM_PER[likely[0]] / MM_PER[unit] if likely else 1.0
    hint = ""
    if likely:
        wrong = factor if factor > 1 else 1.0 / factor
        hint = f" The unit is probably wrong by {wrong:g}: in {likely[0]} it would be {_size(numbers * MM_PER[likely[0]])}."
    remedy = f"Give {' or '.join(sane)}." if likely else "Check the unit and the export."
    if kind in WITH_UNIT:
        remedy = "Export it again with the right unit, or as STL and say the unit."
    return fail(
        "part-size",
        f"In {unit} the part measures {_size(extents)}, outside 5 mm to 30 m.{hint}",
        remedy,
        name,
    )


def _size(extents_mm: Array) -> str:
    if extents_mm.max() >= 10_000.0:
        return " x ".join(f"{v / 1000.0:.4g}" for v in extents_mm) + " m"
    return " x ".join(f"{v:.4g}" for v in extents_mm) + " mm"
