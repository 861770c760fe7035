"""Edges of a part that sprang back: where its shape tilts, the foot under a crossing is another than on the CAD.

A surface that deviates by d along the normal n has the normal n - grad d, so from the height h the foot lies h grad d farther
along the surface: 0.3 mm per degree at 15 mm, opposite at opposite ends of a twist, which would pass for a turn of the part.
"""

import numpy as np
from scipy.spatial import cKDTree

from alignment.estimate.edge_rows import EdgeRows
from alignment.estimate.surface_rows import Rows
from planner.frames import Array

# The slope is fitted to so many patches around a crossing, the nearer ones counting more (mm, one sigma).
NEIGHBOURS, NEAR_MM = 16, 25.0
# What a patch knows of the shape (mm), and how far it may tilt (one sigma).
PATCH_MM, SLOPE = 0.05, 0.05


def foot_shift_mm(rows: Rows, found: EdgeRows) -> Array:
    """Return how far the feet of crossings (k,) lie outward of those on the CAD, mm, by the slope of the patches' residuals.

    rows: of all patches, at the placement of `found`; their residuals are minus the deviation from CAD.
    """
    use = np.flatnonzero(rows.valid)
    if len(use) < NEIGHBOURS:
        return np.zeros(len(found.r))
    foot = rows.foot_base[use]
    distance, near = cKDTree(foot).query(found.point_base, k=NEIGHBOURS)
    across = found.jacobian[:, 3:]
    along = np.cross(rows.normal_base[use[near[:, 0]]], across)
    step = foot[near] - found.point_base[:, None, :]
    u, v = np.einsum("knj,kj->kn", step, across), np.einsum("knj,kj->kn", step, along)
    x = np.stack([np.ones_like(u), u, v], axis=-1)
    weight = np.exp(-0.5 * (distance / NEAR_MM) ** 2) / PATCH_MM**2
    normal = np.einsum("kni,kn,knj->kij", x, weight, x) + np.diag([1e-6, SLOPE**-2, SLOPE**-2])
    pull = np.einsum("kni,kn,kn->ki", x, weight, -rows.r[use[near]])
    slope = np.linalg.solve(normal, pull[..., None])[:, 1, 0]
    return np.asarray(found.height_mm * slope)
