"""What a strategy hands to the raster: the lines of its passes, the triangles they lie on, and where "across" is."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.isolines import Chains
from planner.path.mesh import PathMesh
from planner.path.sampling import sample_equal_area
from planner.surface.curved import CurvedSurface
from planner.surface.normals import lengths
from planner.surface.subdivide import Subdivision

_SAMPLES = 20000


@dataclass(frozen=True, eq=False)
class Cut:
    """mesh: the triangles cut. chains: one or more lines per level, on them. across(face, normals) -> (n, 3): unit tangent
    across the passes, towards higher levels. exact: travel is exactly square to it (plane sections); else it is read
    off the line itself. fine: how the triangles lie in those of the surface, None if they are the same."""

    mesh: PathMesh
    chains: Chains
    across: Callable[[NDArray[np.int32], Array], Array]
    exact: bool
    fine: Subdivision | None = None

    def on_surface(self, face: NDArray[np.int32], bary: Array) -> tuple[NDArray[np.int32], Array]:
        """Return faces and barycentrics on the surface of points on the cut triangles."""
        return (face, bary) if self.fine is None else self.fine.on_parent(face, bary)


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Equal-area samples: face, bary on the triangles sampled; normals (n, 3), shape operators (n, 3, 3) and points (n, 3)
    of the smooth surface."""

    face: NDArray[np.int32]
    bary: Array
    points: Array
    normals: Array
    shape: Array


def surface_samples(curved: CurvedSurface, mesh: PathMesh, fine: Subdivision | None = None) -> SurfaceSamples:
    """Return the samples that the index step is chosen from; `mesh` are the surface's triangles or their pieces."""
    s = sample_equal_area(mesh.areas_mm2, _SAMPLES)
    face, bary = (s.face, s.bary) if fine is None else fine.on_parent(s.face, s.bary)
    points, normals = curved.evaluate(face, bary)
    return SurfaceSamples(s.face, s.bary, points, normals, curved.shape_operator(face, bary))


def tangent(direction: Array, normals: Array) -> Array:
    """Return the unit part of a direction (3,) or (n, 3) square to the normals (n, 3); zero where there is none."""
    d = np.broadcast_to(direction, normals.shape)
    t = d - np.einsum("ij,ij->i", d, normals)[:, None] * normals
    length = lengths(t)[:, None]
    return np.divide(t, length, out=np.zeros_like(t), where=length > 1e-9)


def towards_higher(fine: Subdivision, d: Array) -> Array:
    """Return the direction (f, 3) in which a distance d (v,) grows in each triangle; zero where it is flat."""
    a, b, c = (fine.vertices[fine.faces[:, k]] for k in range(3))
    da, db, dc = (d[fine.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    g = (db - da)[:, None] * np.cross(n, a - c) + (dc - da)[:, None] * np.cross(n, b - a)
    length = np.linalg.norm(g, axis=1, keepdims=True)
    return np.divide(g, length, out=np.zeros_like(g), where=length > 0)
