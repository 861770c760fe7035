"""Distances to flat outlines: signed distance of points to a polygon, and of segments to it."""

import numpy as np

from planner.frames import Array


def signed_distance_mm(points: Array, polygon: Array) -> Array:
    """Return the distance (n,), mm, of points (n, 2) from a simple polygon (m, 2), negative inside; m = 1 is a point."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    d = b - a
    length2 = np.maximum(np.einsum("mj,mj->m", d, d), 1e-300)
    off = points[:, None] - a
    t = np.clip(np.einsum("nmj,mj->nm", off, d) / length2, 0.0, 1.0)
    away = np.linalg.norm(off - t[..., None] * d, axis=2).min(axis=1)
    # A point is inside if a ray along x crosses the outline an odd number of times.
    spans = (a[:, 1] > points[:, 1, None]) != (b[:, 1] > points[:, 1, None])
    rise = np.where(d[:, 1] == 0.0, 1.0, d[:, 1])
    crossing = a[:, 0] + (points[:, 1, None] - a[:, 1]) * d[:, 0] / rise
    inside = np.count_nonzero(spans & (points[:, 0, None] < crossing), axis=1) % 2 == 1
    return np.where(inside, -away, away)


def segment_distance_mm(start: Array, end: Array, polygon: Array) -> Array:
    """Return the distance (n,), mm, of segments from start to end (n, 2) from a simple polygon (m, 2); 0 where they meet."""
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
