"""How triangles hang together: welded vertices, edges, neighbours. Pure functions over index arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from planner.frames import Array

Index = NDArray[np.int64]
_ASKEW = np.array([1.0, np.sqrt(2.0), np.pi]) / np.sqrt(3.0 + np.pi**2)


@dataclass(frozen=True, eq=False)
class Edges:
    """The undirected edges of a triangle mesh.

    vertices (e, 2): the two ends, ascending. of_face (f, 3): the edge opposite corner k, that is from corner k+1 to k+2.
    forward (f, 3): True where the face walks the edge from its lower to its higher vertex. uses (e,): faces at the edge.
    first, second (e,): two of these faces (-1: none). An edge with one face is a boundary; with three it is non-manifold.
    """

    vertices: Index
    of_face: Index
    forward: NDArray[np.bool_]
    uses: Index
    first: Index
    second: Index

    @property
    def is_boundary(self) -> NDArray[np.bool_]:
        """Edges with a single face (e,)."""
        return self.uses == 1


def edges_of(faces: Index) -> Edges:
    """Return the edges of faces (f, 3)."""
    f = np.asarray(faces, dtype=np.int64)
    start, end = f[:, [1, 2, 0]].ravel(), f[:, [2, 0, 1]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    span = int(f.max(initial=0)) + 1
    key = low * span + high
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]]) if len(ordered) else np.zeros(0, dtype=np.int64)
    uses = np.diff(np.r_[starts, len(ordered)])
    edge_of = np.zeros(len(key), dtype=np.int64)
    edge_of[order] = np.repeat(np.arange(len(starts)), uses)
    one = order[starts]
    first = one // 3
    second = np.where(uses > 1, order[np.minimum(starts + 1, max(len(order) - 1, 0))] // 3, -1)
    return Edges(
        np.stack([low.take(one), high.take(one)], axis=1),
        edge_of.reshape(-1, 3),
        (start == low).reshape(-1, 3),
        uses,
        first,
        second,
    )


def compact(faces: NDArray[np.integer], count: int) -> tuple[Index, Index]:
    """Return which of `count` vertices faces (f, 3) use (u,), ascending, and the number among these of every vertex."""
    mark = np.zeros(count, dtype=bool)
    mark[faces.ravel()] = True
    return np.flatnonzero(mark), np.cumsum(mark) - 1


def weld(vertices: Array, tolerance_mm: float) -> Index:
    """Return for every vertex (v, 3) the number of its welded vertex (v,): those nearer than the tolerance are one."""
    n = len(vertices)
    # Neighbours within the tolerance are so along any direction too; one that no grid lies square to leaves few to look at.
    along = vertices @ _ASKEW
    order = np.argsort(along)
    close = np.diff(along[order]) <= tolerance_mm
    some = np.sort(order[np.r_[close, False] | np.r_[False, close]])
    if not len(some):
        return np.arange(n)
    pairs = some[cKDTree(vertices[some]).query_pairs(tolerance_mm, output_type="ndarray")]
    if not len(pairs):
        return np.arange(n)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def weld_tolerance_mm(vertices: Array) -> float:
    """Return the distance below which two vertices are the same point: float32 rounding at the size of the part, mm."""
    return float(max(1e-5, 4e-7 * np.abs(vertices).max(initial=0.0)))


def vertex_graph(vertex_count: int, edge_vertices: Index) -> csr_array:
    """Return the symmetric adjacency (v, v) of vertices joined by an edge (e, 2); no diagonal."""
    a, b = edge_vertices[:, 0], edge_vertices[:, 1]
    ones = np.ones(2 * len(a), dtype=np.int8)
    graph = coo_array((ones, (np.r_[a, b], np.r_[b, a])), shape=(vertex_count, vertex_count)).tocsr()
    graph.data[:] = 1
    return graph
