"""Residuals of patches against the placed surface, and how they change as the part moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.motion import motion_rows
from alignment.estimate.patches import Patches
from planner.frames import Array, Transform
from planner.surface.curved import CurvedSurface

# A beam this far off the normal meets another surface, or none.
FACING_COS = np.cos(np.radians(45.0))


@dataclass(frozen=True, eq=False)
class Rows:
    """r (n,): residuals, mm (measured minus expected distance). jacobian (n, 6): dr / dxi. valid (n,): on the surface.

    foot_base, normal_base (n, 3): where on the placed surface.
    """

    r: Array
    jacobian: Array
    valid: NDArray[np.bool_]
    foot_base: Array
    normal_base: Array


def distance_rows(
    curved: CurvedSurface,
    T_base_part: Transform,
    centre_mm: Array,
    origins_base: Array,
    distance_mm: Array,
    beams_base: Array | None,
) -> Rows:
    """Return residuals distance - dist(origin, placed surface) of n readings or patches.

    The distance to a surface changes by minus the normal component of the surface's own motion at the foot (the foot's
    sliding is of second order), so dr = n . (v + w x (foot - c)). Feet on the boundary are not surface data, nor are
    feet whose normal does not face the beam.
    """
    foot = curved.closest(T_base_part.inv().points(origins_base))
    normal = T_base_part.directions(foot.normals)
    point = T_base_part.points(foot.points)
    valid = foot.interior.copy()
    if beams_base is not None:
        length = np.linalg.norm(beams_base, axis=1)
        valid &= (np.einsum("ij,ij->i", beams_base, normal) < -FACING_COS * length) | (length == 0)
    return Rows(distance_mm - foot.distance_mm, motion_rows(point, normal, centre_mm), valid, point, normal)


def patch_rows(patches: Patches, curved: CurvedSurface, T_base_part: Transform, centre_mm: Array) -> Rows:
    """Return the residuals of patches; those without a usable reading are not valid."""
    rows = distance_rows(
        curved, T_base_part, centre_mm, patches.origins_base, patches.distance_mm - patches.bend_mm, patches.beams_base
    )
    return Rows(rows.r, rows.jacobian, rows.valid & (patches.count > 0), rows.foot_base, rows.normal_base)
