"""Edits of the inspection surface and its regions that clicks make: pure, settings in, settings out."""

from collections.abc import Callable

from planner.errors import fail
from planner.frames import Array
from planner.setup import Inspection
from planner.shapes import Brush, DiscKeepOut, KeepOut
from planner.strict import Xyz

MOST_DABS = 500
MOST_REGIONS = 500
MOST_GUIDE = 200


def dabbed(old: Inspection, where_mm: Array, radius_mm: float, erase: bool) -> Inspection:
    """Return the settings with one more dab of the brush at a place (3,), part, mm."""
    if len(old.paint) >= MOST_DABS:
        raise fail("paint-full", f"There are {MOST_DABS} dabs already.", "Use a larger brush, or clear the paint.")
    dab = Brush(centre_mm=_xyz(where_mm), radius_mm=radius_mm, erase=erase)
    return old.model_copy(update={"paint": (*old.paint, dab)})


def kept_out(old: Inspection, where_mm: Array, radius_mm: float, may_cross: bool) -> Inspection:
    """Return the settings with a disc of this radius kept out; its name is the first free one."""
    if len(old.keep_outs) >= MOST_REGIONS:
        raise fail("keep-outs-full", f"There are {MOST_REGIONS} keep-out regions already.", "Delete some first.")
    stem = "fastener" if may_cross else "clamp"
    used = {k.name for k in old.keep_outs}
    name = next(n for i in range(1, MOST_REGIONS + 2) if (n := f"{stem} {i}") not in used)
    disc: KeepOut = DiscKeepOut(
        type="disc", name=name, centre_mm=_xyz(where_mm), radius_mm=radius_mm, may_cross=may_cross
    )
    return old.model_copy(update={"keep_outs": (*old.keep_outs, disc)})


def drawn(old: Inspection, where_mm: Array) -> Inspection:
    """Return the settings with the guide line led on to a place; passes follow it from its second point on."""
    if len(old.guide) >= MOST_GUIDE:
        raise fail("guide-full", f"The line has {MOST_GUIDE} points already.", "Clear it and draw fewer.")
    guide = (*old.guide, _xyz(where_mm))
    return old.model_copy(update={"guide": guide, "direction": "drawn" if len(guide) > 1 else old.direction})


INSPECTION_EDITS: dict[str, Callable[[Inspection, Array, float, bool], Inspection]] = {
    "paint": lambda old, at, radius, _: dabbed(old, at, radius, erase=False),
    "erase": lambda old, at, radius, _: dabbed(old, at, radius, erase=True),
    "keepout": kept_out,
    "guide": lambda old, at, _radius, _cross: drawn(old, at),
}
"""What a click means in each tool of step Surface: settings, place, radius, may_cross -> settings."""


def _xyz(where_mm: Array) -> Xyz:
    x, y, z = (round(float(v), 3) for v in where_mm)
    return x, y, z
