"""Finer triangles on the same surface: every piece knows where it lies in the triangle it came from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.part import Faces
from planner.path.isolines import Ints

# For each pattern of split edges (bit k: edge from corner k to k+1) the pieces, by local points 0-2 corners, 3-5 midpoints.
_PIECES: dict[int, list[tuple[int, int, int]]] = {
    0: [(0, 1, 2)],
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(0, 1, 4), (0, 4, 2)],
    4: [(0, 1, 5), (5, 1, 2)],
    3: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    6: [(4, 2, 5), (1, 4, 5), (0, 1, 5)],
    5: [(0, 3, 5), (3, 1, 2), (3, 2, 5)],
    7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
}
_MOST_FACES = 400_000


@dataclass(frozen=True, eq=False)
class Subdivision:
    """vertices (v, 3), faces (g, 3); parent (g,): row of the original triangle; bary (g, 3, 3): each corner in it."""

    vertices: Array
    faces: Faces
    parent: Ints
    bary: Array

    def on_parent(self, face: NDArray[np.int32], bary: Array) -> tuple[NDArray[np.int32], Array]:
        """Return rows of the original triangles, and barycentrics there, of points (n,), (n, 3) on the pieces."""
        return self.parent[face].astype(np.int32), np.einsum("nk,nkj->nj", bary, self.bary[face])

    def only(self, keep: NDArray[np.bool_]) -> "Subdivision":
        """Return the selected pieces."""
        return Subdivision(self.vertices, self.faces[keep], self.parent[keep], self.bary[keep])


def split_long_edges(vertices: Array, faces: Faces, longest_mm: float) -> Subdivision:
    """Halve every edge longer than `longest_mm` until none is left; neighbours agree, the surface stays what it was."""
    v, f = vertices, faces.astype(np.int64)
    parent = np.arange(len(f))
    bary = np.tile(np.eye(3), (len(f), 1, 1))
    while True:
        start, end = f, np.roll(f, -1, axis=1)
        long = np.linalg.norm(v[end] - v[start], axis=2) > longest_mm
        if not long.any() or len(f) > _MOST_FACES:
            break
        key = np.minimum(start, end) * len(v) + np.maximum(start, end)
        unique, inverse = np.unique(key[long], return_inverse=True)
        middle = np.full(f.shape, -1, dtype=np.int64)
        middle[long] = len(v) + inverse
        v = np.concatenate([v, 0.5 * (v[unique // len(v)] + v[unique % len(v)])])
        points = np.concatenate([f, middle], axis=1)
        weights = np.concatenate([bary, 0.5 * (bary + np.roll(bary, -1, axis=1))], axis=1)
        code = long @ np.array([1, 2, 4])
        faces_, parents, barys = [], [], []
        for pattern, pieces in _PIECES.items():
            rows = np.flatnonzero(code == pattern)
            for piece in pieces if len(rows) else []:
                faces_.append(points[rows][:, piece])
                barys.append(weights[rows][:, piece])
                parents.append(parent[rows])
        f, parent, bary = np.concatenate(faces_), np.concatenate(parents), np.concatenate(barys)
    return Subdivision(v, f.astype(np.int32), parent, bary)
