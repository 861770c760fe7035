"""The curved triangle through three points with three normals: cubic in position, quadratic in normal.

Point-normal triangles of Vlachos, Peters, Boyd, Mitchell 2001, "Curved PN Triangles", I3D, doi:10.1145/364338.364387.
Unlike theirs the normal half way along an edge is that of the cubic through its two ends (Hermite), so that normals of a
smooth surface are met to third order. Neighbouring triangles share edge and normals there. Equal normals give a plane.
"""

import numpy as np

from planner.frames import Array
from planner.surface.normals import unit


def pn_points(corners: Array, normals: Array, bary: Array) -> Array:
    """Return points (n, 3) of curved triangles with corners (n, 3, 3), normals (n, 3, 3) at barycentrics (n, 3)."""
    w = bary.T
    total = np.zeros((len(bary), 3))
    inner = np.zeros((len(bary), 3))
    for i in range(3):
        total += (w[i] ** 3)[:, None] * corners[:, i]
        for j in range(3):
            if i == j:
                continue
            step = corners[:, j] - corners[:, i]
            lift = np.einsum("nk,nk->n", step, normals[:, i])[:, None] * normals[:, i]
            control = corners[:, i] + (step - lift) / 3.0
            total += (3.0 * w[i] ** 2 * w[j])[:, None] * control
            inner += control / 6.0
    centre = corners.mean(axis=1)
    total += (6.0 * w[0] * w[1] * w[2])[:, None] * (1.5 * inner - 0.5 * centre)
    return total


def pn_normals(corners: Array, normals: Array, bary: Array) -> Array:
    """Return unit normals (n, 3) of the same triangles."""
    w = bary.T
    total = np.zeros((len(bary), 3))
    for i in range(3):
        j = (i + 1) % 3
        step = corners[:, j] - corners[:, i]
        length2 = np.einsum("nk,nk->n", step, step)
        both = normals[:, i] + normals[:, j]
        # Slopes of the surface along the edge are -n.e; the cubic through both ends has 3/2 chord - 1/4 (s0 + s1) half way.
        # Relative to the mean normal the chord has slope 0 when (n0 + n1).e = 0, hence the correction below.
        excess = 0.75 * np.einsum("nk,nk->n", both, step) / np.where(length2 > 0, length2, 1.0)
        middle = 0.5 * both - excess[:, None] * step
        total += (w[i] * (w[i] - w[j] - w[(i + 2) % 3]))[:, None] * normals[:, i]
        total += (4.0 * w[i] * w[j])[:, None] * middle
    return unit(total)
