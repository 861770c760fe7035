"""Holes closed for the distance field only, so that lines run straight past them."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.path.caps import Cap, smooth_cap
from planner.path.isolines import Ints
from planner.path.mesh import PathMesh

# A cap must look the way its rim does, or it is the open end of a tube and no hole.
_LOOKS_ALIKE = 0.7


def fill_holes(mesh: PathMesh) -> PathMesh:
    """Return the mesh with a cap over every hole, its faces after the surface's own.

    Caps go on as the surface around them does; where the rim is too crooked for that they are fans. The longest boundary
    curve is the outline and stays open, and so does any whose cap would not face as its rim does.
    """
    pairs = mesh.boundary_edges
    if len(pairs) == 0:
        return mesh
    n = len(mesh.vertices)
    graph = csr_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    loop = connected_components(graph, directed=False)[1][pairs[:, 0]]
    _, loop = np.unique(loop, return_inverse=True)
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
    vertices, faces, count = [mesh.vertices], [mesh.faces], n
    for k in np.flatnonzero(alike):
        edges = pairs[loop == k]
        cap = smooth_cap(mesh.vertices, edges, _beside(mesh, edges), facing[k] / np.linalg.norm(facing[k]))
        if cap is None:
            hub = np.full(len(edges), n)
            cap = Cap(centre[k][None], np.stack([edges[:, 1], edges[:, 0], hub], axis=1))
        faces.append(np.where(cap.faces >= n, cap.faces - n + count, cap.faces).astype(np.int32))
        vertices.append(cap.points)
        count += len(cap.points)
    return PathMesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))


def _beside(mesh: PathMesh, edges: Ints) -> Ints:
    """Return the vertices within two triangles of a rim."""
    near = np.zeros(len(mesh.vertices), dtype=bool)
    near[edges] = True
    for _ in range(2):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    return np.flatnonzero(near)


def _sums(group: np.ndarray, rows: Array) -> Array:
    """Return the sums of rows (n, 3) by group (n,)."""
    return np.stack([np.bincount(group, rows[:, k]) for k in range(3)], axis=1)
