"""Meshes whose sheets touch in a vertex or an edge, taken apart there, for tools that want every vertex to be one fan."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.path.isolines import Ints, twins
from planner.path.mesh import PathMesh


def unglued(mesh: PathMesh) -> PathMesh:
    """Return the mesh with one vertex for every fan of triangles around it; faces keep their rows.

    Triangles belong to one fan if they can be walked through across edges that exactly two triangles share. Meshes that
    are sound already come back as they are.
    """
    faces = mesh.faces.astype(np.int64)
    twin = twins(mesh.faces).ravel()
    edge = np.flatnonzero(twin > np.arange(len(twin)))
    there = twin[edge]
    # Both triangles walk a shared edge, in opposite ways: the start of one is the end of the other.
    c = np.concatenate([_end(there), there])
    r = np.concatenate([edge, _end(edge)])
    corners = 3 * len(faces)
    graph = coo_array((np.ones(len(r), dtype=np.int8), (r, c)), shape=(corners, corners))
    count, fan = connected_components(graph.tocsr(), directed=False)
    if count == int((np.bincount(faces.ravel()) > 0).sum()):
        return mesh
    vertices = np.zeros((count, 3))
    vertices[fan] = mesh.vertices[faces.ravel()]
    return PathMesh(vertices, fan.reshape(-1, 3).astype(np.int32))


def _end(edge: Ints) -> Ints:
    """Return the corners (n,) in which edges, as 3 face + edge, end."""
    return np.where(edge % 3 == 2, edge - 2, edge + 1)
