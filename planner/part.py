"""`Part`: the CAD as triangles in mm, with where it came from."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

Faces = NDArray[np.int32]


@dataclass(frozen=True)
class Provenance:
    """Where a part came from: file name (data, never a path to open), SHA-256 of its bytes, unit decision."""

    name: str
    sha256: str
    unit: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Part:
    """A triangulated part in CAD coordinates (frame `part`), mm, with merged vertices.

    vertices (v, 3) float64; faces (f, 3) int32, counter-clockwise seen from outside. `chord_error_mm` is the estimated
    largest distance of the triangles from the true surface (NaN where unknown): a floor under every accuracy.
    """

    vertices: Array
    faces: Faces
    provenance: Provenance
    chord_error_mm: float = float("nan")
    meta: dict[str, Any] = field(default_factory=dict)

    @property
    def extents_mm(self) -> Array:
        """Size along x, y, z (mm)."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    @cached_property
    def face_normals(self) -> Array:
        """Unit normals of the triangles (f, 3); zero for a degenerate one."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        n = np.cross(b - a, c - a)
        length = np.linalg.norm(n, axis=1, keepdims=True)
        return np.divide(n, length, out=np.zeros_like(n), where=length > 0)

    @cached_property
    def face_areas_mm2(self) -> Array:
        """Areas of the triangles (f,), mm2."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
