"""Boundary half-edges in order: which one follows which around a surface."""

import numpy as np
from numpy.typing import NDArray

from planner.surface.topology import Index


def successors(faces: Index, of_face: Index, is_boundary: NDArray[np.bool_], face: Index, corner: Index) -> Index:
    """Return for every boundary half-edge (face, corner opposite) the next one around the surface (m,)."""
    number = np.full(faces.shape, -1)
    number[face, corner] = np.arange(len(face))
    # Turn about the end vertex through neighbouring faces until the next boundary edge.
    other_face = across(of_face)
    f, e = face.copy(), (corner + 1) % 3  # the edge that leaves the end vertex within the same face
    result = np.full(len(face), -1)
    pivot = faces[face, (corner + 2) % 3]
    active = np.arange(len(face))
    for _ in range(len(faces) + 1):
        done = is_boundary[of_face[f, e]]
        result[active[done]] = number[f[done], e[done]]
        active, f, e, pivot = active[~done], f[~done], e[~done], pivot[~done]
        if not len(active):
            break
        g = other_face[f, e]
        stuck = g < 0  # a non-manifold edge: the curve ends here and is closed by a straight segment
        active, f, g, e, pivot = active[~stuck], f[~stuck], g[~stuck], e[~stuck], pivot[~stuck]
        at = np.argmax(faces[g] == pivot[:, None], axis=1)
        # In face g the edge that leaves the pivot is from corner `at` to `at + 1`: it lies opposite corner `at + 2`.
        f, e = g, (at + 2) % 3
    lost = result < 0
    result[lost] = np.flatnonzero(lost)
    return result


def across(of_face: Index) -> Index:
    """Return for every face and edge the other face at the edge (f, 3); -1 where there is not exactly one."""
    flat = of_face.ravel()
    order = np.argsort(flat, kind="stable")
    ordered = flat[order]
    across = np.full(len(flat), -1)
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    across[order[same]], across[order[same + 1]] = order[same + 1] // 3, order[same] // 3
    counts = np.bincount(flat)
    across[counts[flat] != 2] = -1
    return across.reshape(-1, 3)
