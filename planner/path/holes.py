"""Holes closed for the distance field only, so that lines run straight past them."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.path.mesh import PathMesh

# A cap must look the way its rim does, or it is the open end of a tube and no hole.
_LOOKS_ALIKE = 0.7


def fill_holes(mesh: PathMesh) -> PathMesh:
    """Return the mesh with a fan over every hole, its faces after the surface's own.

    The longest boundary curve is the outline and stays open, and so does any whose cap would not face as its rim does.
    """
    pairs = mesh.boundary_edges
    if len(pairs) == 0:
        return mesh
    n = len(mesh.vertices)
    graph = csr_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    loop = connected_components(graph, directed=False)[1][pairs[:, 0]]
    names, loop = np.unique(loop, return_inverse=True)
    a, b = mesh.vertices[pairs[:, 0]], mesh.vertices[pairs[:, 1]]
    length = np.linalg.norm(b - a, axis=1)
    total = np.bincount(loop, length)
    centre = _sums(loop, 0.5 * (a + b) * length[:, None]) / np.maximum(total, 1e-12)[:, None]
    facing = _sums(loop, np.cross(b - centre[loop], a - centre[loop]))
    rim_face = np.nonzero(mesh.other < 0)[0]
    corner = mesh.vertices[mesh.faces[rim_face]]
    rim = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    rim = rim / np.maximum(np.linalg.norm(rim, axis=1, keepdims=True), 1e-300)
    rim = _sums(loop, rim * length[:, None])
    scale = np.linalg.norm(facing, axis=1) * np.maximum(total, 1e-12)
    alike = np.einsum("ij,ij->i", facing, rim) > _LOOKS_ALIKE * scale
    alike[int(total.argmax())] = False
    number = np.cumsum(alike) - 1 + n
    take = alike[loop]
    caps = np.stack([pairs[take, 1], pairs[take, 0], number[loop[take]]], axis=1)
    assert len(names) == len(total)
    return PathMesh(np.concatenate([mesh.vertices, centre[alike]]), np.concatenate([mesh.faces, caps]).astype(np.int32))


def _sums(group: np.ndarray, rows: Array) -> Array:
    """Return the sums of rows (n, 3) by group (n,)."""
    return np.stack([np.bincount(group, rows[:, k]) for k in range(3)], axis=1)
