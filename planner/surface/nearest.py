"""The triangle nearest to a point, exactly: from a k-d tree of the vertices where triangles are fine, from an AABB tree else.

A tree over the boxes of 300 000 triangles takes longer to build than an alignment may; one over their corners does not.
Exact all the same: let x be the point of triangle T nearest to the query q, at a distance d. Inside T, and along its edges
towards their ends, q - x is square to T. So a corner v of T has |q - v|^2 <= d^2 + rho^2, where rho, at most 1/sqrt(3) of the
longest edge, is how far a point of a triangle can be from its nearest corner. With any distance d already found, the
triangles around the vertices within sqrt(d^2 + rho^2) hold the nearest one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from planner.frames import Array

# Meshes of fewer triangles have their AABB tree at once; so many queries are worth one in any case.
FINE_FACES = 30_000
MANY_QUERIES = 20_000
# Triangles with an edge so many times longer than usual go into an AABB tree of their own.
LONG_EDGE = 3.0
NEIGHBOURS = 12
Columns = Sequence[Array]


@dataclass(frozen=True, eq=False)
class Nearest:
    """For n queries: face (n,) int32, its barycentrics (n, 3) of the nearest point, and margin_mm (n,).

    A query that moves by less than `margin_mm` still has its nearest point on a triangle around `around` (n, k), vertices.
    """

    face: NDArray[np.int32]
    bary: Array
    margin_mm: Array
    around: NDArray[np.int64]


class Triangles:
    """vertices (v, 3), mm, and faces (f, 3), ready to be asked for the triangle nearest to a point."""

    def __init__(
        self,
        vertices: Array,
        faces: NDArray[np.int64],
        fine_faces: int = FINE_FACES,
        boxes: Callable[[], igl.AABB] | None = None,
    ) -> None:
        """boxes: gives a tree over the same triangles that somebody else needs as well."""
        self.vertices, self.faces, self._elsewhere = vertices, faces, boxes
        self.is_fine = len(faces) >= fine_faces

    def nearest(self, query: Array) -> Nearest:
        """Return the nearest triangles of points (n, 3)."""
        if not self.is_fine or len(query) > MANY_QUERIES:
            face, at = self._by_boxes(query)
            none = np.zeros((len(query), 0), dtype=np.int64)
            return Nearest(face.astype(np.int32), self._clipped(face, at), np.zeros(len(query)), none)
        apart, around = self._corners.query(query, NEIGHBOURS)
        apart2 = apart**2
        rows = np.arange(len(query))
        face, at, d2 = self._best_around(query, rows, around[:, 0])
        rho2 = self._rho_mm**2
        # With the first distance known, only so many more vertices can have a nearer triangle around them.
        row, k = np.nonzero(apart2[:, 1:] <= (d2 + rho2)[:, None])
        face, at, d2 = _nearer((face, at, d2), rows, self._best_around(query, row, around[row, k + 1]), row)
        long_mm = np.full(len(query), np.inf)
        if len(self._long):
            long2, chosen, on = self._long_boxes.squared_distance(self.vertices, self.faces[self._long], query)
            long_mm = np.sqrt(long2)
            face, at, d2 = _nearer((face, at, d2), rows, (self._long[chosen], on, long2), rows)
        left = np.flatnonzero(apart2[:, -1] <= d2 + rho2)
        if len(left):
            face[left], at[left] = self._by_boxes(query[left])
        d = np.sqrt(d2)
        margin = (apart2[:, -1] - d2 - rho2) / (2.0 * (apart[:, -1] + d))
        margin = np.minimum(margin, 0.5 * (long_mm - d))
        margin[left] = 0.0
        return Nearest(face.astype(np.int32), self._clipped(face, at), np.maximum(margin, 0.0), around)

    def about(self, query: Array) -> Nearest:
        """Return the nearest of the triangles around the nearest vertex: mostly the nearest, for searches that go on."""
        if not self.is_fine or len(query) > MANY_QUERIES:
            return self.nearest(query)
        around = self._corners.query(query, 1)[1]
        face, at, _ = self._best_around(query, np.arange(len(query)), around)
        return Nearest(face.astype(np.int32), self._clipped(face, at), np.zeros(len(query)), around[:, None])

    def barycentric(self, face: NDArray, at: Array) -> Array:
        """Return barycentrics (n, 3) of points over the planes of faces; negative outside of the triangle."""
        bary = self.barycentric_step(face, at - self.vertices[self.faces[face, 0]])
        bary[:, 0] += 1.0
        return bary

    def barycentric_step(self, face: NDArray, step: Array) -> Array:
        """Return how barycentrics (n, 3) change with steps (n, 3) along the planes of faces."""
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        u, v, w = b - a, c - a, step
        uu, uv, vv, wu, wv = (np.einsum("ij,ij->i", p, q) for p, q in ((u, u), (u, v), (v, v), (w, u), (w, v)))
        det = uu * vv - uv * uv
        det = np.where(det > 0, det, 1.0)
        bary = np.stack([np.zeros_like(det), (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det], axis=1)
        bary[:, 0] = -bary[:, 1] - bary[:, 2]
        return bary

    def _clipped(self, face: NDArray, at: Array) -> Array:
        bary = np.clip(self.barycentric(face, at), 0.0, 1.0)
        return bary / bary.sum(axis=1, keepdims=True)

    def _by_boxes(self, query: Array) -> tuple[NDArray[np.int64], Array]:
        _, face, at = self._boxes.squared_distance(self.vertices, self.faces, query)
        return face.astype(np.int64), at

    def _best_around(self, query: Array, row: NDArray, vertex: NDArray) -> tuple[NDArray[np.int64], Array, Array]:
        """Return per pair of query and vertex the nearest face around it, the nearest point, its distance squared."""
        start, faces = self._fans
        count = start[vertex + 1] - start[vertex]
        pair = np.repeat(np.arange(len(row)), count)
        first = np.cumsum(count) - count
        face = faces[np.arange(len(pair)) - first[pair] + start[vertex][pair]]
        x, y, z = self._columns
        corners = [(x[at], y[at], z[at]) for at in (corner[face] for corner in self._corner_columns)]
        of = row[pair]
        at, d2 = _onto((corners[0], corners[1], corners[2]), [np.ascontiguousarray(q)[of] for q in query.T])
        best, chosen = np.full(len(row), np.inf), np.zeros(len(row), dtype=np.int64)
        some = count > 0
        best[some] = np.minimum.reduceat(d2, first[some]) if len(d2) else np.inf
        hit = np.flatnonzero(d2 == best[pair])[::-1]
        chosen[pair[hit]] = hit
        if not len(face):
            return np.zeros(len(row), dtype=np.int64), np.zeros((len(row), 3)), best
        return face[chosen], at[chosen], best

    @cached_property
    def _boxes(self) -> igl.AABB:
        if self._elsewhere is not None:
            return self._elsewhere()
        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        return tree

    @cached_property
    def _corners(self) -> cKDTree:
        return cKDTree(self.vertices, balanced_tree=False, compact_nodes=False)

    @cached_property
    def _columns(self) -> Array:
        """Coordinates of the vertices (3, v): by coordinate everything is several times quicker than by point."""
        return np.ascontiguousarray(self.vertices.T)

    @cached_property
    def _corner_columns(self) -> NDArray[np.int64]:
        return np.ascontiguousarray(self.faces.T)

    @cached_property
    def _longest_mm(self) -> Array:
        a, b, c = self._corner_columns
        longest = np.zeros(len(self.faces))
        for p, q in ((a, b), (b, c), (c, a)):
            step2 = np.zeros(len(p))
            for x in self._columns:
                step = x.take(p) - x.take(q)
                step2 += np.multiply(step, step, out=step)
            np.maximum(longest, step2, out=longest)
        return np.sqrt(longest)

    @cached_property
    def _usual_mm(self) -> float:
        return float(np.median(self._longest_mm))

    @cached_property
    def _long(self) -> NDArray[np.int64]:
        """Faces that are much longer than usual."""
        return np.flatnonzero(self._longest_mm > LONG_EDGE * self._usual_mm)

    @cached_property
    def _long_boxes(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self.vertices, self.faces[self._long])
        return tree

    @cached_property
    def _rho_mm(self) -> float:
        """How far a point of a triangle that is not long can be from its nearest corner."""
        return min(LONG_EDGE * self._usual_mm, float(self._longest_mm.max())) / np.sqrt(3.0) * (1.0 + 1e-9)

    @cached_property
    def _fans(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Faces around vertices: start (v + 1,) of each vertex's in a list of faces."""
        f, v = len(self.faces), len(self.vertices)
        corner = csr_array(
            (np.ones(3 * f, dtype=np.int8), self.faces.ravel(), np.arange(0, 3 * f + 1, 3)), shape=(f, v)
        ).tocsc()
        return corner.indptr.astype(np.int64), corner.indices.astype(np.int64)


