"""Seeds or key points on several faces: what one path cannot follow, and how the scans of these faces work together."""

from planner.issues import Issue
from planner.surface.creases import creases_of
from planner.surface.inspection import InspectionSurface

# Facets of a coarsely tessellated bend turn by less; no probe follows more.
FACETS_DEG = 45.0


def crease_issues(surface: InspectionSurface) -> list[Issue]:
    """Return an error where the surface bends sharply between the faces it was put together from; a warning below 45 deg."""
    found = creases_of(surface)
    if found is None:
        return []
    sharp = found.turn_deg > FACETS_DEG
    text = (
        f"seeds or key points lie on {found.faces} faces that meet at creases of up to {found.turn_deg:.0f} deg "
        f"({found.length_mm:.0f} mm of them): "
    )
    if not sharp:
        text += "the surface between is taken to bend smoothly there."
        remedy = "If these are real edges, plan each face by itself and align their scans together (`echobase align --with`)."
        return [Issue("warning", "surface-creased", text, remedy, "surface")]
    text += "one path cannot follow the surface around an edge."
    remedy = (
        "Plan each face by itself, from seeds and key points on it alone; scan each; then align their scans together "
        "(`echobase align DIR SCAN --with DIR2 SCAN2`, on the page 'Together with'): they determine one correction for all."
    )
    return [Issue("error", "surface-creased", text, remedy, "surface")]
