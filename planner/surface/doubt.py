"""How far the smooth surface may be from the true one: what a coarse tessellation leaves open."""

from dataclasses import dataclass

import numpy as np

from planner.frames import Array
from planner.surface.curved import CurvedSurface
from planner.surface.normals import lengths

# Slivers and single facets at corners have normals of their own: of the faces that cover nearly all of the area, the worst.
COVERED = 0.999
# A slope that is wrong by s at one end of an edge moves the cubic along it by 4/27 of its length times s; the other end and
# the third corner add to that.
LIFT = 0.2


@dataclass(frozen=True, eq=False)
class Doubt:
    """Estimated errors of the smooth surface: face_deg, face_mm (k,) of each face; deg, mm: the largest over nearly all of
    the area."""

    face_deg: Array
    face_mm: Array
    deg: float
    mm: float


def doubt_of(curved: CurvedSurface) -> Doubt:
    """Return how well normals and points of the smooth surface are known.

    Along an edge e between two vertices on an arc the normals lean to either side alike: (n_i + n_j) . e = 0. What is left
    over is the error of one of them, or the curvature changes along the edge, which is then too long for a cubic. Found by
    comparison with spheres, saddles, tori and fillets of known normals: within a factor of two of the largest error
    wherever it matters; up to four times too large where curvature changes quickly but evenly. Noisy meshes, whose
    vertices the surface does not go through, are not judged.
    """
    fit, faces, area = curved.vertex_fit, curved.surface.faces, curved.surface.face_areas_mm2
    face_rad, face_mm = np.zeros(len(faces)), np.zeros(len(faces))
    if not fit.exact:
        return Doubt(face_rad, face_mm, 0.0, 0.0)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = faces[:, i], faces[:, j]
        edge, both = fit.points[b] - fit.points[a], fit.normals[a] + fit.normals[b]
        length = lengths(edge)
        slope = np.abs(np.einsum("ij,ij->i", edge, both)) / np.where(length > 0.0, length, 1.0)
        np.maximum(face_rad, slope, out=face_rad)
        np.maximum(face_mm, LIFT * length * slope, out=face_mm)
    face_deg = np.degrees(face_rad)
    return Doubt(face_deg, face_mm, _worst(face_deg, area), _worst(face_mm, area))


def _worst(values: Array, area: Array) -> float:
    order = np.argsort(values)
    covered = np.cumsum(area[order])
    return float(values[order[min(int(np.searchsorted(covered, COVERED * covered[-1])), len(order) - 1)]])
