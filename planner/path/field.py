"""Distance measured on the surface from a guide line: fast marching, polished where the triangles are uneven."""

from collections.abc import Callable

import igl
import numpy as np
import potpourri3d
from numpy.typing import NDArray
from scipy.sparse import csc_array, csc_matrix, csr_array
from scipy.sparse.linalg import splu

from planner.errors import fail
from planner.frames import Array
from planner.part import Faces
from planner.path.isolines import Ints
from planner.surface.normals import lengths
from planner.surface.topology import compact

_GOOD_GRADIENT = 0.01
_ROUNDS = 2
_AVERAGES = 12


def guide_distance(vertices: Array, faces: Faces, height: Array) -> Array:
    """Return the signed distance along the surface (v,), mm, from the line where `height` (v,), linear in space, is zero.

    Fast marching (Kimmel, Sethian 1998, doi:10.1073/pnas.95.15.8431) from the exact distances of the vertices next to
    the line; exact for straight fronts on even triangles. Where triangles are uneven its gradient is not of unit length;
    then the directions alone are kept, averaged over neighbours, and integrated again (the Poisson step of the heat
    method: Crane, Weischedel, Wardetzky 2013, doi:10.1145/2516971.2516977). Sign: that of `height`.
    """
    gradient, area = _gradients(vertices, faces)
    slope = np.linalg.norm(np.einsum("tik,ti->tk", gradient, height[faces]), axis=1)
    h = height[faces]
    crossed = (h.min(axis=1) < 0.0) & (h.max(axis=1) >= 0.0) & (slope > 0.05) & (area > 0)
    if not crossed.any():
        raise fail("guide-missing", "No section of the surface can guide the raster.", "Use strategy 'plane'.")
    near = np.full(len(vertices), np.inf)
    np.minimum.at(near, faces[crossed].ravel(), (np.abs(h[crossed]) / slope[crossed, None]).ravel())
    source = np.flatnonzero(np.isfinite(near))
    sound = area > 1e-12 * float(area.max())
    d = _marched(vertices, faces[sound], source, near[source])
    # What no way over the surface leads to keeps its plain height, as a plane section would have it.
    d = np.where(np.isfinite(d), d, np.abs(height))
    d = np.where(height < 0.0, -d, d)
    length = np.linalg.norm(np.einsum("tik,ti->tk", gradient, d[faces]), axis=1)
    uneven = float(area[sound & (np.abs(length - 1.0) > _GOOD_GRADIENT)].sum() / area.sum())
    if uneven < _GOOD_GRADIENT:
        return d
    return _polished(vertices, faces, d, np.isfinite(near), sound)


def _marched(vertices: Array, faces: Faces, source: Ints, start: Array) -> Array:
    """Return fast-marching distances (v,) from vertices with given distances; inf where they do not lead."""
    used, number = compact(faces, len(vertices))
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[used] = True
    here = is_used[source]
    solver = potpourri3d.MeshFastMarchingDistanceSolver(vertices[used], number[faces])
    curves: list[list[tuple[int, list[float]]]] = [[(int(k), [])] for k in number[source][here]]
    marched = np.asarray(solver.compute_distance(curves, [[float(x)] for x in start[here]], False))
    d = np.full(len(vertices), np.inf)
    d[used] = np.where(np.isfinite(marched) & (marched < 1e30), marched, np.inf)
    return d


def _gradients(vertices: Array, faces: Faces) -> tuple[Array, Array]:
    """Return gradients of the three hat functions (f, 3, 3) and areas (f,)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    twice = np.linalg.norm(n, axis=1)
    safe = np.maximum(twice, 1e-12)[:, None]
    n = n / safe
    g = np.stack([np.cross(n, c - b), np.cross(n, a - c), np.cross(n, b - a)], axis=1) / safe[..., None]
    return g, twice / 2.0


def _polished(vertices: Array, faces: Faces, d: Array, fixed: NDArray[np.bool_], sound: NDArray[np.bool_]) -> Array:
    """Return the field whose gradient follows the averaged directions of `d`; `fixed` vertices keep their values."""
    f = faces[sound]
    gradient, area = _gradients(vertices, f)
    n = len(vertices)
    used = np.zeros(n, dtype=bool)
    used[f] = True
    free = np.flatnonzero(~fixed & used)
    if not len(free):
        return d
    # Off the diagonal one entry per corner of each triangle; rows of a Laplacian sum to nought.
    p, q = f[:, [1, 2, 0]].ravel(), f[:, [2, 0, 1]].ravel()
    across = np.stack(
        [_dot(gradient[:, i], gradient[:, j]) * area for i, j in ((1, 2), (2, 0), (0, 1))], axis=1
    ).ravel()
    diagonal = -(np.bincount(p, across, n) + np.bincount(q, across, n))
    lift = 1e-9 * float(diagonal[free].mean())
    known = np.where(fixed, d, 0.0)
    # What the fixed vertices pull at the others with.
    pull = np.bincount(p, across * known[q], n) + np.bincount(q, across * known[p], n) + diagonal * known
    number = np.full(n, -1, dtype=np.int64)
    number[free] = np.arange(len(free))
    inside = (number[p] >= 0) & (number[q] >= 0)
    i, j, off = number[p[inside]], number[q[inside]], across[inside]
    rows, columns = np.concatenate([i, j, np.arange(len(free))]), np.concatenate([j, i, np.arange(len(free))])
    inner = csc_array((np.concatenate([off, off, diagonal[free] + lift]), (rows, columns)), shape=(len(free),) * 2)
    solve = _factorised(inner)
    spread = csr_array((np.ones(f.size), f.ravel(), np.arange(0, f.size + 1, 3)), shape=(len(f), n))
    gather = (spread.T * area).tocsr()
    corner = vertices[f]
    normal = _unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    u = d.copy()
    for _ in range(_ROUNDS):
        x = _unit(np.einsum("tik,ti->tk", gradient, u[f]))
        for _ in range(_AVERAGES):
            x = spread @ (gather @ x)
            x = _unit(x - normal * _dot(x, normal)[:, None])
        right = -pull
        for k in range(3):
            right += np.bincount(f[:, k], _dot(gradient[:, k], x) * area, n)
        new = u.copy()
        new[free] = solve(right[free] + lift * u[free])
        u = new
    return u


def _factorised(matrix: csc_array) -> Callable[[Array], Array]:
    """Return the solver of a symmetric positive definite matrix; Cholesky, or LU where rounding leaves it indefinite."""
    data, n = igl.min_quad_with_fixed_data(), matrix.shape[0]
    none = np.zeros((0, 1))
    try:
        igl.min_quad_with_fixed_precompute(
            csc_matrix(matrix), np.zeros(0, dtype=np.int64), csc_matrix((0, n)), True, data
        )
    except RuntimeError:
        options = {"SymmetricMode": True}
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve
    # It minimises x.Ax / 2 + b.x.
    return lambda right: np.asarray(igl.min_quad_with_fixed_solve(data, -right[:, None], none, none)[:, 0])


def _unit(x: Array) -> Array:
    return np.asarray(x / np.maximum(lengths(x)[:, None], 1e-12))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])
