"""Would the passes be fewer the other way round? On a bent part an array sees less across the bend than along it."""

import numpy as np

from planner.issues import Issue
from planner.path.axes import raster_axes
from planner.path.cut import tangent
from planner.path.sampling import sample_equal_area
from planner.path.swath import effective_half_mm, step_mm
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

_SAMPLES = 4000
# Turning is worth a word from this factor on.
_WORTH = 1.5


def orientation_issues(curved: CurvedSurface, setup: Setup) -> list[Issue]:
    """Return a hint if passes turned by 90 deg would sweep the surface with far less travel.

    Travel is the area over the index step, and the step follows the effective swath of an array that stands across the
    passes. Nothing is said where the step was given.
    """
    if setup.inspection.step_mm is not None or setup.probe.laws == 1:
        return []
    axes = raster_axes(curved, setup)
    s = sample_equal_area(curved.surface.face_areas_mm2, _SAMPLES)
    _, normals = curved.evaluate(s.face, s.bary)
    shape = curved.shape_operator(s.face, s.bary)
    area = curved.surface.area_mm2
    travel = [
        area * float(np.mean(1.0 / step_mm(effective_half_mm(shape, tangent(array, normals), setup), setup)))
        for array in (axes.across, axes.along)
    ]
    if travel[0] < _WORTH * travel[1]:
        return []
    turned = setup.inspection.direction_deg + (90.0 if setup.inspection.direction_deg <= 0.0 else -90.0)
    return [
        Issue(
            "info",
            "array-across-bend",
            f"The array stands across the stronger bend of the surface: the raster takes about {travel[0] / 1000.0:.1f} m of"
            f" passes; turned by 90 deg it would take {travel[1] / 1000.0:.1f} m, with the array along the weaker bend.",
            f"Set inspection.direction_deg to {turned:g}, if the cell allows it.",
            "setup.json: inspection.direction_deg",
        )
    ]
