"""Distances to flat outlines: signed distance of points to a polygon, and of segments to it."""

import igl
import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

# Pairs of points and sides worked on at a time; more of them are left to a tree.
_PAIRS = 1_000_000


def signed_distance_mm(points: Array, polygon: Array) -> Array:
    """Return the distance (n,), mm, of points (n, 2) from a polygon (m, 2), negative inside; m = 1 is a point.

    Inside is what an odd number of windings encloses: of a polygon that crosses itself, every loop.
    """
    if len(points) * len(polygon) <= _PAIRS:
        away = _away(points, polygon)
    else:
        # Sides as triangles without width: whatever their number, a tree finds the nearest.
        corners = np.column_stack([polygon, np.zeros(len(polygon))])
        start = np.arange(len(polygon))
        end = np.roll(start, -1)
        flat = np.column_stack([points, np.zeros(len(points))])
        away = np.sqrt(igl.point_mesh_squared_distance(flat, corners, np.stack([start, end, end], axis=1))[0])
    return np.where(_inside(points, polygon), -away, away)


def _away(points: Array, polygon: Array) -> Array:
    a, d = polygon, np.roll(polygon, -1, axis=0) - polygon
    length2 = np.maximum(np.einsum("mj,mj->m", d, d), 1e-300)
    off = points[:, None] - a
    t = np.clip(np.einsum("nmj,mj->nm", off, d) / length2, 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - t[..., None] * d, axis=2).min(axis=1))


def _inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Return from which points (n,) a ray along x crosses the outline an odd number of times."""
    order = np.argsort(points[:, 1], kind="stable")
    x, y = points[order].T
    odd = np.zeros(len(points), dtype=bool)
    a, b = polygon, np.roll(polygon, -1, axis=0)
    low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
    # A side spans the points at or above its lower and below its upper end.
    first, last = np.searchsorted(y, low, side="left"), np.searchsorted(y, high, side="left")
    for k in np.flatnonzero(last > first):
        rows = slice(int(first[k]), int(last[k]))
        crossing = a[k, 0] + (y[rows] - a[k, 1]) * (b[k, 0] - a[k, 0]) / (b[k, 1] - a[k, 1])
        odd[rows] ^= x[rows] < crossing
    out = np.zeros(len(points), dtype=bool)
    out[order] = odd
    return out


def segment_distance_mm(start: Array, end: Array, polygon: Array) -> Array:
    """Return the distance (n,), mm, of segments from start to end (n, 2) from a polygon (m, 2); 0 where they meet."""
    rows = max(_PAIRS // len(polygon), 1)
    parts = [_segment_distance_mm(start[k : k + rows], end[k : k + rows], polygon) for k in range(0, len(start), rows)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _segment_distance_mm(start: Array, end: Array, polygon: Array) -> Array:
    out = np.minimum(signed_distance_mm(start, polygon), signed_distance_mm(end, polygon))
    a, b = polygon, np.roll(polygon, -1, axis=0)
    along = end - start
    length2 = np.maximum(np.einsum("nj,nj->n", along, along), 1e-300)
    off = a - start[:, None]
    t = np.clip(np.einsum("nmj,nj->nm", off, along) / length2[:, None], 0.0, 1.0)
    out = np.minimum(out, np.linalg.norm(off - t[..., None] * along[:, None], axis=2).min(axis=1))

    def side(p: Array, q: Array, r: Array) -> Array:
        return np.asarray((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    s, e = start[:, None], end[:, None]
    meets = (side(a, b, s) * side(a, b, e) < 0.0) & (side(s, e, a) * side(s, e, b) < 0.0)
    return np.where(meets.any(axis=1), 0.0, np.maximum(out, 0.0))
