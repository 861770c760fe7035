"""Where a mesh is much finer than the footprint, its vertices are observed in clusters, not one by one.

A cluster keeps the mean and the second moments of its vertices, so that a least-squares quadric over clusters sees the
averaged noise of all vertices and none of the bias that a mean of points on a curved surface has.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.surface.topology import Index, vertex_graph

# Cells of a footprint radius: enough of them within it for a quadric with some to spare.
CELLS_PER_FOOTPRINT = 2.5
# Vertices whose normals differ by more than about this (per component) never share a cluster.
NORMAL_CELL = 0.25


@dataclass(frozen=True, eq=False)
class Clusters:
    """c clusters of v vertices.

    of_vertex (v,): cluster of each vertex. count (c,). mean (c, 3), mm. spread (c, 6): central second moments xx, yy, zz,
    xy, xz, yz, mm2. normals (c, 3): unit mean normals. graph (c, c): clusters with vertices joined by an edge.
    """

    of_vertex: Index
    count: Array
    mean: Array
    spread: Array
    normals: Array
    graph: csr_array

    @cached_property
    def columns(self) -> Array:
        """The means by coordinate (3, c)."""
        return np.ascontiguousarray(self.mean.T)

    @cached_property
    def normal_columns(self) -> Array:
        """The normals by coordinate (3, c)."""
        return np.ascontiguousarray(self.normals.T)


def cluster(vertices: Array, normals: Array, edges: Index, footprint_mm: float) -> Clusters:
    """Return clusters of about footprint / 2.5 in size; every vertex its own where the mesh is not finer than that."""
    cell = footprint_mm / CELLS_PER_FOOTPRINT
    short = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) < cell
    if short.mean() < 0.2:
        label = np.arange(len(vertices))
    else:
        key = np.floor(np.hstack([vertices / cell, (normals + 1.0) / NORMAL_CELL])).astype(np.int64)
        key -= key.min(axis=0)
        flat = np.ravel_multi_index(tuple(key.T), tuple(key.max(axis=0) + 1))
        inside = flat[edges[:, 0]] == flat[edges[:, 1]]
        a, b = edges[inside].T
        n = len(vertices)
        same = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
        label = connected_components(same, directed=False)[1].astype(np.int64)
    return _summarise(vertices, normals, edges, label)


def _summarise(vertices: Array, normals: Array, edges: Index, label: Index) -> Clusters:
    c = int(label.max()) + 1
    if c == len(vertices):
        return Clusters(label, np.ones(c), vertices, np.zeros((c, 6)), normals, vertex_graph(c, edges))
    count = np.bincount(label, minlength=c).astype(np.float64)

    def mean_of(values: Array) -> Array:
        return np.asarray(np.bincount(label, values, c) / count)

    mean = np.stack([mean_of(vertices[:, k]) for k in range(3)], axis=1)
    d = vertices - mean[label]
    spread = np.stack([mean_of(d[:, i] * d[:, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
    normal = np.stack([mean_of(normals[:, k]) for k in range(3)], axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0, length, 1.0)
    linked = label[edges]
    linked = linked[linked[:, 0] != linked[:, 1]]
    return Clusters(label, count, mean, spread, normal, vertex_graph(c, linked))
