"""Finer triangles on the same surface: every piece knows where it lies in the triangle it came from."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.part import Faces
from planner.surface.topology import Index as Ints

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


def split_long_edges(
    vertices: Array,
    faces: Faces,
    longest_mm: float,
    wanted: Callable[[Array, Array], NDArray[np.bool_]] | None = None,
) -> Subdivision:
    """Halve every edge longer than `longest_mm` until none is left; neighbours agree, the surface stays what it was.

    wanted(starts (n, 3), ends (n, 3)) -> (n,): which of the long edges to halve; all by default.
    """
    v, f = vertices, faces.astype(np.int64)
    parent = np.arange(len(f))
    bary = np.tile(np.eye(3), (len(f), 1, 1))
    while True:
        start, end = f, np.roll(f, -1, axis=1)
        low, high = np.minimum(start, end), np.maximum(start, end)
        long = np.linalg.norm(v[end] - v[start], axis=2) > longest_mm
        if wanted is not None and long.any():
            # Asked from the lower to the higher vertex, so that both faces at an edge hear the same.
            long[long] = wanted(v[low[long]], v[high[long]])
        if not long.any() or len(f) > max(_MOST_FACES, 2 * len(faces)):
            break
        key = low * len(v) + high
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


def split_at_zero(s: Subdivision, values: Array) -> Subdivision:
    """Return the pieces with every triangle cut along the line where `values` (v,), linear inside triangles, are zero.

    Vertices on the line stay single; both sides of a cut share its points.
    """
    v, f = s.vertices, s.faces.astype(np.int64)
    sign = np.sign(values)
    start, end = f, np.roll(f, -1, axis=1)
    cut = sign[start] * sign[end] < 0
    touched = np.flatnonzero(cut.any(axis=1))
    if not len(touched):
        return s
    low, high = np.minimum(start, end)[touched], np.maximum(start, end)[touched]
    cut = cut[touched]
    unique, inverse = np.unique(low[cut] * len(v) + high[cut], return_inverse=True)
    a, b = unique // len(v), unique % len(v)
    t = (values[a] / (values[a] - values[b]))[:, None]
    new = (1.0 - t) * v[a] + t * v[b]
    at = np.full((len(touched), 3), -1, dtype=np.int64)
    at[cut] = len(v) + inverse
    share = np.zeros((len(touched), 3))
    share[cut] = np.where(low[cut] == start[touched][cut], t[inverse, 0], 1.0 - t[inverse, 0])
    old = s.bary[touched]
    on_edge = (1.0 - share)[..., None] * old + share[..., None] * np.roll(old, -1, axis=1)
    points, weights = np.concatenate([f[touched], at], axis=1), np.concatenate([old, on_edge], axis=1)
    keep = np.setdiff1d(np.arange(len(f)), touched)
    faces_, parents, barys = [f[keep]], [s.parent[keep]], [s.bary[keep]]
    code = cut @ np.array([1, 2, 4])
    for pattern, pieces in _PIECES.items():
        rows = np.flatnonzero(code == pattern)
        for piece in pieces if len(rows) else []:
            faces_.append(points[rows][:, piece])
            barys.append(weights[rows][:, piece])
            parents.append(s.parent[touched][rows])
    return Subdivision(
        np.concatenate([v, new]),
        np.concatenate(faces_).astype(np.int32),
        np.concatenate(parents),
        np.concatenate(barys),
    )
