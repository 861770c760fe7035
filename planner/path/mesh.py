"""The triangles of a surface as the planner cuts them: welded, with their neighbours and their boundary."""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from planner.frames import Array
from planner.part import Faces
from planner.path.isolines import Ints, neighbours
from planner.surface.inspection import InspectionSurface


@dataclass(frozen=True, eq=False)
class PathMesh:
    """vertices (v, 3), mm, in `part`; faces (f, 3), welded: row i is row i of the inspection surface's faces."""

    vertices: Array
    faces: Faces

    @classmethod
    def of(cls, surface: InspectionSurface) -> "PathMesh":
        """Return the welded triangles of a surface; duplicate vertices of unmerged patches become one.

        Kept as long as the surface lives: every step of planning cuts the same triangles.
        """
        known = _KNOWN.get(surface)
        if known is not None:
            return known
        welded = surface.welded
        vertices = np.zeros((int(welded.max()) + 1, 3))
        vertices[welded] = surface.vertices
        mesh = _KNOWN[surface] = cls(vertices, welded[surface.faces].astype(np.int32))
        return mesh

    @cached_property
    def face_normals(self) -> Array:
        """Unit normals of the triangles (f, 3); zero for a degenerate one."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        n = np.cross(b - a, c - a)
        length = np.linalg.norm(n, axis=1, keepdims=True)
        return np.divide(n, length, out=np.zeros_like(n), where=length > 0)

    @cached_property
    def areas_mm2(self) -> Array:
        """Areas of the triangles (f,), mm2."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @cached_property
    def other(self) -> Ints:
        """Neighbour across each local edge (f, 3), -1 on the boundary."""
        return neighbours(self.faces)

    @cached_property
    def boundary_edges(self) -> Ints:
        """Vertex pairs of the boundary edges (b, 2)."""
        face, edge = np.nonzero(self.other < 0)
        return np.stack([self.faces[face, edge], self.faces[face, (edge + 1) % 3]], axis=1).astype(np.int64)

    def boundary_distance(self, points: Array, within_mm: float) -> Array:
        """Return the distance (n,) of points to the boundary, exact up to `within_mm`, inf beyond it."""
        pairs = self.boundary_edges
        if len(pairs) == 0 or len(points) == 0:
            return np.full(len(points), np.inf)
        tree, edge, spacing = self._boundary_tree(within_mm)
        reach = float(np.hypot(within_mm, spacing))
        _, near = tree.query(points, k=3, distance_upper_bound=reach, workers=2 if len(points) > 2000 else 1)
        near = near.reshape(len(points), -1)
        a, b = self.vertices[pairs[:, 0]], self.vertices[pairs[:, 1]]
        out = np.full(len(points), np.inf)
        for column in near.T:
            hit = np.flatnonzero(column < len(edge))
            e = edge[column[hit]]
            out[hit] = np.minimum(out[hit], _to_segment(points[hit], a[e], b[e]))
        return np.where(out <= within_mm, out, np.inf)

    def _boundary_tree(self, within_mm: float) -> tuple[cKDTree, Ints, float]:
        """Return a tree over the middles of short pieces of the boundary, their edges, and the length of a piece."""
        known = self._trees.get(within_mm)
        if known is not None:
            return known
        pairs = self.boundary_edges
        a, b = self.vertices[pairs[:, 0]], self.vertices[pairs[:, 1]]
        length = np.linalg.norm(b - a, axis=1)
        spacing = max(within_mm / 8.0, float(length.sum()) / 2e5, 1e-6)
        pieces = np.maximum(np.ceil(length / spacing), 1.0).astype(np.int64)
        edge = np.repeat(np.arange(len(pairs)), pieces)
        rank = np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        at = a[edge] + (b - a)[edge] * ((rank + 0.5) / pieces[edge])[:, None]
        made = self._trees[within_mm] = (cKDTree(at, balanced_tree=False), edge, spacing)
        return made

    @cached_property
    def _trees(self) -> dict[float, tuple[cKDTree, Ints, float]]:
        return {}


_KNOWN: WeakKeyDictionary[InspectionSurface, PathMesh] = WeakKeyDictionary()


def _to_segment(p: Array, a: Array, b: Array) -> Array:
    d = b - a
    t = np.einsum("ij,ij->i", p - a, d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)
    return np.asarray(np.linalg.norm(p - a - np.clip(t, 0.0, 1.0)[:, None] * d, axis=1))
