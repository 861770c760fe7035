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
        n = self._doubled_areas()
        length = np.sqrt(np.einsum("kf,kf->f", n, n))
        return np.ascontiguousarray(np.divide(n, length, out=np.zeros_like(n), where=length > 0).T)

    @cached_property
    def face_areas_mm2(self) -> Array:
        """Areas of the triangles (f,), mm2."""
        n = self._doubled_areas()
        return np.asarray(0.5 * np.sqrt(np.einsum("kf,kf->f", n, n)))

    def _doubled_areas(self) -> Array:
        """Return the cross products of two edges of each triangle (3, f): by coordinate it is three times quicker."""
        a, b, c = (self.vertices.take(corner, axis=0).T for corner in np.ascontiguousarray(self.faces.T))
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])
