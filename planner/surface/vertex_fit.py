"""Point, normal and curvature of the smooth surface at every vertex of a mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from planner.frames import Array
from planner.surface.clusters import cluster
from planner.surface.normals import angle_weighted_normals, unit
from planner.surface.quadric import LocalFit, fit_nodes, monomials, two_rings
from planner.surface.topology import Index, edges_of


@dataclass(frozen=True, eq=False)
class VertexFit:
    """points (v, 3) mm, unit normals (v, 3), shape (v, 3, 3): symmetric W with dn = W dp, 1/mm."""

    points: Array
    normals: Array
    shape: Array


def fit_vertices(vertices: Array, faces: Index, footprint_mm: float) -> VertexFit:
    """Return the smooth surface at welded vertices (v, 3) of faces (f, 3), from neighbours within about the footprint.

    Where edges are longer than the footprint the mesh is taken as CAD: its vertices are points of the surface and stay.
    """
    edges = edges_of(faces).vertices
    guess = angle_weighted_normals(vertices, faces)
    clusters = cluster(vertices, guess, edges, footprint_mm)
    rings = two_rings(clusters.graph)
    exact = _mean_link_mm(clusters.graph, clusters.mean) > 0.8 * footprint_mm
    exact &= clusters.count == 1
    of_vertex = clusters.of_vertex
    normals, points = np.zeros_like(vertices), np.zeros_like(vertices)
    shape = np.zeros((len(vertices), 3, 3))
    for flag in (True, False):
        nodes = np.flatnonzero(exact == flag)
        if not len(nodes):
            continue
        fit = fit_nodes(clusters.mean, clusters.spread, clusters.count, clusters.normals, rings, nodes, flag)
        row = np.full(len(exact), -1)
        row[nodes] = np.arange(len(nodes))
        mine = np.flatnonzero(exact[of_vertex] == flag)
        points[mine], normals[mine], shape[mine] = evaluate_fit(fit, row[of_vertex[mine]], vertices[mine])
    return VertexFit(points, normals, shape)


def _mean_link_mm(graph: csr_array, mean: Array) -> Array:
    row = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr))
    length = np.linalg.norm(mean[row] - mean[graph.indices], axis=1)
    n = np.maximum(np.bincount(row, minlength=graph.shape[0]), 1)
    return np.asarray(np.bincount(row, length, graph.shape[0]) / n)


def evaluate_fit(fit: LocalFit, row: NDArray, points: Array) -> tuple[Array, Array, Array]:
    """Return points (n, 3), normals (n, 3) and W (n, 3, 3) of the polynomials `row` (n,) at the feet of points (n, 3)."""
    first, second, normal = fit.first[row], fit.second[row], fit.normal[row]
    d = points - fit.origin[row]
    u, v = np.einsum("ij,ij->i", d, first), np.einsum("ij,ij->i", d, second)
    c = fit.coefficients[row].T
    h = np.einsum("tn,tn->n", monomials(u, v, 10), c)
    hu = c[1] + 2 * c[3] * u + c[4] * v + 3 * c[6] * u * u + 2 * c[7] * u * v + c[8] * v * v
    hv = c[2] + c[4] * u + 2 * c[5] * v + c[7] * u * u + 2 * c[8] * u * v + 3 * c[9] * v * v
    huu = 2 * c[3] + 6 * c[6] * u + 2 * c[7] * v
    huv = c[4] + 2 * c[7] * u + 2 * c[8] * v
    hvv = 2 * c[5] + 2 * c[8] * u + 6 * c[9] * v
    foot = fit.origin[row] + u[:, None] * first + v[:, None] * second + h[:, None] * normal
    outward = unit(normal - hu[:, None] * first - hv[:, None] * second)
    # Weingarten: dn = -G^-1 II in the basis p_u, p_v; E G^-1 is the dual basis, so W = -(dual) II (dual)^T.
    pu, pv = first + hu[:, None] * normal, second + hv[:, None] * normal
    e, f, g = 1 + hu * hu, hu * hv, 1 + hv * hv
    det = e * g - f * f
    du = (g[:, None] * pu - f[:, None] * pv) / det[:, None]
    dv = (e[:, None] * pv - f[:, None] * pu) / det[:, None]
    root = np.sqrt(1 + hu * hu + hv * hv)
    cross = np.einsum("ni,nj->nij", du, dv)
    w = huu[:, None, None] * np.einsum("ni,nj->nij", du, du) + hvv[:, None, None] * np.einsum("ni,nj->nij", dv, dv)
    w += huv[:, None, None] * (cross + cross.transpose(0, 2, 1))
    return foot, outward, -w / root[:, None, None]
