"""The inspected face of the true part: its closest points, its normals and its rim, in `part`, mm."""

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from alignment.simulator.curve import CurvedTriangles
from alignment.simulator.patches import Patches, patches
from alignment.simulator.refine import refine
from alignment.simulator.truth import Field
from planner.frames import Array
from planner.surface.inspection import InspectionSurface

Index = NDArray[np.int64]

SAG_MM = 0.01
"""Flat pieces stand less than this off the curve; what is left is added back to second order."""
SPRUNG_EDGE_MM = 6.0
"""Pieces of a sprung-back part are shorter than this, so that the displacement is seen between its corners."""
RIM_STEP_MM = 2.0
# Base of the central difference that turns a displacement field into a tilt (mm).
GRADIENT_STEP_MM = 0.05


@dataclass(frozen=True, eq=False)
class TrueFace:
    """Small triangles of the true face, all corners separate. corners, normals (3 k, 3); rim_a, rim_b (r, 3): rim segments,
    the face on their left seen from outside."""

    corners: Array
    normals: Array
    rim_a: Array
    rim_b: Array

    def foot(self, points: Array) -> tuple[Array, Array]:
        """Return the closest points (n, 3) of the smooth face and the outward unit normals there (n, 3)."""
        triangles = np.arange(len(self.corners), dtype=np.int64).reshape(-1, 3)
        _, face, flat = igl.point_mesh_squared_distance(np.ascontiguousarray(points), self.corners, triangles)
        face = face.ravel()
        a, b, c = (self.corners[3 * face + i] for i in range(3))
        na, nb, nc = (self.normals[3 * face + i] for i in range(3))
        wa, wb, wc = barycentric(flat, a, b, c)
        normal = wa[:, None] * na + wb[:, None] * nb + wc[:, None] * nc
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        # A quadric through the corners with these normals stands this far off the flat triangle.
        lift = 0.5 * (
            wa * wb * np.einsum("ij,ij->i", nb - na, b - a)
            + wb * wc * np.einsum("ij,ij->i", nc - nb, c - b)
            + wc * wa * np.einsum("ij,ij->i", na - nc, a - c)
        )
        return flat + lift[:, None] * normal, normal


def barycentric(p: Array, a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """Return the barycentric coordinates of points p (n, 3) on triangles a b c."""
    ab, ac, ap = b - a, c - a, p - a
    bb, cc, bc = (np.einsum("ij,ij->i", u, v) for u, v in ((ab, ab), (ac, ac), (ab, ac)))
    pb, pc = np.einsum("ij,ij->i", ap, ab), np.einsum("ij,ij->i", ap, ac)
    det = bb * cc - bc * bc
    safe = np.where(det > 0.0, det, 1.0)
    wb, wc = (cc * pb - bc * pc) / safe, (bb * pc - bc * pb) / safe
    wb, wc = np.clip(np.where(det > 0.0, wb, 0.0), 0.0, 1.0), np.clip(np.where(det > 0.0, wc, 0.0), 0.0, 1.0)
    return np.clip(1.0 - wb - wc, 0.0, 1.0), wb, wc


def true_face(surface: InspectionSurface, field: Field | None) -> TrueFace:
    """Return the smooth face behind the triangles of the inspection surface, displaced along its normal by `field`."""
    part_patches = patches(surface.part, surface.part_faces)
    mine = part_patches.faces[part_patches.inspected]
    curved = CurvedTriangles(part_patches.vertices[mine], part_patches.normals[mine])
    pieces = refine(curved, SAG_MM, np.inf if field is None else SPRUNG_EDGE_MM)
    corners, normals = pieces.corners.reshape(-1, 3), pieces.normals.reshape(-1, 3)
    rim_a, rim_b, rim_na, rim_nb = _rim(part_patches, mine)
    if field is not None:
        corners, normals = displaced(corners, normals, field)
        rim_a, _ = displaced(rim_a, rim_na, field)
        rim_b, _ = displaced(rim_b, rim_nb, field)
    return TrueFace(np.ascontiguousarray(corners), np.ascontiguousarray(normals), rim_a, rim_b)


def displaced(points: Array, normals: Array, field: Field) -> tuple[Array, Array]:
    """Return points moved by `field` along their normals, and the normals tilted by its slope."""
    z = normals
    x = np.cross(z, np.where(np.abs(z[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    tilted = z.copy()
    h = GRADIENT_STEP_MM
    for axis in (x, np.cross(z, x)):
        slope = (field(points + h * axis) - field(points - h * axis)) / (2.0 * h)
        tilted -= slope[:, None] * axis
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    return points + field(points)[:, None] * z, tilted


def _rim(part_patches: Patches, faces: Index) -> tuple[Array, Array, Array, Array]:
    """Rim segments of the face along its curved edges, with the normals of the face at their ends."""
    v = len(part_patches.vertices)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    twin = np.isin(start * v + end, end * v + start)
    face, side = np.divmod(np.flatnonzero(~twin), 3)
    if len(face) == 0:
        none = np.zeros((0, 3))
        return none, none, none, none
    corners, normals = part_patches.vertices[faces[face]], part_patches.normals[faces[face]]
    curved = CurvedTriangles(corners, normals)
    row = np.arange(len(face))
    length = np.linalg.norm(corners[row, (side + 1) % 3] - corners[row, side], axis=1)
    pieces = np.maximum(1, np.ceil(length / RIM_STEP_MM)).astype(np.int64)
    owner = np.repeat(row, pieces)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    out: list[Array] = []
    for t in (k / pieces[owner], (k + 1) / pieces[owner]):
        bary = np.zeros((len(owner), 3))
        bary[np.arange(len(owner)), side[owner]] = 1.0 - t
        bary[np.arange(len(owner)), (side[owner] + 1) % 3] = t
        out += [curved.points(owner, bary), curved.normals_at(owner, bary)]
    return out[0], out[2], out[1], out[3]
