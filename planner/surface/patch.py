"""The curved triangle through three points with three normals: cubic in position, quadratic in normal.

Point-normal triangles of Vlachos, Peters, Boyd, Mitchell 2001, "Curved PN Triangles", I3D, doi:10.1145/364338.364387.
Unlike theirs the normal half way along an edge is that of the cubic through its two ends (Hermite), so that normals of a
smooth surface are met to third order. Neighbouring triangles share edge and normals there. Equal normals give a plane.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.surface.normals import unit

# Points are taken by coordinate and in slices that stay in a processor's cache: rows of three are several times slower.
_SLICE = 16_384


class CurvedTriangles:
    """Curved triangles over vertices (v, 3), mm, with unit normals (v, 3)."""

    def __init__(self, vertices: Array, normals: Array) -> None:
        self._vertices, self._normals = np.ascontiguousarray(vertices.T), np.ascontiguousarray(normals.T)

    def points_and_normals(self, corner: NDArray[np.int64], bary: Array) -> tuple[Array, Array]:
        """Return points and unit normals (n, 3) at barycentrics (n, 3) of triangles with these corners (n, 3).

        Points are the cubic sum of Vlachos et al. over control points c_i + (e_ij - (e_ij . n_i) n_i) / 3, e_ij = c_j - c_i,
        ordered by corners and normals: both enter linearly.

        Slopes of the surface along an edge are -n.e; the cubic through both ends has 3/2 chord - 1/4 (s0 + s1) half way.
        Relative to the mean normal the chord has slope 0 when (n0 + n1).e = 0, hence the correction by the excess. The
        quadratic through corners and middles is then the linear blend of the normals less that correction.
        """
        return self._each(corner, bary, True)

    def normals(self, corner: NDArray[np.int64], bary: Array) -> Array:
        """Return the unit normals (n, 3) alone."""
        return self._each(corner, bary, False)[1]

    def _each(self, corner: NDArray[np.int64], bary: Array, with_points: bool) -> tuple[Array, Array]:
        points, normals = np.zeros((len(corner) if with_points else 0, 3)), np.zeros((len(corner), 3))
        for start in range(0, len(corner), _SLICE):
            rows = slice(start, start + _SLICE)
            p, n = ([[x[c] for x in columns] for c in corner[rows].T] for columns in (self._vertices, self._normals))
            w = np.ascontiguousarray(bary[rows].T)
            step = [[p[(i + 1) % 3][k] - p[i][k] for k in range(3)] for i in range(3)]
            # How far corner i + 1 stands above the plane of corner i, and corner i + 1's plane above corner i.
            rise = [_dot(step[i], n[i]) for i in range(3)]
            fall = [_dot(step[i], n[(i + 1) % 3]) for i in range(3)]
            if with_points:
                points[rows] = _cubic(p, n, w, rise, fall)
            for k in range(3):
                normals[rows, k] = w[0] * n[0][k] + w[1] * n[1][k] + w[2] * n[2][k]
            for i in range(3):
                length2 = _dot(step[i], step[i])
                length2[length2 == 0.0] = 1.0
                excess = 3.0 * w[i] * w[(i + 1) % 3] * (rise[i] + fall[i]) / length2
                for k in range(3):
                    normals[rows, k] -= excess * step[i][k]
        return points, unit(normals)


def _cubic(
    p: Sequence[Sequence[Array]], n: Sequence[Sequence[Array]], w: Array, rise: Sequence[Array], fall: Sequence[Array]
) -> Array:
    """Return the points (m, 3) of the cubic sum."""
    bubble = w[0] * w[1] * w[2]
    out = np.zeros((3, len(bubble)))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        wi, wj, wk = w[i], w[j], w[k]
        wi2 = wi * wi
        along = wi * (wi2 + 2.0 * wi * (wj + wk) + wj * wj + wk * wk) + 2.0 * bubble
        lift = (wi2 * wk + 0.5 * bubble) * fall[k] - (wi2 * wj + 0.5 * bubble) * rise[i]
        for axis in range(3):
            out[axis] += along * p[i][axis] + lift * n[i][axis]
    return out.T


def _dot(a: Sequence[Array], b: Sequence[Array]) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
