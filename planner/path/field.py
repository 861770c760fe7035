"""Distance measured on the surface from a guide line: fast marching, polished where the triangles are uneven."""

import numpy as np
import potpourri3d
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from planner.errors import fail
from planner.frames import Array
from planner.part import Faces
from planner.path.isolines import Ints

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
    used, compact = np.unique(faces, return_inverse=True)
    number = np.full(len(vertices), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    here = number[source] >= 0
    solver = potpourri3d.MeshFastMarchingDistanceSolver(vertices[used], compact.reshape(-1, 3))
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
    element = np.einsum("tik,tjk,t->tij", gradient, gradient, area)
    rows, columns = np.repeat(f, 3, axis=1).ravel(), np.tile(f, (1, 3)).ravel()
    laplace = csc_array((element.ravel(), (rows, columns)), shape=(n, n))
    inner = laplace[free][:, free]
    lift = 1e-9 * float(inner.diagonal().mean())
    inner = inner + csc_array((np.full(len(free), lift), (np.arange(len(free)),) * 2), shape=inner.shape)
    solver = splu(inner.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    gather = csr_array((np.repeat(area, 3), (f.ravel(), np.repeat(np.arange(len(f)), 3))), shape=(n, len(f)))
    corner = vertices[f]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u = d.copy()
    for _ in range(_ROUNDS):
        x = _unit(np.einsum("tik,ti->tk", gradient, u[f]))
        for _ in range(_AVERAGES):
            w = gather @ x
            x = w[f[:, 0]] + w[f[:, 1]] + w[f[:, 2]]
            x = _unit(x - normal * np.einsum("ij,ij->i", x, normal)[:, None])
        flow = np.einsum("tik,tk->ti", gradient, x) * area[:, None]
        right = np.bincount(f.ravel(), flow.ravel(), n) - laplace @ np.where(fixed, u, 0.0)
        new = u.copy()
        new[free] = solver.solve(right[free] + lift * u[free])
        u = new
    return u


def _unit(x: Array) -> Array:
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-12))
