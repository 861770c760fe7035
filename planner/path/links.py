"""Moves between passes that stay clear of the part."""

from dataclasses import replace
from typing import Any

import numpy as np

from planner.frames import Array, Transform
from planner.part import Part
from planner.path.detour import Detours
from planner.path.isolines import Ints
from planner.path.passes import CLEARANCE_MM
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of
from planner.surface.solid import solid_of
from planner.toolpath import Role, ToolPath

_STEP_MM = 25.0
_LIFTS = 4
_ALIKE_DEG = 20.0


class _Body:
    """The whole part: how far from it places are, and which way is out."""

    def __init__(self, part: Part) -> None:
        self._solid, self._normals, self.vertices = solid_of(part), part.face_normals, part.vertices

    def height(self, points: Array) -> tuple[Array, Array, Array]:
        """Return the distance (n,), negative behind the nearest triangle, that point (n, 3) and the way out (n, 3)."""
        distance, face, near = self._solid.closest(points)
        normal = self._normals[face]
        offset = points - near
        outside = np.einsum("ij,ij->i", offset, normal) >= 0.0
        out = np.where((outside & (distance > 1e-6))[:, None], offset / np.maximum(distance, 1e-12)[:, None], normal)
        return np.where(outside, distance, -distance), near, out


def with_links(path: ToolPath, curved: CurvedSurface, setup: Setup) -> ToolPath:
    """Return the path with LINK poses where the straight way from one pass to the next would come near the part.

    Short hops between poses that look the same way need none. Elsewhere the straight way is tested in steps; if it comes
    nearer than approach and retract stand, it is lifted off the nearest points of the part, and if even that passes
    through it, led round the part on a sphere. A way over a keep-out that must not be crossed is led beside it.
    """
    leave = np.flatnonzero(path.role == Role.RETRACT)[:-1]
    if not len(leave):
        return path
    ends = path.take(np.stack([leave, leave + 1], axis=1).ravel())
    tcp = ends.Ts_part_tcp
    p, z = tcp.xyz_mm, -tcp.rotation_matrix[:, :, 2]
    gap = np.linalg.norm(p[1::2] - p[0::2], axis=1)
    alike = np.einsum("ij,ij->i", z[0::2], z[1::2]) > np.cos(np.radians(_ALIKE_DEG))
    near = alike & (gap < CLEARANCE_MM)
    detours = Detours.of(keep_outs_of(curved.surface, setup).columns, setup)
    doubtful = np.flatnonzero(~near | detours.crossed(p[0::2], p[1::2], z[0::2], z[1::2]))
    if not len(doubtful):
        return path
    body = _Body(curved.surface.part)
    need = 0.9 * (float(path.standoff_mm[path.is_data].min()) + CLEARANCE_MM)
    points, ups, after = [], [], []
    for i in doubtful:
        a, b = p[2 * i], p[2 * i + 1]
        way = np.zeros((0, 3)) if near[i] else _way(body, a, b, z[2 * i], z[2 * i + 1], need)
        up = np.concatenate([z[2 * i][None], _upwards(body, way), z[2 * i + 1][None]])
        if detours.blocks(np.concatenate([a[None], way, b[None]]), up):
            way = _beside(body, detours, a, b, z[2 * i], z[2 * i + 1], need)
        if len(way):
            points.append(way)
            ups.append(_upwards(body, way))
            after.append(np.full(len(way), leave[i]))
    if not points:
        return path
    return _insert(path, np.concatenate(points), np.concatenate(ups), np.concatenate(after))


def _beside(body: _Body, detours: Detours, a: Array, b: Array, za: Array, zb: Array, need: float) -> Array:
    """Return the points to travel through from a to b beside what must not be crossed; clear of the part as well."""

    def lifted(points: Array) -> Array:
        for _ in range(_LIFTS):
            height, near, out = body.height(points)
            short = height < need
            points = np.where(short[:, None], near + out * need * 1.05, points)
        return points

    turns = detours.way(a, b, lifted)
    stops = np.concatenate([a[None], turns, b[None]])
    up = np.concatenate([za[None], _upwards(body, turns), zb[None]])
    legs = []
    for k in range(len(stops) - 1):
        legs += [_way(body, stops[k], stops[k + 1], up[k], up[k + 1], need), stops[k + 1][None]]
    return np.concatenate(legs[:-1]) if legs else turns


