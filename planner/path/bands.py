"""Narrow probes run several passes side by side through suggested key points, wide enough together to fix a plane."""

import numpy as np

from planner.errors import EchoBaseError
from planner.frames import Array
from planner.path.mesh import PathMesh
from planner.path.section import Stroke, section
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# Width of a band in search radii.
_WIDE_RADII = 1.2
# Strips wanted at least, and how long each should be: search radii, and as a share of the surface's size.
_STRIPS, _LONG_RADII, _LONG_SHARE = 4, 4.0, 0.5
# Suggested strips of a set made without bands (or by hand, named alike) already cover what was asked.
_MOST_OVER = 1.6
# A pass beside that is pushed back this far by the rim lies no longer where it should.
_LEAST_SHIFT = 0.7


def band_passes(curved: CurvedSurface, setup: Setup) -> int:
    """Return how many passes a suggested strip has beside each other, a swath apart.

    One line of readings through a key point fixes no plane, and thin lines would have to be many to cover what is asked.
    Bands are somewhat wider than the search radius, which is plenty for a plane, for wider ones would be too few to tell how
    the whole surface lies; narrower where that would leave less than four strips of a useful length.
    """
    swath, radius = setup.probe.swath_mm, setup.alignment.search_radius_mm
    widest = int(np.ceil(_WIDE_RADII * radius / swath - 1e-9))
    length = setup.alignment.coverage * curved.surface.area_mm2 / swath
    each = max(_LONG_RADII * radius, _LONG_SHARE * float(np.sqrt(curved.surface.area_mm2)))
    return int(np.clip(length / (_STRIPS * each), 1, max(widest, 1)))


def passes_allowed(curved: CurvedSurface, setup: Setup, strips_mm: float) -> int:
    """Return `band_passes`, fewer where strips of this total length (mm) would cover far more than asked."""
    asked = setup.alignment.coverage * curved.surface.area_mm2
    most = int(_MOST_OVER * asked / max(strips_mm * setup.probe.swath_mm, 1e-9))
    return max(min(band_passes(curved, setup), most), 1)


def beside(
    curved: CurvedSurface, mesh: PathMesh, points: Array, normals: Array, count: int, setup: Setup
) -> list[Stroke]:
    """Return the other strokes of a band of `count` passes whose middle runs through points (n, 3); none off the surface.

    Of an even number the middle one is the one before the middle of the band.
    """
    travel = points[-1] - points[0]
    across = np.cross(normals, travel)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    out: list[Stroke] = []
    ends = np.array([0, -1])
    for k in range(count):
        shift = (k - (count - 1) // 2) * setup.probe.swath_mm
        if shift == 0.0:
            continue
        foot = curved.closest(points[ends] + shift * across[ends])
        moved = np.abs(np.einsum("ij,ij->i", foot.points - points[ends], across[ends]))
        if moved.min() < _LEAST_SHIFT * abs(shift):
            continue
        on_mesh = np.einsum("nk,nkj->nj", foot.bary, mesh.vertices[mesh.faces[foot.face]])
        try:
            out += section(mesh, on_mesh, foot.normals)
        except EchoBaseError:
            continue
    return out
