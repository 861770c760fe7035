"""From a soup of triangles to a part: welded, without degenerate or double triangles, wound alike and outward."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from planner.frames import Array
from planner.part import Faces
from planner.surface.topology import Edges, edges_of, weld, weld_tolerance_mm


@dataclass
class Cleaned:
    """vertices (v, 3) mm, faces (f, 3), and what was done to get there, in sentences."""

    vertices: Array
    faces: Faces
    notes: list[str] = field(default_factory=list)
    bodies: int = 1
    closed_bodies: int = 0


def clean(vertices: Array, faces: NDArray[np.int64]) -> Cleaned:
    """Return welded, consistently wound triangles of vertices (v, 3), mm, and faces (f, 3)."""
    notes: list[str] = []
    vertices, faces = _weld(vertices, faces)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    if not whole.all():
        notes.append(f"{int((~whole).sum())} triangles without area were dropped.")
        faces = faces[whole]
    faces = _without_doubles(faces, notes)
    used, compact = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], compact.reshape(-1, 3)
    return _wind(vertices, faces, notes)


def unique_rows(rows: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return `(first, inverse)` of the distinct rows of (n, 3) 8-byte numbers, in order of first appearance.

    Rows are told apart by a 64-bit hash, an order of magnitude faster than sorting them; a collision is looked for and
    settled by sorting.
    """
    bits = np.ascontiguousarray(rows + 0).view(np.uint64).reshape(-1, 3)
    key = np.zeros(len(bits), dtype=np.uint64)
    for column, factor in zip(bits.T, (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9), strict=True):
        key = (key ^ column) * np.uint64(factor)
        key ^= key >> np.uint64(29)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    if (bits[first[inverse]] != bits).any():
        _, first, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.zeros(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.reshape(-1)]


def _weld(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    first, inverse = unique_rows(vertices + 0.0)  # -0.0 and 0.0 are one place
    exact = vertices[first]
    label = weld(exact, weld_tolerance_mm(exact))
    welded = np.zeros((int(label.max(initial=-1)) + 1, 3))
    welded[label[::-1]] = exact[::-1]
    return welded, label[inverse[faces]]


def _without_doubles(faces: NDArray[np.int64], notes: list[str]) -> NDArray[np.int64]:
    first, _ = unique_rows(np.sort(faces, axis=1))
    if len(first) == len(faces):
        return faces
    notes.append(f"{len(faces) - len(first)} triangles that were there twice were dropped.")
    return faces[first]


def _wind(vertices: Array, faces: NDArray[np.int64], notes: list[str]) -> Cleaned:
    """Turn triangles so that neighbours agree and closed bodies face outward; open sheets keep the side most of them show."""
    edges = edges_of(faces)
    pair = edges.uses == 2
    a, b = edges.first[pair], edges.second[pair]
    ways = np.bincount(edges.of_face.ravel(), edges.forward.ravel(), len(edges.uses))[pair]
    n = len(faces)
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n)).tocsr()
    bodies, body = connected_components(graph, directed=False)
    flip = np.zeros(n, dtype=bool)
    against = ways != 1
    if against.any():
        flip, twisted = _parity(a, b, against, body)
        notes.append(
            f"{int(min(flip.sum(), n - flip.sum()))} triangles were wound against their neighbours and turned."
        )
        if twisted:
            notes.append(
                "A surface of the part has only one side (like a Moebius strip); its normals are not reliable."
            )
    corners = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    centre = vertices.mean(axis=0)
    volume = (
        np.einsum("ij,ij->i", corners[:, 0] - centre, np.cross(corners[:, 1] - centre, corners[:, 2] - centre)) / 6.0
    )
    signed = np.bincount(body, np.where(flip, -volume, volume), bodies)
    minority = np.bincount(body, np.where(flip, area, -area), bodies) > 0.0
    closed = _closed(edges, body, bodies)
    inside_out = np.where(closed, signed < 0.0, minority)
    voids = _voids(corners, body, closed & inside_out, closed & ~inside_out)
    inside_out &= ~voids
    flip ^= inside_out[body]
    turned = closed & (np.bincount(body, np.where(flip, area, -area), bodies) > 0.0)
    if turned.any():
        notes.append(f"{int(turned.sum())} closed bodies were inside out and turned: all normals now point outward.")
    faces = faces.copy()
    faces[flip] = faces[flip][:, [0, 2, 1]]
    return Cleaned(vertices, faces.astype(np.int32), notes, int(bodies), int(closed.sum()))


def _closed(edges: Edges, body: NDArray[np.int32], bodies: int) -> NDArray[np.bool_]:
    """Return which bodies have no boundary and no edge of three or more faces (bodies,)."""
    odd = (edges.uses[edges.of_face] != 2).sum(axis=1)
    return np.asarray(np.bincount(body, odd, bodies) == 0)


def _voids(
    corners: Array, body: NDArray[np.int32], inward: NDArray[np.bool_], outward: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which inward-facing closed bodies lie inside the box of an outward-facing one: cavities, rightly inward."""
    voids = np.zeros(len(inward), dtype=bool)
    if not inward.any() or not outward.any():
        return voids
    low, high = np.full((len(inward), 3), np.inf), np.full((len(inward), 3), -np.inf)
    np.minimum.at(low, body, corners.min(axis=1))
    np.maximum.at(high, body, corners.max(axis=1))
    above = np.asarray(low[inward, None] > low[None, outward])
    below = np.asarray(high[inward, None] < high[None, outward])
    within = np.logical_and(above, below).sum(axis=2) == 3
    voids[np.flatnonzero(inward)] = within.any(axis=1)
    return voids


def _parity(
    a: NDArray[np.int64], b: NDArray[np.int64], against: NDArray[np.bool_], body: NDArray[np.int32]
) -> tuple[NDArray[np.bool_], bool]:
    """Return which faces to turn so that neighbours agree (f,), and whether that is impossible somewhere."""
    n = len(body)
    # One more node, joined to one face of every body, makes the search a single one.
    roots = np.unique(body, return_index=True)[1]
    ends = np.r_[a, roots], np.r_[b, np.full(len(roots), n)]
    weight = np.r_[np.where(against, 2, 1), np.ones(len(roots), dtype=np.int64)]
    graph = coo_array((weight, ends), shape=(n + 1, n + 1)).tocsr()
    graph = (graph + graph.T).tocsr()
    order, parent = breadth_first_order(graph, n, directed=False)
    parent[n] = n
    parity = np.zeros(n + 1, dtype=bool)
    child = order[1:]
    parity[child] = np.asarray(graph[child, parent[child]]).reshape(-1) >= 2
    # Sums of parities along the way to the root, by doubling.
    jump = parent.astype(np.int64)
    while (jump != jump[jump]).any():
        parity = parity ^ parity[jump]
        jump = jump[jump]
    parity = parity[:n]
    twisted = np.asarray((parity[a] ^ parity[b]) != against)
    return parity, bool(twisted.any())
