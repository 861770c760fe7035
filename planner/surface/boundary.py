"""The edges of the inspection surface: closed curves, what lies beyond them, and the distance to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from weakref import WeakKeyDictionary

import igl
import numpy as np
import potpourri3d
from numpy.typing import NDArray

from planner.frames import Array
from planner.surface.inspection import InspectionSurface
from planner.surface.loops import successors
from planner.surface.normals import unit
from planner.surface.select import part_edges, welded_faces
from planner.surface.topology import Index, edges_of

# Faces of the part that continue within this of flat are neither up nor down: the part goes on (a chosen limit, say).
LEVEL_DEG = 1.0
# First-order marching over irregular triangles is at most this much too long.
MARCH_ERROR = 0.03


class EdgeKind(IntEnum):
    """What the part does beyond a segment of the boundary."""

    FREE = 0
    """Nothing: the sheet ends there."""
    CONVEX = 1
    """It falls away: the part ends there, as seen by the probe."""
    CONCAVE = 2
    """It goes on, level or upwards: a wall, a step, or the limit of the region chosen."""


@dataclass(frozen=True, eq=False)
class BoundaryCurve:
    """A closed polyline of m points (last joins first), surface on its left seen from outside; frame `part`, mm.

    points (m, 3). kind (m,): `EdgeKind` of the segment from point i to i + 1. conormals (m, 3): unit, at the points, in
    the surface and pointing out of it. segment_conormals (m, 3): the same for segments. faces (m,): row of `surface.faces`
    at the segment. vertices (m,): rows of `surface.vertices`. outer: False for a hole (on an open surface).
    """

    points: Array
    kind: NDArray[np.uint8]
    conormals: Array
    segment_conormals: Array
    faces: NDArray[np.int32]
    vertices: NDArray[np.int64]
    outer: bool

    def __len__(self) -> int:
        return len(self.points)

    @property
    def length_mm(self) -> float:
        """Length of the closed polyline (mm)."""
        return float(np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1).sum())


def boundary(surface: InspectionSurface) -> tuple[BoundaryCurve, ...]:
    """Return the closed boundary curves of a surface, longest first; none for a closed body.

    Where curves touch in a vertex they are walked as one visits the surface around it, so that none crosses itself. Kept
    as long as the surface lives.
    """
    known = _KNOWN.get(surface)
    if known is None:
        known = _KNOWN[surface] = _boundary(surface)
    return known


_KNOWN: "WeakKeyDictionary[InspectionSurface, tuple[BoundaryCurve, ...]]" = WeakKeyDictionary()


def _boundary(surface: InspectionSurface) -> tuple[BoundaryCurve, ...]:
    faces = welded_faces(surface.part)[surface.part_faces]
    edges = edges_of(faces)
    face, corner = np.nonzero(edges.is_boundary[edges.of_face])
    if not len(face):
        return ()
    start, end = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
    follow = successors(faces, edges.of_face, edges.is_boundary, face, corner)
    original = surface.faces[face, (corner + 1) % 3].astype(np.int64)
    kinds = _kinds(surface, start, end, face)
    seen = np.zeros(len(face), dtype=bool)
    curves: list[BoundaryCurve] = []
    for first in range(len(face)):
        if seen[first]:
            continue
        loop = []
        at = first
        while not seen[at]:
            seen[at] = True
            loop.append(at)
            at = int(follow[at])
        curves.append(_curve(surface, np.array(loop), face, original, kinds))
    curves.sort(key=lambda c: -c.length_mm)
    return tuple(curves)


def _kinds(surface: InspectionSurface, start: Index, end: Index, face: Index) -> NDArray[np.uint8]:
    """Return the `EdgeKind` of boundary half-edges from welded vertex `start` to `end` of surface row `face` (m,)."""
    part = surface.part
    all_faces = welded_faces(part)
    edges = part_edges(part)
    span = int(all_faces.max()) + 1
    keys = edges.vertices[:, 0] * span + edges.vertices[:, 1]
    edge = np.searchsorted(keys, np.minimum(start, end) * span + np.maximum(start, end))
    own = surface.part_faces[face].astype(np.int64)
    other = np.where(edges.first[edge] == own, edges.second[edge], edges.first[edge])
    kind = np.full(len(face), int(EdgeKind.FREE), dtype=np.uint8)
    has = edges.uses[edge] >= 2
    # Height of the neighbour's third corner over the plane of our face, as an angle.
    o = other[has]
    corners = part.vertices[part.faces[o]]
    welded = all_faces[o]
    apex_at = np.argmax((welded != start[has, None]) & (welded != end[has, None]), axis=1)
    apex = corners[np.arange(len(o)), apex_at]
    base = surface.vertices[surface.faces[face[has], 0]]
    rise = np.einsum("ij,ij->i", apex - base, part.face_normals[own[has]])
    along = corners[np.arange(len(o)), (apex_at + 2) % 3] - corners[np.arange(len(o)), (apex_at + 1) % 3]
    height = 2.0 * part.face_areas_mm2[o] / np.maximum(np.linalg.norm(along, axis=1), 1e-30)
    falls = rise < -np.sin(np.radians(LEVEL_DEG)) * height
    kind[has] = np.where(falls, int(EdgeKind.CONVEX), int(EdgeKind.CONCAVE))
    return kind


def _curve(
    surface: InspectionSurface, loop: Index, face: Index, original: Index, kinds: NDArray[np.uint8]
) -> BoundaryCurve:
    vertices = original[loop]
    points = surface.vertices[vertices]
    along = np.roll(points, -1, axis=0) - points
    outward = unit(np.cross(along, surface.face_normals[face[loop]]))
    # At a point: the mean of the two segments, the longer no stronger than the shorter.
    at_points = unit(outward + np.roll(outward, 1, axis=0))
    return BoundaryCurve(
        points,
        kinds[loop],
        at_points,
        outward,
        face[loop].astype(np.int32),
        vertices,
        _is_outer(surface, points, face[loop]),
    )


def _is_outer(surface: InspectionSurface, points: Array, face: Index) -> bool:
    """Return whether a loop runs counter-clockwise about the mean normal of its faces: around the surface, not a hole."""
    normal = surface.face_areas_mm2[face] @ surface.face_normals[face]
    closed = np.roll(points, -1, axis=0)
    centre = points.mean(axis=0)
    area = 0.5 * np.cross(points - centre, closed - centre).sum(axis=0)
    return bool(area @ normal > 0.0)


def edge_distance_mm(curves: Sequence[BoundaryCurve], points_part: Array) -> Array:
    """Return the straight distance of points (n, 3) to the nearest segment of the boundary (n,), mm; inf without one.

    On a smooth surface it is short of the distance along the surface by d^3 / (24 R^2): 0.02 mm at 10 mm and R 50 mm.
    """
    points = np.ascontiguousarray(points_part, dtype=np.float64).reshape(-1, 3)
    if not curves:
        return np.full(len(points), np.inf)
    vertices = np.concatenate([c.points for c in curves])
    first = np.cumsum([0] + [len(c) for c in curves])[:-1]
    segments = np.concatenate(
        [
            start + np.stack([np.arange(len(c)), np.roll(np.arange(len(c)), -1)], axis=1)
            for c, start in zip(curves, first, strict=True)
        ]
    )
    squared, _, _ = igl.point_mesh_squared_distance(points, vertices, segments.astype(np.int64))
    return np.sqrt(np.asarray(squared).reshape(-1))


def distance_to_boundary(surface: InspectionSurface) -> Array:
    """Return the distance along the surface from every vertex to the boundary (v,), mm; inf for a closed body.

    Fast marching over the triangles (Kimmel and Sethian 1998, doi:10.1073/pnas.95.15.8431) from the vertices next to the
    boundary, which start at their straight distance to its segments; never below the straight distance, and longer only by
    what exceeds the error of marching (3 %), so that margins err on the side of the part. Of a coarse mesh, whose vertices
    all lie on the boundary, ask `edge_distance_mm` at the points that matter instead.
    """
    curves = boundary(surface)
    straight = edge_distance_mm(curves, surface.vertices)
    if not curves:
        return straight
    label = surface.welded
    vertices = np.zeros((int(label.max()) + 1, 3))
    vertices[label] = surface.vertices
    near = np.full(len(vertices), np.inf)
    np.minimum.at(near, label, straight)
    faces = label[surface.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    edges = edges_of(faces)
    on = np.zeros(len(vertices), dtype=bool)
    on[edges.vertices[edges.is_boundary].ravel()] = True
    start = np.unique(faces[on[faces].any(axis=1)])
    marched = _march(vertices, faces, start, near[start])
    # What marching adds over the straight line counts only beyond its own error on irregular triangles.
    detour = np.maximum(marched - near - (MARCH_ERROR * near + np.median(near[start])), 0.0)
    return np.asarray((near + detour)[label])


def _march(vertices: Array, faces: Array, start: Array, distances: Array) -> Array:
    used, compact = np.unique(faces, return_inverse=True)
    solver = potpourri3d.MeshFastMarchingDistanceSolver(vertices[used], compact.reshape(-1, 3))
    row = np.searchsorted(used, start)
    curves: list[list[tuple[int, list[float]]]] = [[(int(v), [])] for v in row]
    result = np.full(len(vertices), np.inf)
    result[used] = solver.compute_distance(curves, [[float(d)] for d in distances])
    return result
