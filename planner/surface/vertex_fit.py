"""Point, normal and curvature of the smooth surface at every vertex of a mesh."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from planner.frames import Array
from planner.surface.clusters import Clusters, cluster
from planner.surface.flats import find_flats
from planner.surface.normals import angle_weighted_normals
from planner.surface.quadric import LocalFit, fit_nodes, monomials, two_rings
from planner.surface.topology import Index, edges_of, vertex_graph

# Edges longer than this share of the footprint: the mesh, not the probe, sets the neighbourhood.
COARSE = 0.8
# A quadric through CAD vertices leaves less than this (rad, median) where edges are shorter than the footprint.
NOISE_RAD = 0.004
NOISE_SAMPLE = 3000
# Neighbours that a cubic wants.
ENOUGH = 16
# Vertices worked on at a time: what stays in a processor's cache.
SLICE = 16_384


@dataclass(frozen=True, eq=False)
class VertexFit:
    """points (v, 3) mm, unit normals (v, 3), shape (v, 3, 3): symmetric W with dn = W dp, 1/mm. exact: through the vertices."""

    points: Array
    normals: Array
    shape: Array
    exact: bool


def fit_vertices(vertices: Array, faces: Index, footprint_mm: float) -> VertexFit:
    """Return the smooth surface at welded vertices (v, 3) of faces (f, 3), from neighbours within about the footprint.

    Vertices of a CAD tessellation are points of the true surface: they stay, and the polynomials go through them. A mesh
    finer than the footprint whose vertices scatter about such polynomials was measured: there the footprint averages.
    """
    edges = edges_of(faces)
    guess = angle_weighted_normals(vertices, faces)
    n = len(vertices)
    flats = find_flats(vertices, faces, edges)
    # Inside a planar face nothing is left to fit; what bends beyond its seam must not see across it.
    inner = (edges.uses == 2) & (flats.face[edges.first] >= 0) & (flats.face[edges.first] == flats.face[edges.second])
    graph = vertex_graph(n, edges.vertices[~inner])
    points = Clusters(np.arange(n), np.ones(n), vertices, np.zeros((n, 6)), guess, graph)
    coarse = _mean_link_mm(points.graph, vertices) > COARSE * footprint_mm
    if _is_noisy(points, np.flatnonzero(~coarse)):
        return _smooth(vertices, cluster(vertices, guess, edges.vertices, footprint_mm))
    fit = _through(points, coarse)
    for corner in faces[flats.face >= 0].T:
        fit.normals[corner] = flats.normals[flats.face[flats.face >= 0]]
        fit.shape[corner] = 0.0
    return fit


def _is_noisy(points: Clusters, fine: NDArray[np.int64]) -> bool:
    """Return whether neighbours scatter about quadrics through the vertices: a scanned mesh, not a CAD one."""
    if len(fine) < 100:
        return False
    sample = fine[:: max(len(fine) // NOISE_SAMPLE, 1)]
    near = (points.graph + eye_array(len(points.mean), dtype=np.int8, format="csr")).tocsr()
    rows = (near[sample] @ near).tocsr()
    fit = fit_nodes(points, _as_rows(rows, sample, len(points.mean)), sample, 6, exact=True)
    return bool(np.median(fit.slope_rms) > NOISE_RAD)


def _through(points: Clusters, coarse: NDArray[np.bool_]) -> VertexFit:
    """Return the fit of a CAD mesh: through every vertex; cubic where the mesh is coarser than the footprint."""
    rings = two_rings(points.graph)
    few = coarse & (np.diff(rings.indptr) < ENOUGH)
    n = len(points.mean)
    normals, shape = np.zeros((n, 3)), np.zeros((n, 3, 3))
    for chosen, terms in ((~coarse, 6), (coarse & ~few, 10), (few, 10)):
        nodes = np.flatnonzero(chosen)
        if not len(nodes):
            continue
        around = rings
        if chosen is few:
            # At corners and edges two rings do not fix a cubic.
            near = (points.graph + eye_array(n, dtype=np.int8, format="csr")).tocsr()
            around = _as_rows((rings[nodes] @ near).tocsr(), nodes, n)
        fit = fit_nodes(points, around, nodes, terms, exact=True)
        _, normals[nodes], shape[nodes] = at_nodes(fit, points.mean[nodes])
    return VertexFit(points.mean, normals, shape, exact=True)


def _smooth(vertices: Array, clusters: Clusters) -> VertexFit:
    """Return the fit of a noisy mesh: quadrics over clusters within the footprint, vertices moved onto them."""
    nodes = np.arange(len(clusters.mean))
    fit = fit_nodes(clusters, two_rings(clusters.graph), nodes, 6, exact=False)
    return VertexFit(*evaluate_fit(fit, clusters.of_vertex, vertices), exact=False)


def _as_rows(rows: csr_array, nodes: NDArray[np.int64], n: int) -> csr_array:
    """Return a matrix (n, n) with `rows` at the places of `nodes`, ascending, and nothing elsewhere."""
    sizes = np.zeros(n, dtype=np.int64)
    sizes[nodes] = np.diff(rows.indptr)
    rows.sort_indices()
    return csr_array((rows.data, rows.indices, np.r_[0, np.cumsum(sizes)]), shape=(n, n))


def _mean_link_mm(graph: csr_array, mean: Array) -> Array:
    count = np.diff(graph.indptr)
    total = np.zeros(graph.shape[0])
    for start in range(0, graph.shape[0], SLICE):
        rows = slice(start, min(start + SLICE, graph.shape[0]))
        other = graph.indices[graph.indptr[rows.start] : graph.indptr[rows.stop]]
        row = np.repeat(np.arange(rows.stop - rows.start), count[rows])
        step2 = sum(((x[other] - x[rows][row]) ** 2 for x in mean.T), np.zeros(len(other)))
        total[rows] = np.bincount(row, np.sqrt(step2), rows.stop - rows.start)
    return np.asarray(total / np.maximum(count, 1))


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
    return foot, *_bent((first, second, normal), (hu, hv), (huu, huv, hvv))


def at_nodes(fit: LocalFit, points: Array) -> tuple[Array, Array, Array]:
    """Return the same at the polynomials' own nodes (n,), through which they go."""
    n = len(points)
    normals, shape = np.zeros((n, 3)), np.zeros((n, 3, 3))
    for start in range(0, n, SLICE):
        rows = slice(start, start + SLICE)
        c = fit.coefficients[rows].T
        axes = (fit.first[rows], fit.second[rows], fit.normal[rows])
        normals[rows], shape[rows] = _bent(axes, (c[1], c[2]), (2 * c[3], c[4], 2 * c[5]))
    return points, normals, shape


def _bent(
    axes: tuple[Array, Array, Array], slopes: tuple[Array, Array], second: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Return normals (n, 3) and W (n, 3, 3) of a height over frames, from its slopes and second derivatives (n,) each.

    Weingarten: dn = -G^-1 II in the basis p_u, p_v; E G^-1 is the dual basis, so W = -(dual) II (dual)^T.
    """
    (first, other, normal), (hu, hv), (huu, huv, hvv) = (np.ascontiguousarray(a.T) for a in axes), slopes, second
    e, f, g = 1 + hu * hu, hu * hv, 1 + hv * hv
    det = e * g - f * f  # is 1 + hu^2 + hv^2
    root = np.sqrt(det)
    outward = (normal - hu * first - hv * other) / root
    pu, pv = first + hu * normal, other + hv * normal
    du, dv = (g * pu - f * pv) / det, (e * pv - f * pu) / det
    # II (dual)^T, halves of a symmetric product.
    ru, rv = -(huu * du + huv * dv) / root, -(huv * du + hvv * dv) / root
    shape = np.zeros((len(hu), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            shape[:, i, j] = shape[:, j, i] = du[i] * ru[j] + dv[i] * rv[j]
    return np.ascontiguousarray(outward.T), shape
