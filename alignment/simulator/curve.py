"""Curved triangles: the smooth surface behind the flat ones, and its refinement into small ones.

Vlachos, Peters, Boyd, Mitchell, "Curved PN triangles", I3D 2001, doi:10.1145/364338.364387: a cubic patch through the
three corners and their normals, and a quadratic field of normals. Flat stays flat, creases stay sharp (their two sides
carry different normals).
"""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

Index = NDArray[np.int64]


class CurvedTriangles:
    """Cubic patches over f triangles; corners and their normals are (f, 3, 3)."""

    def __init__(self, corners: Array, normals: Array) -> None:
        self.corners, self.normals = corners, normals
        self.b = {}
        for i in range(3):
            for j in range(3):
                if i != j:
                    edge = corners[:, j] - corners[:, i]
                    lift = np.einsum("ij,ij->i", edge, normals[:, i])
                    self.b[i, j] = (2.0 * corners[:, i] + corners[:, j] - lift[:, None] * normals[:, i]) / 3.0
        centre = corners.mean(axis=1)
        mean = sum(self.b.values()) / 6.0
        self.b_centre = mean + (mean - centre) / 2.0
        self.n = {}
        for i, j in ((0, 1), (1, 2), (2, 0)):
            edge = corners[:, j] - corners[:, i]
            both = normals[:, i] + normals[:, j]
            square = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
            # Half way along a cubic the slope is minus half the mean slope of its ends: the normal of the edge curve
            # itself, where the paper mirrors the mean normal.
            middle = both - (1.5 * np.einsum("ij,ij->i", edge, both) / square)[:, None] * edge
            length = np.linalg.norm(middle, axis=1, keepdims=True)
            middle = np.divide(middle, length, out=normals[:, i].copy(), where=length > 0)
            self.n[i, j] = 2.0 * middle - 0.5 * both

    def points(self, face: Index, bary: Array) -> Array:
        """Return the points (n, 3), mm, at barycentric coordinates (n, 3) of triangles `face` (n,)."""
        w = bary[:, :, None]
        out = sum(self.corners[face, i] * w[:, i] ** 3 for i in range(3))
        for (i, j), b in self.b.items():
            out = out + 3.0 * b[face] * w[:, i] ** 2 * w[:, j]
        return np.asarray(out + 6.0 * self.b_centre[face] * w[:, 0] * w[:, 1] * w[:, 2])

    def normals_at(self, face: Index, bary: Array) -> Array:
        """Return the unit normals (n, 3) there."""
        w = bary[:, :, None]
        out = sum(self.normals[face, i] * w[:, i] ** 2 for i in range(3))
        for (i, j), n in self.n.items():
            out = out + 2.0 * n[face] * w[:, i] * w[:, j]
        out = np.asarray(out)
        return out / np.linalg.norm(out, axis=1, keepdims=True)
