"""Triangles for the screen: crease edges, smooth groups, a lighter mesh for display, a finer one for maps. All in mm."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.part import Faces

MAX_TRIANGLES = 1_000_000
MAX_EDGES = 200_000
CREASE_DEG = 30.0


@dataclass(frozen=True, eq=False)
class Creases:
    """edges (e, 2, 3): segments to draw, mm. smooth (f,): number of the smooth group of every face."""

    edges: Array
    smooth: NDArray[np.int32]


def face_normals(vertices: Array, faces: Faces) -> Array:
    """Return unit normals (f, 3); zero for a degenerate triangle."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return np.divide(n, length, out=np.zeros_like(n), where=length > 0)


def creases(vertices: Array, faces: Faces, crease_deg: float = CREASE_DEG) -> Creases:
    """Return the edges where the surface turns by more than the angle or ends, and the groups of faces between them."""
    f = len(faces)
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = pairs[:, 0] * len(vertices) + pairs[:, 1]
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    first = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    count = np.diff(np.r_[first, len(ordered)])
    two = first[count == 2]
    left, right = order[two] // 3, order[two + 1] // 3
    normals = face_normals(vertices, faces)
    sharp = np.einsum("ij,ij->i", normals[left], normals[right]) < np.cos(np.radians(crease_deg))
    drawn = np.r_[order[two[sharp]], order[first[count != 2]]]
    keep = ~sharp
    links = coo_array((np.ones(keep.sum(), dtype=np.int8), (left[keep], right[keep])), shape=(f, f))
    smooth = connected_components(links, directed=False)[1]
    if len(drawn) > MAX_EDGES:
        drawn = drawn[:: len(drawn) // MAX_EDGES + 1]
    return Creases(vertices[pairs[drawn]], np.asarray(smooth, dtype=np.int32))


def split_smooth(vertices: Array, faces: Faces, smooth: NDArray[np.int32]) -> tuple[Array, Faces]:
    """Return the mesh with vertices doubled along creases, so that shading stops there."""
    corner = faces.astype(np.int64) * (int(smooth.max(initial=0)) + 1) + smooth[:, None]
    keys, inverse = np.unique(corner, return_inverse=True)
    return vertices[keys // (int(smooth.max(initial=0)) + 1)], inverse.reshape(-1, 3).astype(np.int32)


def lighter(vertices: Array, faces: Faces, limit: int = MAX_TRIANGLES) -> tuple[Array, Faces]:
    """Return a mesh of at most `limit` triangles by merging the vertices of ever larger cells; the input if it is small."""
    if len(faces) <= limit:
        return vertices, faces
    low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    for cells in (1500, 1100, 800, 600, 450, 330, 250, 180, 130):
        grid = np.floor((vertices - low) / (size / cells)).astype(np.int64)
        key = (grid[:, 0] * (cells + 2) + grid[:, 1]) * (cells + 2) + grid[:, 2]
        _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
        merged = np.stack([np.bincount(inverse, vertices[:, i]) for i in range(3)], axis=1) / count[:, None]
        small = inverse[faces].astype(np.int32)
        alive = (small[:, 0] != small[:, 1]) & (small[:, 1] != small[:, 2]) & (small[:, 2] != small[:, 0])
        if alive.sum() <= limit:
            return merged, small[alive]
    return merged, small[alive][:limit]


def finer(vertices: Array, faces: Faces, cells: int = 160, limit: int = 250_000) -> tuple[Array, Faces]:
    """Return the mesh cut finely enough to carry a map: edges at most 1/cells of its size, at most about `limit` triangles."""
    import trimesh  # noqa: PLC0415

    size = float(np.ptp(vertices, axis=0).max())
    triangles = vertices[faces]
    area = float(
        0.5
        * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum()
    )
    edge = max(size / cells, float(np.sqrt(8.0 * area / limit)))
    v, f = trimesh.remesh.subdivide_to_size(vertices, faces, max_edge=edge, max_iter=14)
    return np.asarray(v, dtype=np.float64), np.asarray(f, dtype=np.int32)


def vertex_normals(vertices: Array, faces: Faces) -> Array:
    """Return area-weighted unit normals (v, 3)."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    out = np.stack([np.bincount(faces.ravel(), np.repeat(n[:, i], 3), len(vertices)) for i in range(3)], axis=1)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.divide(out, length, out=np.zeros_like(out), where=length > 0)
