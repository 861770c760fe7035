"""The curved triangle through three points with three normals: cubic in position, quadratic in normal.

Point-normal triangles of Vlachos, Peters, Boyd, Mitchell 2001, "Curved PN Triangles", I3D, doi:10.1145/364338.364387.
Unlike theirs the normal half way along an edge is that of the cubic through its two ends (Hermite), so that normals of a
smooth surface are met to third order. Neighbouring triangles share edge and normals there. Equal normals give a plane.
"""

import numpy as np

from planner.frames import Array
from planner.surface.normals import unit


def pn_points(corners: Array, normals: Array, bary: Array) -> Array:
    """Return points (n, 3) of curved triangles with corners (n, 3, 3), normals (n, 3, 3) at barycentrics (n, 3).

    The cubic sum of Vlachos et al. over control points c_i + (e_ij - (e_ij . n_i) n_i) / 3, e_ij = c_j - c_i, ordered by
    corners and normals: both enter linearly.
    """
    w = np.ascontiguousarray(bary.T)
    bubble = w[0] * w[1] * w[2]
    along = np.zeros((len(bary), 3))
    lift = np.zeros((len(bary), 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        wi, wj, wk = w[i], w[j], w[k]
        along[:, i] = wi * (wi * (wi + 2.0 * (wj + wk)) + wj * wj + wk * wk) + 2.0 * bubble
        for m, wm in ((j, wj), (k, wk)):
            rise = np.einsum("nk,nk->n", corners[:, m] - corners[:, i], normals[:, i])
            lift[:, i] -= (wi * wi * wm + 0.5 * bubble) * rise
    return np.einsum("ni,nik->nk", along, corners) + np.einsum("ni,nik->nk", lift, normals)


def pn_normals(corners: Array, normals: Array, bary: Array) -> Array:
    """Return unit normals (n, 3) of the same triangles.

    Slopes of the surface along an edge are -n.e; the cubic through both ends has 3/2 chord - 1/4 (s0 + s1) half way. Relative
    to the mean normal the chord has slope 0 when (n0 + n1).e = 0, hence the correction by the excess. The quadratic through
    corners and middles is then the linear blend of the normals less that correction.
    """
    w = bary.T
    total = np.einsum("nk,nkj->nj", bary, normals)
    for i in range(3):
        j = (i + 1) % 3
        step = corners[:, j] - corners[:, i]
        length2 = np.einsum("nk,nk->n", step, step)
        both = np.einsum("nk,nk->n", normals[:, i], step) + np.einsum("nk,nk->n", normals[:, j], step)
        excess = 3.0 * w[i] * w[j] * both / np.where(length2 > 0, length2, 1.0)
        total -= excess[:, None] * step
    return unit(total)
