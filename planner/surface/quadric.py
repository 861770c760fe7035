"""Local polynomials over the tangent plane: the height of the neighbours of every node, by least squares.

The height h(u, v) over the plane through a node is a polynomial of degree 2 (or 3, where the mesh is coarser than the
footprint and its vertices are exact). Unlike an average of facet normals, its slope at the node does not lean at an edge
or a hole, because the curvature is estimated along with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from planner.frames import Array
from planner.surface.clusters import Clusters
from planner.surface.least_squares import one_sided, residual_slope, slope_precision, solve_segments
from planner.surface.normals import tangent_frames

# Neighbours turned by more than about this (rad) count little: a quadric does not describe a fillet end to end.
TURN = 0.35
# Beyond this residual (rad) a polynomial does not describe both sides of a node: the curvature jumps there.
KINK_RAD = 0.004
# Nearest over farthest neighbour of a node among slivers: there the guessed normal has a say in the slope.
SLIVER = 0.08
# Mean square of their places across over along: below this they lie in a strip.
LONG = 0.1
CHUNK_PAIRS = 60_000


@dataclass(frozen=True, eq=False)
class LocalFit:
    """Polynomials of n nodes: h = sum of coefficients (n, 10) times 1, u, v, u2, uv, v2, u3, u2v, uv2, v3 (mm), over the
    frames first, second, normal (n, 3) at the nodes' origin. slope_rms (n,): weighted rms of (residual / distance), rad.
    """

    origin: Array
    first: Array
    second: Array
    normal: Array
    coefficients: Array
    slope_rms: Array


def two_rings(graph: csr_array) -> csr_array:
    """Return the adjacency of nodes at most two edges apart, the node itself included."""
    near = (graph + eye_array(graph.shape[0], dtype=np.int8, format="csr")).tocsr()
    near.data = np.ones(len(near.data), dtype=np.float32)
    rings = (near @ near).tocsr()
    rings.sort_indices()
    return rings


def monomials(u: Array, v: Array, terms: int) -> Array:
    """Return 1, u, v, u2, uv, v2 (and u3, u2v, uv2, v3) as rows, (terms, n)."""
    rows = np.ones((terms, len(u)))
    rows[1], rows[2] = u, v
    for row, (i, j) in enumerate(((1, 1), (1, 2), (2, 2), (3, 1), (3, 2), (1, 5), (2, 5))[: terms - 3], start=3):
        np.multiply(rows[i], rows[j], out=rows[row])
    return rows


def fit_nodes(clusters: Clusters, rings: csr_array, nodes: NDArray[np.int64], terms: int, exact: bool) -> LocalFit:
    """Return the local polynomials of `nodes` (n,) over their `rings`, with 6 terms (quadric) or 10 (cubic).

    exact: the nodes are points of the true surface, and the polynomial goes through them; else the node's own noise is
    averaged with its neighbours'.
    """
    pieces = []
    sizes = np.diff(rings.indptr)[nodes]
    bounds = np.searchsorted(np.cumsum(sizes), np.arange(CHUNK_PAIRS, int(sizes.sum()) + CHUNK_PAIRS, CHUNK_PAIRS))
    start = 0
    for stop in np.unique(np.r_[np.minimum(bounds + 1, len(nodes)), len(nodes)]):
        pieces.append(_fit(clusters, rings, nodes[start:stop], terms, exact))
        start = int(stop)
    names = LocalFit.__dataclass_fields__
    return LocalFit(*(np.concatenate([getattr(p, name) for p in pieces]) for name in names))


def _pairs(rings: csr_array, nodes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    sizes = np.diff(rings.indptr)[nodes]
    starts = np.r_[0, np.cumsum(sizes)[:-1]]
    if len(nodes) and nodes[-1] - nodes[0] == len(nodes) - 1:
        return rings.indices[rings.indptr[nodes[0]] : rings.indptr[nodes[-1] + 1]].astype(np.int64), starts
    within = np.arange(int(sizes.sum())) - np.repeat(starts, sizes)
    return np.asarray(rings.indices[np.repeat(rings.indptr[nodes], sizes) + within], dtype=np.int64), starts


def _fit(clusters: Clusters, rings: csr_array, nodes: NDArray[np.int64], terms: int, exact: bool) -> LocalFit:
    other, starts = _pairs(rings, nodes)
    sizes = np.diff(np.r_[starts, len(other)])
    normal = clusters.normals[nodes]
    first, second = tangent_frames(normal)
    # By coordinate: rows of three take numpy several times as long.
    d = [x[other] - x[nodes].repeat(sizes) for x in clusters.columns]
    f, s, m = ([x.repeat(sizes) for x in np.ascontiguousarray(axis.T)] for axis in (first, second, normal))
    u, v, h = (_dot(d, axis) for axis in (f, s, m))
    distance = np.sqrt(u * u + v * v + h * h)
    scale = np.maximum.reduceat(distance, starts)
    scale[scale == 0] = 1.0
    k = scale.repeat(sizes)
    rho = distance / k
    turn2 = np.maximum(2.0 - 2.0 * _dot([x[other] for x in clusters.normal_columns], m), 0.0)
    phi = monomials(u / k, v / k, terms)
    if exact:
        nearest = np.repeat(np.minimum.reduceat(np.where(rho > 0, rho, 1.0), starts), sizes)
        reach = np.square(rho + 0.3 * nearest)
        weight = np.exp(turn2 * (-0.25 / TURN**2)) / (reach * reach)
        phi[0] = 0.0
    else:
        weight = clusters.count[other] * (1.05 - rho * rho) ** 2 * np.exp(-turn2 / TURN**2)
        if clusters.spread.any():
            spread = clusters.spread[other]
            phi[3] += _quadratic(spread, f, f) / k**2
            phi[4] += _quadratic(spread, f, s) / k**2
            phi[5] += _quadratic(spread, s, s) / k**2
    h /= k
    sure = None
    if exact and terms == 10:
        turned = [x[other] - y for x, y in zip(clusters.normal_columns, m, strict=True)]
        tu, tv = _dot(turned, f), _dot(turned, s)
        sure = slope_precision((tu, tv), (phi[1], phi[2]), turn2, starts)
        # Only slivers leave a direction without near neighbours.
        sure *= np.minimum(SLIVER / nearest[starts], 1.0)[:, None, None] ** 6
        sure *= np.minimum(LONG / _roundness(phi[1], phi[2], starts), 1.0)[:, None, None] ** 2
    coefficients = solve_segments(phi, h, weight, starts, through=exact, slope_precision=sure)
    slope = residual_slope(phi, h, rho, coefficients, sizes)
    slope_rms = np.sqrt(np.add.reduceat(slope * slope, starts) / np.maximum(sizes - 1, 1))
    if exact:
        jumps = np.flatnonzero(slope_rms > KINK_RAD)
        if len(jumps):
            pair = np.concatenate([np.arange(starts[j], starts[j] + sizes[j]) for j in jumps])
            node = np.repeat(nodes[jumps], sizes[jumps])
            adjacent = np.asarray(clusters.graph[node, other[pair]]).reshape(-1) > 0
            coefficients[jumps] = one_sided(
                phi[:, pair],
                h[pair],
                weight[pair],
                rho[pair],
                adjacent,
                sizes[jumps],
                coefficients[jumps],
                None if sure is None else sure[jumps],
            )
    full = np.zeros((len(nodes), 10))
    powers = np.array([0, 1, 1, 2, 2, 2, 3, 3, 3, 3])[:terms]
    full[:, :terms] = coefficients * scale[:, None] ** (1.0 - powers)
    return LocalFit(clusters.mean[nodes], first, second, normal, full, slope_rms)


def _roundness(u: Array, v: Array, starts: NDArray[np.int64]) -> Array:
    """Return the smaller over the larger principal mean square of places u, v (p,) around n nodes (n,)."""
    uu, uv, vv = (np.add.reduceat(a * b, starts) for a, b in ((u, u), (u, v), (v, v)))
    middle, half = 0.5 * (uu + vv), np.sqrt(0.25 * (uu - vv) ** 2 + uv**2)
    return np.asarray(np.maximum((middle - half) / np.maximum(middle + half, 1e-30), 1e-9))


def _quadratic(tensor: Array, a: Sequence[Array], b: Sequence[Array]) -> Array:
    """Return a . S . b of symmetric tensors (n, 6) in the order xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = tensor.T
    return np.asarray(
        a[0] * (xx * b[0] + xy * b[1] + xz * b[2])
        + a[1] * (xy * b[0] + yy * b[1] + yz * b[2])
        + a[2] * (xz * b[0] + yz * b[1] + zz * b[2])
    )


def _dot(a: Sequence[Array], b: Sequence[Array]) -> Array:
    """Return the products (n,) of vectors given by coordinate."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