def _nearer(
    known: tuple[NDArray, Array, Array], rows: NDArray, found: tuple[NDArray, Array, Array], row: NDArray
) -> tuple[NDArray, Array, Array]:
    """Return the nearer of what is known of each row and of what was found for some rows (perhaps several of one)."""
    face, at, d2 = (v.copy() for v in known)
    np.minimum.at(d2, row, found[2])
    won = np.flatnonzero((found[2] == d2[row]) & (found[2] < known[2][row]))[::-1]
    face[row[won]], at[row[won]] = found[0][won], found[1][won]
    return face, at, d2


def _onto(corners: tuple[Columns, Columns, Columns], query: Columns) -> tuple[Array, Array]:
    """Return the points of triangles nearest to queries (3, m), and their distances squared (m,); all by coordinate.

    Over the triangle the foot on its plane, beside it the nearest of the three edges' nearest points.
    """
    d2 = np.full(len(query[0]), np.inf)
    at = np.zeros((3, len(d2)))
    for k in range(3):
        p, q = corners[k], corners[(k + 1) % 3]
        along = [q[i] - p[i] for i in range(3)]
        length2 = _dot(along, along)
        t = _dot([query[i] - p[i] for i in range(3)], along) / np.where(length2 > 0, length2, 1.0)
        np.clip(t, 0.0, 1.0, out=t)
        on = [p[i] + t * along[i] for i in range(3)]
        step = [query[i] - on[i] for i in range(3)]
        edge2 = _dot(step, step)
        better = edge2 < d2
        np.copyto(d2, edge2, where=better)
        for i in range(3):
            np.copyto(at[i], on[i], where=better)
    a, b, c = corners
    u, v, w = ([x[i] - a[i] for i in range(3)] for x in (b, c, query))
    uu, uv, vv, wu, wv = _dot(u, u), _dot(u, v), _dot(v, v), _dot(w, u), _dot(w, v)
    det = uu * vv - uv * uv
    s, t = vv * wu - uv * wv, uu * wv - uv * wu
    inside = np.flatnonzero((s > 0) & (t > 0) & (s + t < det))
    s, t = s[inside] / det[inside], t[inside] / det[inside]
    over = [a[i][inside] + s * u[i][inside] + t * v[i][inside] for i in range(3)]
    step = [query[i][inside] - over[i] for i in range(3)]
    d2[inside] = _dot(step, step)
    for i in range(3):
        at[i][inside] = over[i]
    return at.T, d2


def _dot(p: Sequence[Array], q: Sequence[Array]) -> Array:
    return np.asarray(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])
