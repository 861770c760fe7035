"""Lines of equal value on a triangle mesh, as ordered chains: the one cutter behind plane sections and geodesic lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from planner.frames import Array
from planner.part import Faces

Ints = NDArray[np.int64]

# Local edges of a triangle: 0 = (v0, v1), 1 = (v1, v2), 2 = (v2, v0). Row = bits of "vertex is at or above the level";
# walking in by the first edge and out by the second keeps the higher values on the left.
_IN_OUT = np.array([[0, 0], [0, 2], [1, 0], [1, 2], [2, 1], [0, 1], [2, 0], [0, 0]], dtype=np.int8)


@dataclass(frozen=True, eq=False)
class Chains:
    """Segments of all chains in walking order; values higher than the level lie on the left.

    face (m,): row of the triangle the segment lies in. bary_in, bary_out (m, 3): its ends. chain (m,): number of its
    chain, ascending, chains sorted by level. level (c,): index of the level of each chain. closed (c,): True for loops.
    """

    face: Ints
    bary_in: Array
    bary_out: Array
    chain: Ints
    level: Ints
    closed: NDArray[np.bool_]


def neighbours(faces: Faces) -> Ints:
    """Return for each triangle edge (f, 3) the triangle on its other side, -1 on a boundary.

    Edges with more than two triangles, or with two of opposite orientation, count as boundaries: no walk may cross them.
    """
    twin = twins(faces)
    return np.where(twin >= 0, twin // 3, -1)


def twins(faces: Faces) -> Ints:
    """Return for each triangle edge (f, 3) the same edge of the triangle on its other side, as 3 face + edge; -1: boundary."""
    f = faces.astype(np.int64)
    start, end = f.ravel(), np.roll(f, -1, axis=1).ravel()
    n = int(f.max(initial=0)) + 1
    key = np.minimum(start, end) * n + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    k = key[order]
    same = k[1:] == k[:-1]
    first = np.concatenate([[True], ~same])
    size = np.diff(np.append(np.flatnonzero(first), len(k)))
    head = np.flatnonzero(first)[size == 2]
    a, b = order[head], order[head + 1]
    good = start[a] == end[b]
    a, b = a[good], b[good]
    other = np.full(len(key), -1, dtype=np.int64)
    other[a], other[b] = b, a
    return other.reshape(-1, 3)


def isolines(values: Array, faces: Faces, other: Ints, levels: Array) -> Chains:
    """Cut a mesh by the levels (ascending) of a function given at its vertices (v,), linear inside triangles.

    A vertex exactly on a level counts as above it, so every cut triangle has one way in and one way out: no special
    cases, no lost pieces. `other` is `neighbours(faces)`. Each triangle knows its interval of levels; cost is linear in
    triangles plus segments.
    """
    v0, v1, v2 = (values[column] for column in np.ascontiguousarray(faces.T))
    first = np.searchsorted(levels, np.minimum(np.minimum(v0, v1), v2), side="right")
    count = np.searchsorted(levels, np.maximum(np.maximum(v0, v1), v2), side="right") - first
    offset = np.concatenate([[0], np.cumsum(count)])
    tri = np.repeat(np.arange(len(faces)), count)
    level = np.arange(len(tri)) - offset[tri] + first[tri]
    lv = levels[level]
    vt = np.stack([v0[tri], v1[tri], v2[tri]], axis=1)
    bits = (vt[:, 0] >= lv) + 2 * (vt[:, 1] >= lv) + 4 * (vt[:, 2] >= lv)
    way = _IN_OUT[bits]
    following = _following(tri, level, way, first, count, offset, other)
    order, chain, closed = _walk(following, level)
    tri, way, vt, lv = tri[order], way[order], vt[order], lv[order]
    heads = np.flatnonzero(np.concatenate([[True], np.diff(chain) > 0])) if len(chain) else np.zeros(0, dtype=np.int64)
    return Chains(
        face=tri,
        bary_in=_crossing(vt, lv, way[:, 0]),
        bary_out=_crossing(vt, lv, way[:, 1]),
        chain=chain,
        level=level[order][heads],
        closed=closed,
    )


def _following(
    tri: Ints, level: Ints, way: NDArray[np.int8], first: Ints, count: Ints, offset: Ints, other: Ints
) -> Ints:
    """Return for each segment the one it continues in, -1 at the end of a chain; every segment is continued once."""
    to = other[tri, way[:, 1]]
    rank = level - first[to]
    has = (to >= 0) & (rank >= 0) & (rank < count[to])
    return np.where(has, offset[to] + rank, -1)


def _crossing(v: Array, level: Array, edge: NDArray[np.int8]) -> Array:
    """Return barycentric coordinates (m, 3) of the level on the local edge of each triangle."""
    row = np.arange(len(v))
    i, j = edge.astype(np.int64), (edge.astype(np.int64) + 1) % 3
    a, b = v[row, i], v[row, j]
    t = (level - a) / (b - a)
    bary = np.zeros((len(v), 3))
    bary[row, i], bary[row, j] = 1.0 - t, t
    return bary


def _walk(following: Ints, level: Ints) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Order segments along their chains: (order, chain of each ordered segment, closed per chain).

    All chains are strung into one long path, end to start, which one breadth-first search then lists in order.
    """
    m = len(following)
    if m == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
    link = following.copy()
    has = link >= 0
    graph = csr_array((has[has].astype(np.int8), (np.flatnonzero(has), link[has])), shape=(m, m))
    count, label = connected_components(graph, directed=False)
    entered = np.zeros(m, dtype=bool)
    entered[link[has]] = True
    start = np.full(count, -1, dtype=np.int64)
    end = np.full(count, -1, dtype=np.int64)
    head, tail = np.flatnonzero(~entered), np.flatnonzero(~has)
    start[label[head]], end[label[tail]] = head, tail
    closed = start < 0
    if closed.any():
        smallest = np.full(count, m, dtype=np.int64)
        np.minimum.at(smallest, label, np.arange(m))
        start[closed] = smallest[closed]
        before = np.full(m, -1, dtype=np.int64)
        before[link[has]] = np.flatnonzero(has)
        end[closed] = before[start[closed]]
    rank = np.lexsort((start, level[start]))
    link[end[rank[:-1]]] = start[rank[1:]]
    link[end[rank[-1]]] = -1
    inside = link >= 0
    path = csr_array(
        (np.ones(int(inside.sum()), dtype=np.int8), link[inside], np.concatenate([[0], np.cumsum(inside)])),
        shape=(m, m),
    )
    order = breadth_first_order(path, int(start[rank[0]]), directed=True, return_predecessors=False).astype(np.int64)
    number = np.zeros(count, dtype=np.int64)
    number[rank] = np.arange(count)
    return order, number[label[order]], closed[rank]
