"""Strategy `plane`: sections by parallel planes, closer together where the surface is steep."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.axes import ScanAxes
from planner.path.cut import Cut, surface_samples, tangent
from planner.path.isolines import isolines
from planner.path.layout import levels, step_field
from planner.path.mesh import PathMesh
from planner.path.swath import effective_half_mm, step_mm
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# Planes are moved together by the slope down to this cosine (75 deg); steeper walls want the other strategy.
_LEAST_COSINE = 0.26


def plane_cut(curved: CurvedSurface, mesh: PathMesh, axes: ScanAxes, setup: Setup) -> Cut:
    """Return sections by planes along the passes.

    The distance between two planes is the step on the surface times the cosine of the slope across them, so that
    the pitch measured on the surface is never larger than asked.
    """
    across = axes.across
    v = mesh.vertices @ across
    used = v[mesh.faces]
    v_range = (float(used.min()), float(used.max()))
    s = surface_samples(curved, mesh)
    cosine = np.sqrt(np.maximum(1.0 - (s.normals @ across) ** 2, _LEAST_COSINE**2))
    half = effective_half_mm(s.shape, tangent(across, s.normals), setup)
    field = step_field(s.points @ across, step_mm(half, setup), half, cosine, v_range)
    exact = setup.inspection.step_mm is not None
    margin = setup.inspection.edge_margin_mm
    at = levels(field, v_range, (margin * field.end_slope[0], margin * field.end_slope[1]), exact=exact)

    def tangent_across(_face: NDArray[np.int32], normals: Array) -> Array:
        return tangent(across, normals)

    return Cut(mesh, isolines(v, mesh.faces, mesh.other, at), tangent_across, exact=True)
