"""Meshes whose sheets touch in a vertex or an edge, taken apart there, for tools that want every vertex to be one fan."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.path.mesh import PathMesh


def unglued(mesh: PathMesh) -> PathMesh:
    """Return the mesh with one vertex for every fan of triangles around it; faces keep their rows.

    Triangles belong to one fan if they can be walked through across edges that exactly two triangles share. Meshes that
    are sound already come back as they are.
    """
    faces = mesh.faces.astype(np.int64)
    face, edge = np.nonzero(mesh.other >= 0)
    there = mesh.other[face, edge]
    corners = 3 * len(faces)
    rows, columns = [], []
    for at in (edge, (edge + 1) % 3):
        vertex = faces[face, at]
        match = faces[there] == vertex[:, None]
        rows.append(3 * face + at)
        columns.append(3 * there + match.argmax(axis=1))
    r, c = np.concatenate(rows), np.concatenate(columns)
    graph = coo_array((np.ones(len(r), dtype=np.int8), (r, c)), shape=(corners, corners))
    count, fan = connected_components(graph.tocsr(), directed=False)
    if count == len(np.unique(faces)):
        return mesh
    vertices = np.zeros((count, 3))
    vertices[fan] = mesh.vertices[faces.ravel()]
    return PathMesh(vertices, fan.reshape(-1, 3).astype(np.int32))
