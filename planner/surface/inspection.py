"""`InspectionSurface`: the triangles of a part that are inspected."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.part import Faces, Part
from planner.surface.topology import compact, weld, weld_tolerance_mm


@dataclass(frozen=True, eq=False)
class InspectionSurface:
    """A connected, outward-facing set of triangles of `part` (frame `part`, mm).

    part_faces (k,) int32: indices into `part.faces`, ascending.
    """

    part: Part
    part_faces: NDArray[np.int32]

    @cached_property
    def _compact(self) -> tuple[Array, Faces]:
        faces = self.part.faces[self.part_faces]
        used, number = compact(faces, len(self.part.vertices))
        return self.part.vertices[used], number[faces].astype(np.int32)

    @cached_property
    def welded(self) -> NDArray[np.int64]:
        """For every vertex (v,) the number of its welded vertex: those that coincide within rounding are one."""
        return weld(self.vertices, weld_tolerance_mm(self.vertices))

    @property
    def vertices(self) -> Array:
        """Vertices used by the surface (v, 3), mm."""
        return self._compact[0]

    @property
    def faces(self) -> Faces:
        """Triangles (k, 3) into `vertices`; row i is `part.faces[part_faces[i]]`."""
        return self._compact[1]

    @cached_property
    def extents_mm(self) -> Array:
        """Size along x, y, z of part (mm)."""
        return np.asarray(np.ptp(np.ascontiguousarray(self.vertices.T), axis=1))

    @property
    def face_normals(self) -> Array:
        """Unit outward normals (k, 3)."""
        return self.part.face_normals[self.part_faces]

    @property
    def face_areas_mm2(self) -> Array:
        """Areas (k,), mm2."""
        return self.part.face_areas_mm2[self.part_faces]

    @cached_property
    def area_mm2(self) -> float:
        """Total area (mm2)."""
        return float(self.face_areas_mm2.sum())

    @cached_property
    def centroid_part(self) -> Array:
        """Area centroid (3,), mm."""
        # Each vertex has a third of the area of the triangles around it.
        area = np.repeat(self.face_areas_mm2, 3)
        weight = np.bincount(self.faces.ravel(), area, len(self.vertices))
        return np.asarray(weight @ self.vertices / (3.0 * self.area_mm2))

    @cached_property
    def mean_normal_part(self) -> Array:
        """Area-weighted mean outward normal (3,), unit length; +Z of `part` for a closed body, which has none."""
        n = self.face_areas_mm2 @ self.face_normals
        length = np.linalg.norm(n)
        return np.asarray(n / length) if length > 1e-6 * self.area_mm2 else np.array([0.0, 0.0, 1.0])