def _between(a: Array, b: Array, step: float) -> Array:
    count = max(int(np.ceil(np.linalg.norm(b - a) / step)), 2)
    t = np.arange(1, count)[:, None] / count
    return a + t * (b - a)


def _clear(body: _Body, way: Array, need: float) -> bool:
    """Return whether the polyline (n, 3) keeps its distance all along."""
    fine = np.concatenate([_between(way[i], way[i + 1], _STEP_MM / 5.0) for i in range(len(way) - 1)])
    return bool((body.height(fine)[0] >= need).all())


def _way(body: _Body, a: Array, b: Array, za: Array, zb: Array, need: float) -> Array:
    """Return the points to travel through from a to b (k, 3); none if the straight way is clear."""
    low = 0.8 * min(need, float(body.height(np.stack([a, b]))[0].min()))
    if _clear(body, np.stack([a, b]), low):
        return np.zeros((0, 3))
    points = _between(a, b, _STEP_MM)
    for _ in range(_LIFTS):
        height, near, out = body.height(points)
        short = height < need
        if not short.any():
            break
        points[short] = near[short] + out[short] * need * 1.05
    if _clear(body, np.concatenate([a[None], points, b[None]]), 0.6 * need):
        return points
    return _round(body, a, b, za, zb, need)


def _round(body: _Body, a: Array, b: Array, za: Array, zb: Array, need: float) -> Array:
    """Return a way up to a sphere around the part, along it, and down again."""
    lo, hi = body.vertices.min(axis=0), body.vertices.max(axis=0)
    centre, radius = (lo + hi) / 2.0, float(np.linalg.norm(hi - lo)) / 2.0 + need
    start, end = (_exit(q - centre, z, radius) for q, z in ((a, za), (b, zb)))
    u = start / radius
    side = end / radius - u * float(u @ end) / radius
    if np.linalg.norm(side) < 1e-6:
        side = np.cross(u, np.eye(3)[int(np.argmin(np.abs(u)))])
    side /= np.linalg.norm(side)
    angle = float(np.arctan2(side @ end, u @ end))
    t = np.linspace(0.0, angle, max(int(np.ceil(abs(angle) / np.radians(10.0))), 1) + 1)[:, None]
    return np.asarray(centre + radius * (np.cos(t) * u + np.sin(t) * side))


def _exit(q: Array, z: Array, radius: float) -> Array:
    """Return where the ray from q along z meets the sphere of this radius about the origin."""
    along = float(q @ z)
    inside = along * along - float(q @ q) + radius * radius
    return q + z * (-along + np.sqrt(max(inside, 0.0)))


def _upwards(body: _Body, way: Array) -> Array:
    return body.height(way)[2] if len(way) else np.zeros((0, 3))


def _insert(path: ToolPath, points: Array, ups: Array, after: Ints) -> ToolPath:
    """Return the path with LINK poses of TCP positions `points`, contact z along `ups`, behind the poses `after`."""
    x0 = path.Ts_part_contact.rotation_matrix[after][:, :, 0]
    x = x0 - np.einsum("ij,ij->i", x0, ups)[:, None] * ups
    weak = np.linalg.norm(x, axis=1) < 0.1
    y0 = path.Ts_part_contact.rotation_matrix[after][:, :, 1]
    x[weak] = np.cross(y0, ups)[weak]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    standoff = np.full(len(points), float(path.standoff_mm.max()))
    links = Transform.from_axes("part", "contact", x, np.cross(ups, x), ups, points - standoff[:, None] * ups)
    n, k = len(path), len(points)
    order = np.argsort(np.concatenate([np.arange(n), after + 0.5]), kind="stable")
    rigid = type(links.rigid).concatenate([path.Ts_part_contact.rigid, links.rigid])
    frames = Transform("part", "contact", rigid[order])
    more = {
        "standoff_mm": standoff,
        "heading": path.heading[after],
        "pass_id": path.pass_id[after],
        "role": np.full(k, int(Role.LINK), dtype=np.uint8),
        "face": np.full(k, -1, dtype=np.int32),
        "bary": np.zeros((k, 3)),
    }
    arrays: dict[str, Any] = {name: np.concatenate([getattr(path, name), x])[order] for name, x in more.items()}
    return replace(path, Ts_part_contact=frames, **arrays)
