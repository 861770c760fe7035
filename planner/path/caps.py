"""Smooth caps over holes: what the surface would be there if it went on."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial import Delaunay, QhullError

from planner.frames import Array
from planner.path.isolines import Ints
from planner.surface.outlines import signed_distance_mm

# Points inside a cap, and known points around it that it continues, at most.
_INSIDE, _AROUND = 3000, 400
# Points stand off the rim by this share of their spacing.
_OFF = 0.6
_CHUNK = 500


@dataclass(frozen=True, eq=False)
class Cap:
    """points (k, 3): new vertices, mm. faces (c, 3): of vertices of the mesh (below its count) and new ones (from it on)."""

    points: Array
    faces: Ints


def smooth_cap(vertices: Array, loop: Ints, beside: Ints, normal: Array) -> Cap | None:
    """Return a cap over the directed edges loop (m, 2) that faces along `normal` (3,), or None where there is none of the kind.

    Points about as far apart as those of the rim, triangulated in the plane of the rim (Delaunay) and lifted by a thin-plate
    spline through the vertices `beside` (b,) it: the cap goes on with slope and curvature of the surface around it.
    """
    rim = _in_order(loop)
    if rim is None:
        return None
    origin = vertices[rim].mean(axis=0)
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(normal, first), normal], axis=1)
    local = (vertices[rim] - origin) @ frame
    outline = local[:, :2]
    ahead = np.roll(outline, -1, axis=0)
    area = 0.5 * abs(float(np.sum(outline[:, 0] * ahead[:, 1] - ahead[:, 0] * outline[:, 1])))
    spacing = max(float(np.median(np.linalg.norm(ahead - outline, axis=1))), np.sqrt(area / _INSIDE))
    inner = _grid(outline, spacing)
    try:
        triangles = np.asarray(Delaunay(np.concatenate([outline, inner])).simplices, dtype=np.int64)
        known = (vertices[beside] - origin) @ frame
        known = known[:: max(len(known) // _AROUND, 1)]
        height = (
            RBFInterpolator(known[:, :2], known[:, 2], kernel="thin_plate_spline")(inner) if len(inner) else inner[:, 0]
        )
    except (QhullError, np.linalg.LinAlgError, ValueError):
        return None
    flat = np.concatenate([outline, inner])
    triangles = _with_rim(triangles, flat, len(rim))
    corner = flat[triangles]
    triangles = triangles[_inside(corner.mean(axis=1), outline) < 0.0]
    if (
        not _holds(triangles, len(rim))
        or not np.isfinite(height).all()
        or np.abs(height).max(initial=0.0) > spacing + np.sqrt(area)
    ):
        return None
    points = origin + np.column_stack([inner, height]) @ frame.T
    number = np.concatenate([rim, len(vertices) + np.arange(len(inner))])
    return Cap(points, number[triangles])


def _in_order(loop: Ints) -> Ints | None:
    """Return the vertices of a closed curve (m,) in order against its edges (m, 2), or None if it is not a simple one."""
    names, flat = np.unique(loop, return_inverse=True)
    flat = flat.reshape(-1, 2)
    if len(names) != len(loop) or (np.bincount(flat[:, 0]) != 1).any() or (np.bincount(flat[:, 1]) != 1).any():
        return None
    graph = csr_array((np.ones(len(flat), dtype=np.int8), (flat[:, 1], flat[:, 0])), shape=(len(names), len(names)))
    order = breadth_first_order(graph, 0, directed=True, return_predecessors=False)
    return np.asarray(names[order], dtype=np.int64) if len(order) == len(names) else None


def _grid(outline: Array, spacing: float) -> Array:
    """Return points (k, 2) of a triangular grid inside an outline, off its rim."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    rows = np.arange(low[1], high[1] + spacing, spacing * np.sqrt(3.0) / 2.0)
    columns = np.arange(low[0], high[0] + spacing, spacing)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * spacing * (np.arange(len(rows)) % 2)[:, None]
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return points[_inside(points, outline) < -_OFF * spacing]


def _inside(points: Array, outline: Array) -> Array:
    pieces = [signed_distance_mm(points[i : i + _CHUNK], outline) for i in range(0, len(points), _CHUNK)]
    return np.concatenate(pieces) if pieces else np.zeros(0)


def _with_rim(triangles: Ints, points: Array, rim: int) -> Ints:
    """Return the triangles with edges flipped so that those of the rim are among them, where one flip is enough.

    Delaunay leaves out an edge of a jagged rim only where another point lies on the circle over it: there it took the other
    diagonal of the same quadrilateral.
    """
    triangles = triangles.copy()
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    on = ((start < rim) & (end == (start + 1) % rim)) | ((end < rim) & (start == (end + 1) % rim))
    there = np.zeros(rim, dtype=bool)
    there[np.where(end[on] == (start[on] + 1) % rim, start[on], end[on])] = True
    for i in np.flatnonzero(~there).tolist():
        j = (i + 1) % rim
        for row in np.flatnonzero((triangles == i).any(axis=1)).tolist():
            at = int(np.flatnonzero(triangles[row] == i)[0])
            p, q = int(triangles[row, (at + 1) % 3]), int(triangles[row, (at + 2) % 3])
            across = np.flatnonzero(
                (triangles == p).any(axis=1) & (triangles == q).any(axis=1) & (triangles == j).any(axis=1)
            )
            if len(across) and _left(points, i, p, j) and _left(points, i, j, q):
                triangles[row], triangles[int(across[0])] = (i, p, j), (i, j, q)
                break
    return triangles


def _left(points: Array, a: int, b: int, c: int) -> bool:
    u, v = points[b] - points[a], points[c] - points[a]
    return bool(u[0] * v[1] - u[1] * v[0] > 0.0)


def _holds(triangles: Ints, rim: int) -> bool:
    """Return whether every edge of the rim, numbered in order, is an edge of exactly one of the triangles."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    on = (start < rim) & (end == (start + 1) % rim)
    return bool((np.bincount(start[on], minlength=rim) == 1).all())
