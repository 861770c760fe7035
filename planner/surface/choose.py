"""The inspection surface a setup asks for: flooded from seeds, paint or key points, cut to box and paint."""

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import fail
from planner.frames import Array
from planner.issues import Issue
from planner.memory import PLAN_BYTES, expect_memory
from planner.part import Part
from planner.setup import Setup
from planner.shapes import Brush
from planner.surface.clip import LEFT_OUT, clipped
from planner.surface.curved import footprint_mm
from planner.surface.inspection import InspectionSurface
from planner.surface.select import inspection_surface
from planner.surface.solid import solid_of


def chosen_surface(part: Part, setup: Setup, seeds_part: ArrayLike | None = None) -> InspectionSurface:
    """Return the inspection surface of a part.

    seeds_part (n, 3), mm: clicks and key points to flood from; without any, the dabs of paint; without
    these, the largest smooth region (inside the box, if there is one; ties to the one facing +Z of base). Errors: those
    of `inspection_surface`, `surface-clipped`, and `part-memory` before the machine swaps.
    """
    up_part = setup.T_base_partnom.inv().directions([0.0, 0.0, 1.0])
    given = np.asarray([] if seeds_part is None else seeds_part, dtype=np.float64).reshape(-1, 3)
    inspection = setup.inspection
    seeds = given if len(given) else _dabbed(part, inspection.paint)
    flooded = inspection_surface(part, seeds if len(seeds) else None, up_part, box=inspection.box)
    expect_memory(len(flooded.part_faces), PLAN_BYTES, "Planning on a surface of", "inspection surface")
    return clipped(flooded, inspection, seeds if len(seeds) else None, footprint_mm(setup.probe))


def clip_issues(surface: InspectionSurface) -> list[Issue]:
    """Return a warning if box or paint cut off pieces that are not inspected."""
    areas = surface.part.meta.get(LEFT_OUT)
    if not areas:
        return []
    return [
        Issue(
            "warning",
            "surface-pieces",
            f"Box or paint leave {len(areas) + 1} pieces of the surface; the others, of "
            + ", ".join(f"{a:.0f}" for a in sorted(areas, reverse=True)[:5])
            + " mm2, are not inspected.",
            "Join them with more paint or a larger box, or inspect one piece at a time.",
            "setup.json: inspection",
        )
    ]


def _dabbed(part: Part, paint: tuple[Brush, ...]) -> Array:
    """Return the places of the part nearest to the middles of the dabs that reach it and are not erased again (n, 3)."""
    kept: list[Brush] = []
    for dab in paint:
        if dab.erase:
            kept = [d for d in kept if np.linalg.norm(np.subtract(d.centre_mm, dab.centre_mm)) > dab.radius_mm]
        else:
            kept.append(dab)
    if not kept:
        return np.zeros((0, 3))
    away, _, at = solid_of(part).closest(np.array([d.centre_mm for d in kept]))
    short = away - [d.radius_mm for d in kept]
    if not (short <= 0.0).any():
        raise fail(
            "surface-clipped",
            f"No dab of paint reaches the part: the nearest ends {float(short.min()):.1f} mm from it.",
            "Correct inspection.paint: it is in CAD coordinates and mm.",
            "setup.json: inspection.paint",
        )
    return at[short <= 0.0]
