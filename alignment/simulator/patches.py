"""The smooth patches of a part's triangles, with a normal at every corner: cut at creases and at the inspected face."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.part import Part

Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Patches:
    """Triangles whose vertices are shared within a patch only.

    vertices, normals (v, 3): in `part`, mm; faces (f, 3): row i is `part.faces[i]`; inspected (f,): on the inspection
    surface; patch (f,): label of the patch.
    """

    vertices: Array
    normals: Array
    faces: Index
    inspected: NDArray[np.bool_]
    patch: Index


def patches(part: Part, inspected_faces: NDArray[np.int32], crease_deg: float = 30.0) -> Patches:
    """Return the patches of a part. Edges that turn by more than `crease_deg`, and the rim of the inspected face, are cuts."""
    faces = part.faces.astype(np.int64)
    inspected = np.zeros(len(faces), dtype=bool)
    inspected[inspected_faces] = True
    first, second = _neighbours(faces)
    cos = np.einsum("ij,ij->i", part.face_normals[first], part.face_normals[second])
    smooth = (cos > np.cos(np.radians(crease_deg))) & (inspected[first] == inspected[second])
    graph = coo_array((np.ones(int(smooth.sum())), (first[smooth], second[smooth])), shape=(len(faces),) * 2)
    _, patch = connected_components(graph.tocsr(), directed=False)
    key = patch[:, None].astype(np.int64) * len(part.vertices) + faces
    used, corner = np.unique(key, return_inverse=True)
    vertices = part.vertices[used % len(part.vertices)]
    compact = corner.reshape(-1, 3).astype(np.int64)
    normals = _jet_normals(vertices, compact, _corner_normals(vertices, compact))
    return Patches(vertices, normals, compact, inspected, patch.astype(np.int64))


def _neighbours(faces: Index) -> tuple[Index, Index]:
    """Pairs of faces that share an edge (an edge of more than two faces is paired in order)."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
    return owner[order][:-1][same], owner[order][1:][same]


def _corner_normals(vertices: Array, faces: Index) -> Array:
    """Vertex normals weighted so that they are exact on a sphere (N. Max, J. Graphics Tools 4 (1999) 1)."""
    corners = vertices[faces]
    total = np.zeros_like(vertices)
    for i in range(3):
        a = corners[:, (i + 1) % 3] - corners[:, i]
        b = corners[:, (i + 2) % 3] - corners[:, i]
        weight = np.einsum("ij,ij->i", a, a) * np.einsum("ij,ij->i", b, b)
        share = np.divide(np.cross(a, b), weight[:, None], out=np.zeros_like(a), where=weight[:, None] > 0)
        np.add.at(total, faces[:, i], share)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.tile([0.0, 0.0, 1.0], (len(total), 1)), where=length > 0)


def _jet_normals(vertices: Array, faces: Index, start: Array) -> Array:
    """Normals of quadrics through each vertex, fitted to its two rings (a jet: Cazals, Pouget, CAGD 22 (2005) 121).

    The vertices of a tessellation lie on the true surface, so a quadric through them has a normal good to second order
    in the spacing; the average of the triangles does not. Where a vertex has too few neighbours the fit is the one of
    least norm in scaled coordinates, which leaves the unseen coefficients zero.
    """
    v = len(vertices)
    pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ones = np.ones(2 * len(pairs))
    ring = csr_array(
        (ones, (np.concatenate([pairs[:, 0], pairs[:, 1]]), np.concatenate([pairs[:, 1], pairs[:, 0]]))), shape=(v, v)
    )
    rings = (ring + ring @ ring).tocsr()
    rings.setdiag(0)
    rings.eliminate_zeros()
    rows = np.repeat(np.arange(v), np.diff(rings.indptr))
    z = start
    x = np.cross(z, np.where(np.abs(z[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(z, x)
    to = vertices[rings.indices] - vertices[rows]
    px, py, pz = (np.einsum("ij,ij->i", to, axis[rows]) for axis in (x, y, z))
    scale = np.zeros((v, 2))
    for column, values in enumerate((px, py)):
        np.maximum.at(scale[:, column], rows, np.abs(values))
    scale[scale == 0.0] = 1.0
    u, w = px / scale[rows, 0], py / scale[rows, 1]
    basis = np.stack([u, w, u * u, u * w, w * w], axis=1)
    weight = 1.0 / (0.05 + u * u + w * w)
    products = np.einsum("ni,nj,n->nij", basis, basis, weight).reshape(-1, 25)
    sums = csr_array((np.ones(len(rows)), np.arange(len(rows)), rings.indptr), shape=(v, len(rows)))
    normal_matrix = (sums @ products).reshape(v, 5, 5)
    right = sums @ (basis * (weight * pz)[:, None])
    trace = np.trace(normal_matrix, axis1=1, axis2=2)
    normal_matrix += (1e-9 * np.maximum(trace, 1e-12))[:, None, None] * np.eye(5)
    gradient = np.linalg.solve(normal_matrix, right[:, :, None])[:, :2, 0] / scale
    normals = z - gradient[:, :1] * x - gradient[:, 1:] * y
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
