"""`SprungSurface`: the part as it was measured, for whatever asks a surface: checks, expected echoes."""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from alignment.non_rigid.field import Field
from planner.frames import Array
from planner.part import Part
from planner.surface.closest import Foot
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface


class SprungSurface(CurvedSurface):
    """A surface displaced by a field along its normals. Faces and barycentrics are those of the CAD beneath.

    Curvatures are the CAD's: those of a field are smaller by orders. To second order in the slope g the perpendicular
    distance from a height h above the CAD is h - f - h |g|^2 / 2, and its foot lies h g up the slope.
    """

    def __init__(self, cad: CurvedSurface, field: Field) -> None:
        self.cad = cad
        self.field = field
        self.footprint_mm = cad.footprint_mm

    @cached_property
    def surface(self) -> InspectionSurface:  # type: ignore[override]
        """The triangles with displaced vertices; the rest of the part goes along with the nearest place on the surface."""
        nominal = self.cad.surface
        part = nominal.part
        foot = self.cad.closest(part.vertices)
        f, _ = self.field.on(foot.face, foot.bary)
        moved = Part(part.vertices + f[:, None] * foot.normals, part.faces, part.provenance, part.chord_error_mm)
        return InspectionSurface(moved, nominal.part_faces)

    def closest(self, points_part: Array) -> Foot:
        """Return the feet of points (n, 3) on the displaced surface."""
        foot = self.cad.closest(points_part)
        f, g = self.field.on(foot.face, foot.bary)
        slope2 = (g**2).sum(axis=1)
        height = foot.distance_mm
        inside = foot.interior
        distance = np.where(inside, height - f - 0.5 * np.abs(height - f) * slope2, height)
        normals = foot.normals - g
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        points = np.asarray(points_part, dtype=np.float64).reshape(-1, 3) - distance[:, None] * normals
        return replace(foot, points=points, normals=normals, distance_mm=distance)

    def evaluate(self, face: NDArray, bary: Array) -> tuple[Array, Array]:
        """Return displaced points (n, 3) and unit normals (n, 3)."""
        points, normals = self.cad.evaluate(face, bary)
        f, g = self.field.on(face, bary)
        turned = normals - g
        return points + f[:, None] * normals, turned / np.linalg.norm(turned, axis=1, keepdims=True)

    def normals(self, face: NDArray, bary: Array) -> Array:
        """Return unit normals (n, 3)."""
        return self.evaluate(face, bary)[1]

    def shape_operator(self, face: NDArray, bary: Array) -> Array:
        """Return the CAD's (n, 3, 3)."""
        return self.cad.shape_operator(face, bary)
