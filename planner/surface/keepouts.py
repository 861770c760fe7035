"""Keep-out regions on a surface: how far points lie from them, and the columns above those that must not be crossed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from planner.errors import fail
from planner.frames import Array
from planner.part import Part
from planner.setup import Setup
from planner.shapes import BoxKeepOut, DiscKeepOut, FacesKeepOut, KeepOut, PolygonKeepOut, SphereKeepOut
from planner.surface.inspection import InspectionSurface
from planner.surface.normals import tangent_frames, unit
from planner.surface.outlines import segment_distance_mm, signed_distance_mm

PARENTS = "parent_faces"
"""Key of `Part.meta` of a part whose triangles were cut finer: the row of the triangle as read, of each."""
# A disc or polygon reaches this far off its plane at least (mm), or small ones would miss a curved surface.
_LEAST_DEPTH_MM = 5.0
# On triangles given by number: nearer than this beside them (mm, and as a share of the height over them) is on them.
_ON_MM, _OVER = 1e-6, 0.1
_FAR_MM = 50.0
# Points worked on at a time.
_ROWS = 4096


@dataclass(frozen=True, eq=False)
class Column:
    """What stands above a keep-out: a prism along `up` (3,) over an outline, from its foot to its top; mm, `part`.

    outline (m, 2): corners in the axes first, second (3,) about `origin` (3,); the prism is this wide and `radius_mm`
    more. foot_mm, top_mm: where it begins and ends along `up`; one without end has an infinite top.
    """

    name: str
    origin: Array
    up: Array
    first: Array
    second: Array
    outline: Array
    radius_mm: float
    foot_mm: float
    margin_mm: float
    top_mm: float = np.inf

    def flat(self, points: Array) -> Array:
        """Return points (n, 3) in the plane of the outline (n, 2)."""
        d = points - self.origin
        return np.stack([d @ self.first, d @ self.second], axis=-1)

    def gap_mm(self, tip: Array, tail: Array, radius_mm: float) -> Array:
        """Return how far rods from tip to tail (n, 3), this thick, stay beside the column (n,), mm; inf below and above it."""
        low, high = ((p - self.origin) @ self.up - self.foot_mm + radius_mm for p in (tip, tail))
        under = np.maximum(low, high) < 0.0
        # Only what of the rod stands above the foot counts.
        start, end = self._beyond(tip, tail, low, high)
        if np.isfinite(self.top_mm):
            d = tail - tip
            lean2 = 1.0 - (d @ self.up) ** 2 / np.maximum(np.einsum("ij,ij->i", d, d), 1e-12)
            # The ends of a rod are flat: leaning, their rims hang below their middles.
            hang = radius_mm * np.sqrt(np.maximum(lean2, 0.0))
            low, high = (self.top_mm - (p - self.origin) @ self.up + hang for p in (start, end))
            under |= np.maximum(low, high) < 0.0
            start, end = self._beyond(start, end, low, high)
        gap = segment_distance_mm(self.flat(start), self.flat(end), self.outline) - self.radius_mm - radius_mm
        return np.where(under, np.inf, gap)

    def _beyond(self, a: Array, b: Array, at_a: Array, at_b: Array) -> tuple[Array, Array]:
        """Return what of the ways from a to b (n, 3) lies where a height, at_a to at_b (n,), is not negative."""
        span = np.where(np.abs(at_b - at_a) > 1e-12, at_b - at_a, 1.0)
        zero = a + np.clip(-at_a / span, 0.0, 1.0)[:, None] * (b - a)
        return np.where((at_a < 0.0)[:, None], zero, a), np.where((at_b < 0.0)[:, None], zero, b)

    def ball_gap_mm(self, centres: Array, radius_mm: float) -> Array:
        """Return how far balls about centres (n, 3), this large, stay off the column (n,), mm; negative where they touch."""
        height = (centres - self.origin) @ self.up
        end = np.maximum(self.foot_mm - height, height - self.top_mm)
        return _prism(signed_distance_mm(self.flat(centres), self.outline) - self.radius_mm, end) - radius_mm


@dataclass(frozen=True, eq=False)
class KeepOuts:
    """The keep-out regions of a setup on one part.

    shapes: as given. up (k, 3): outward normal of the surface at each. nozzle_mm: radius of the nozzle; standoff_mm: the
    least at which it passes.
    """

    part: Part
    shapes: tuple[KeepOut, ...]
    up: Array
    nozzle_mm: float
    standoff_mm: float = np.inf

    def __len__(self) -> int:
        return len(self.shapes)

    def gaps_mm(self, points: Array) -> Array:
        """Return the distance (k, n), mm, of points (n, 3) on the surface from each region, negative inside."""
        out = np.zeros((len(self), len(points)))
        round_ = [i for i, s in enumerate(self.shapes) if isinstance(s, SphereKeepOut | DiscKeepOut)]
        for start in range(0, len(points), _ROWS):
            rows = slice(start, start + _ROWS)
            out[round_, rows] = self._round_gaps(round_, points[rows])
        for i, shape in enumerate(self.shapes):
            if not isinstance(shape, SphereKeepOut | DiscKeepOut):
                out[i] = self._gap(i, points)
        return out

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) of the surface lie in a region (n,)."""
        return np.asarray((self.gaps_mm(points) < 0.0).any(axis=0))

    def room_mm(self, points: Array, ahead_mm: float = 0.0, give_mm: float = 0.0) -> Array:
        """Return how much more than they must points (n, 3) keep from the regions (n,), mm; negative: too near.

        A TCP that takes data keeps `margin_mm`, of which `give_mm` may be used up, but stays outside. From what must not be
        crossed it keeps as much beside the nozzle, and where a pass ends `ahead_mm` more, for the nozzle runs on.
        """
        if not len(self):
            return np.full(len(points), np.inf)
        return np.asarray(self.each_room_mm(points, ahead_mm, give_mm).min(axis=0))

    def each_room_mm(
        self, points: Array, ahead_mm: float = 0.0, give_mm: float = 0.0, gaps_mm: Array | None = None
    ) -> Array:
        """Return the same for every region (k, n); gaps_mm: those of the points, if they are known already."""
        out = self.gaps_mm(points) if gaps_mm is None else gaps_mm.copy()
        for i, shape in enumerate(self.shapes):
            need = max(shape.margin_mm - give_mm, 0.0)
            out[i] -= shape.margin_mm + self.nozzle_mm + ahead_mm if self._in_the_way(shape) else need
        return out

    @property
    def smallest_mm(self) -> float:
        """Width (mm) of the narrowest region with its margin, roughly: what a walk must not step over."""
        sizes = [max(_size_mm(s) + 2.0 * s.margin_mm, 0.2) for s in self.shapes]
        return min(sizes, default=np.inf)

    def _in_the_way(self, shape: KeepOut) -> bool:
        """Return whether a nozzle that takes data has to pass beside: over it is forbidden, or lower than it is high."""
        high = shape.height_mm is not None and shape.height_mm + shape.margin_mm > self.standoff_mm
        return not shape.may_cross or high

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """What the nozzle keeps off: without end above regions that must not be crossed, as high as they are above others."""
        return tuple(
            self._column(i, None if s.may_cross else np.inf)
            for i, s in enumerate(self.shapes)
            if not s.may_cross or s.height_mm
        )

    @cached_property
    def obstacles(self) -> tuple[Column, ...]:
        """What stands on the regions whose height is known, as high as it is."""
        return tuple(self._column(i, None) for i, s in enumerate(self.shapes) if s.height_mm)

    def label(self, index: int) -> str:
        """Return what to call a region."""
        return self.shapes[index].name or f"keep-out {index + 1}"

    def _round_gaps(self, index: list[int], points: Array) -> Array:
        """Return the distances (k, n) of points from spheres and discs, all at once: there may be hundreds."""
        shapes = [s for i in index if isinstance(s := self.shapes[i], SphereKeepOut | DiscKeepOut)]
        centre = np.array([s.centre_mm for s in shapes]).reshape(-1, 3)
        radius = np.array([s.radius_mm for s in shapes])[:, None]
        d = points[None] - centre[:, None]
        away2 = np.einsum("knj,knj->kn", d, d)
        out = np.asarray(np.sqrt(away2) - radius)
        disc = np.array([isinstance(s, DiscKeepOut) for s in shapes], dtype=bool)
        if disc.any():
            height = np.einsum("knj,kj->kn", d[disc], self.up[index][disc])
            side = np.sqrt(np.maximum(away2[disc] - height**2, 0.0)) - radius[disc]
            out[disc] = _prism(side, np.abs(height) - np.maximum(radius[disc], _LEAST_DEPTH_MM))
        return out

    def _gap(self, index: int, points: Array) -> Array:
        shape, up = self.shapes[index], self.up[index]
        if isinstance(shape, BoxKeepOut):
            low, high = np.array(shape.min_mm), np.array(shape.max_mm)
            over = np.maximum(low - points, points - high)
            return np.asarray(np.linalg.norm(np.maximum(over, 0.0), axis=1) + np.minimum(over.max(axis=1), 0.0))
        if isinstance(shape, PolygonKeepOut):
            corners = np.array(shape.points_mm)
            d, frame = points - corners.mean(axis=0), np.stack(_frame(up), axis=1)
            flat, outline = d @ frame, (corners - corners.mean(axis=0)) @ frame
            # From afar the distance of the bounds will do: it is never more.
            low, high = outline.min(axis=0), outline.max(axis=0)
            side = np.linalg.norm(np.maximum(np.maximum(low - flat, flat - high), 0.0), axis=1)
            near = side < 2.0 * (shape.margin_mm + self.nozzle_mm) + _FAR_MM
            side[near] = signed_distance_mm(flat[near], outline)
            return _prism(side, np.abs(d @ up) - shape.depth_mm)
        vertices, faces, tree = self._tree(index)
        # From afar the distance of the bounds will do: it is never more.
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        out = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
        near = np.flatnonzero(out < 2.0 * (shape.margin_mm + self.nozzle_mm) + _FAR_MM)
        if len(near):
            at = np.ascontiguousarray(points[near])
            _, face, foot = tree.squared_distance(vertices, faces, at)
            normal = unit(np.cross(*(vertices[faces[face, k]] - vertices[faces[face, 0]] for k in (1, 2))))
            offset = at - foot
            height = np.einsum("ij,ij->i", offset, normal)
            beside = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset) - height**2, 0.0))
            # The smooth surface runs above or below the triangles; over them is on them.
            out[near] = np.where(beside <= _ON_MM + _OVER * np.abs(height), -_ON_MM, beside)
        return out

    def _tree(self, index: int) -> tuple[Array, NDArray[np.int64], Any]:
        known = self._trees.get(index)
        if known is None:
            vertices, faces = self.triangles(index)
            tree = igl.AABB()
            tree.init(vertices, faces)
            known = self._trees[index] = (vertices, faces, tree)
        return known

    @cached_property
    def _trees(self) -> dict[int, tuple[Array, NDArray[np.int64], Any]]:
        return {}

    def triangles(self, index: int) -> tuple[Array, NDArray[np.int64]]:
        """Return vertices (v, 3) and faces (f, 3) of a region that was given as triangles."""
        shape = self.shapes[index]
        assert isinstance(shape, FacesKeepOut)
        rows = _rows_of(self.part, shape, self.label(index), index)
        used, compact = np.unique(self.part.faces[rows], return_inverse=True)
        return np.ascontiguousarray(self.part.vertices[used]), compact.reshape(-1, 3).astype(np.int64)

    def _tight(self, box: BoxKeepOut) -> Array:
        """Return the bounds (2, 3) of what of the part lies in a box: how deep a box was drawn says nothing about it."""
        corners = self.part.vertices[self.part.faces]
        low, high = np.array(box.min_mm), np.array(box.max_mm)
        meets = ((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)
        if not meets.any():
            return np.stack([low, high])
        inside = np.clip(corners[meets].reshape(-1, 3), low, high)
        return np.stack([inside.min(axis=0), inside.max(axis=0)])

    def _column(self, index: int, top_mm: float | None) -> Column:
        """Return the column above a region, up to a top; None: as high as the region says it is."""
        shape, up = self.shapes[index], self.up[index]
        first, second = _frame(up)
        radius = 0.0
        if isinstance(shape, SphereKeepOut | DiscKeepOut):
            corners, radius = np.array([shape.centre_mm]), shape.radius_mm
        elif isinstance(shape, PolygonKeepOut):
            corners = np.array(shape.points_mm)
        elif isinstance(shape, BoxKeepOut):
            corners = trimesh.bounds.corners(self._tight(shape))
        else:
            corners = self.triangles(index)[0]
        origin = corners.mean(axis=0)
        flat = np.stack([(corners - origin) @ first, (corners - origin) @ second], axis=1)
        if not isinstance(shape, PolygonKeepOut) and len(flat) > 3:
            flat = _hull(flat)
        heights = (corners - origin) @ up
        foot = float(heights.min()) - radius
        top = float(heights.max()) + (shape.height_mm or 0.0) if top_mm is None else top_mm
        return Column(self.label(index), origin, up, first, second, flat, radius, foot, shape.margin_mm, top)


_KNOWN: "WeakKeyDictionary[InspectionSurface, tuple[object, KeepOuts]]" = WeakKeyDictionary()


def keep_outs_of(surface: InspectionSurface, setup: Setup) -> KeepOuts:
    """Return the keep-out regions of a setup on a surface; kept as long as the surface lives.

    Raises EchoBaseError `keep-out-faces` for triangles that the part does not have.
    """
    standoff = min(setup.standoff_mm, setup.alignment_standoff_mm)
    key = (setup.inspection.keep_outs, setup.tool.nozzle_radius_mm, standoff)
    known = _KNOWN.get(surface)
    if known is None or known[0] != key:
        nearest = _Nearest(surface)
        up = np.array([_up(surface, nearest, s, i) for i, s in enumerate(key[0])]).reshape(-1, 3)
        known = _KNOWN[surface] = (key, KeepOuts(surface.part, key[0], up, key[1], standoff))
    return known[1]


def _up(surface: InspectionSurface, nearest: "_Nearest", shape: KeepOut, index: int) -> Array:
    """Return the outward normal of the surface at a region: of its own triangles, or of the one nearest to its middle."""
    part = surface.part
    if isinstance(shape, FacesKeepOut):
        rows = _rows_of(part, shape, shape.name or f"keep-out {index + 1}", index)
        return np.asarray(unit((part.face_areas_mm2[rows] @ part.face_normals[rows])[None])[0])
    if isinstance(shape, PolygonKeepOut):
        corners = np.array(shape.points_mm)
        # The plane that fits them best: a polygon may cross itself.
        _, size, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        normal = axes[2]
        if not size[1] > 1e-6 * size[0]:
            raise fail(
                "keep-out-flat", "The corners of a keep-out polygon lie on a line.", "Correct it.", _where(index)
            )
        near = nearest.normal(corners.mean(axis=0))
        return np.asarray(unit(np.where(normal @ near < 0.0, -normal, normal)[None])[0])
    middle = 0.5 * (np.array(shape.min_mm) + shape.max_mm) if isinstance(shape, BoxKeepOut) else shape.centre_mm
    return nearest.normal(np.array(middle))


class _Nearest:
    """Normals of the triangles nearest to a few places, without a search tree over all of them."""

    def __init__(self, surface: InspectionSurface) -> None:
        self._surface = surface

    @cached_property
    def _balls(self) -> tuple[Array, Array, Array]:
        corners = self._surface.vertices[self._surface.faces]
        centre = corners.mean(axis=1)
        reach = np.sqrt(np.einsum("fkj,fkj->fk", *(2 * [corners - centre[:, None]])).max(axis=1))
        return corners, centre, reach

    def normal(self, point: Array) -> Array:
        """Return the unit outward normal (3,) at the place of the surface nearest to a point (3,)."""
        corners, centre, reach = self._balls
        offset = centre - point
        away = np.sqrt(np.einsum("ij,ij->i", offset, offset))
        near = np.flatnonzero(away - reach <= away.min())
        closest = trimesh.triangles.closest_point(corners[near], np.tile(point, (len(near), 1)))
        gap = np.linalg.norm(closest - point, axis=1)
        alike = near[gap <= gap.min() + 1e-6]
        rows = self._surface.part_faces[alike]
        part = self._surface.part
        return np.asarray(unit((part.face_areas_mm2[rows] @ part.face_normals[rows])[None])[0])


def _rows_of(part: Part, shape: FacesKeepOut, name: str, index: int) -> NDArray[np.intp]:
    parents = part.meta.get(PARENTS)
    count = len(part.faces) if parents is None else int(parents.max()) + 1
    if max(shape.faces) >= count:
        raise fail(
            "keep-out-faces",
            f"{name} names triangle {max(shape.faces)}, but the part has {count}.",
            "Paint it again: the part was changed or meshed anew.",
            _where(index),
        )
    wanted = np.unique(np.array(shape.faces))
    return wanted if parents is None else np.flatnonzero(np.isin(parents, wanted))


def _where(index: int) -> str:
    return f"setup.json: inspection.keep_outs[{index}]"


def _size_mm(shape: KeepOut) -> float:
    if isinstance(shape, SphereKeepOut | DiscKeepOut):
        return 2.0 * shape.radius_mm
    if isinstance(shape, BoxKeepOut):
        return float(np.sort(np.subtract(shape.max_mm, shape.min_mm))[1])
    if isinstance(shape, PolygonKeepOut):
        return float(np.linalg.svd(np.array(shape.points_mm) - np.mean(shape.points_mm, axis=0))[1][1])
    return 0.0


def _prism(side: Array, end: Array) -> Array:
    outside = np.hypot(np.maximum(side, 0.0), np.maximum(end, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(side, end), 0.0))


def _frame(up: Array) -> tuple[Array, Array]:
    first, second = tangent_frames(up[None])
    return first[0], second[0]


def _hull(flat: Array) -> Array:
    try:
        return flat[ConvexHull(flat).vertices]
    except QhullError:
        return flat[[int(flat[:, 0].argmin()), int(flat[:, 0].argmax())]]
