"""The edges of the inspection surface: closed curves, what lies beyond them, and the distance to them."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.surface.inspection import InspectionSurface
from planner.surface.normals import unit
from planner.surface.select import welded_faces
from planner.surface.topology import Index, edges_of

# Faces of the part that continue within this of flat are neither up nor down: the part goes on (a chosen limit, say).
LEVEL_DEG = 1.0


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

    Where curves touch in a vertex they are walked as one visits the surface around it, so that none crosses itself.
    """
    faces = welded_faces(surface.part)[surface.part_faces]
    edges = edges_of(faces)
    face, corner = np.nonzero(edges.is_boundary[edges.of_face])
    if not len(face):
        return ()
    start, end = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
    follow = _successors(faces, edges.of_face, edges.is_boundary, face, corner)
    original = surface.faces[face, (corner + 1) % 3].astype(np.int64)
    kinds = _kinds(surface, start, end, face)
    seen = np.zeros(len(face), dtype=bool)
    curves = []
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


def _successors(faces: Index, of_face: Index, is_boundary: NDArray[np.bool_], face: Index, corner: Index) -> Index:
    """Return for every boundary half-edge (face, corner opposite) the next one around the surface (m,)."""
    number = np.full(faces.shape, -1)
    number[face, corner] = np.arange(len(face))
    # Turn about the end vertex through neighbouring faces until the next boundary edge.
    other_face = _across(of_face)
    f, e = face.copy(), (corner + 1) % 3  # the edge that leaves the end vertex within the same face
    result = np.full(len(face), -1)
    pivot = faces[face, (corner + 2) % 3]
    active = np.arange(len(face))
    for _ in range(len(faces) + 1):
        done = is_boundary[of_face[f, e]]
        result[active[done]] = number[f[done], e[done]]
        active, f, e, pivot = active[~done], f[~done], e[~done], pivot[~done]
        if not len(active):
            break
        g = other_face[f, e]
        stuck = g < 0  # a non-manifold edge: the curve ends here and is closed by a straight segment
        active, f, g, e, pivot = active[~stuck], f[~stuck], g[~stuck], e[~stuck], pivot[~stuck]
        at = np.argmax(faces[g] == pivot[:, None], axis=1)
        # In face g the edge that leaves the pivot is from corner `at` to `at + 1`: it lies opposite corner `at + 2`.
        f, e = g, (at + 2) % 3
    lost = result < 0
    result[lost] = np.flatnonzero(lost)
    return result


def _across(of_face: Index) -> Index:
    """Return for every face and edge the other face at the edge (f, 3); -1 where there is not exactly one."""
    flat = of_face.ravel()
    order = np.argsort(flat, kind="stable")
    ordered = flat[order]
    across = np.full(len(flat), -1)
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    across[order[same]], across[order[same + 1]] = order[same + 1] // 3, order[same] // 3
    counts = np.bincount(flat)
    across[counts[flat] != 2] = -1
    return across.reshape(-1, 3)


def _kinds(surface: InspectionSurface, start: Index, end: Index, face: Index) -> NDArray[np.uint8]:
    """Return the `EdgeKind` of boundary half-edges from welded vertex `start` to `end` of surface row `face` (m,)."""
    part = surface.part
    all_faces = welded_faces(part)
    edges = edges_of(all_faces)
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
