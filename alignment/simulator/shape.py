"""A face of the true part: its closest points, its normals and its rim, in `part`, mm."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import NDArray

from alignment.simulator.curve import CurvedTriangles
from alignment.simulator.patches import Patches
from alignment.simulator.refine import refine
from planner.frames import Array

Index = NDArray[np.int64]

SAG_MM = 0.01
"""Flat pieces stand less than this off the curve; what is left is added back to second order."""
RIM_STEP_MM = 2.0


@dataclass(frozen=True, eq=False)
class TrueFace:
    """Small triangles of the true face, all corners separate. corners, normals (3 k, 3). rim_a, rim_b (r, 3): ends of the
    rim segments, the face on their left seen from outside; rim_na, rim_nb (r, 3): normals of the face there.
    """

    corners: Array
    normals: Array
    rim_a: Array
    rim_b: Array
    rim_na: Array
    rim_nb: Array

    @cached_property
    def triangles(self) -> Index:
        """Rows of `corners` of each small triangle (k, 3)."""
        return np.arange(len(self.corners), dtype=np.int64).reshape(-1, 3)

    @cached_property
    def _tree(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self.corners, self.triangles)
        return tree

    def foot(self, points: Array) -> tuple[Array, Array]:
        """Return the closest points (n, 3) of the smooth face and the outward unit normals there (n, 3)."""
        _, face, flat = self._tree.squared_distance(self.corners, self.triangles, np.ascontiguousarray(points))
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


def smooth_face(all_patches: Patches, which: NDArray[np.bool_], edge_mm: float) -> TrueFace:
    """Return the smooth face behind the triangles `which` (f,) of a part, as CAD has it."""
    mine = all_patches.faces[which]
    curved = CurvedTriangles(all_patches.vertices[mine], all_patches.normals[mine])
    pieces = refine(curved, SAG_MM, edge_mm)
    corners, normals = (np.ascontiguousarray(v.reshape(-1, 3)) for v in (pieces.corners, pieces.normals))
    rim = rim_segments(all_patches, mine)
    return TrueFace(corners, normals, *rim)


def rim_segments(part_patches: Patches, faces: Index) -> tuple[Array, Array, Array, Array]:
    """Return start, end and both normals (r, 3) of the rim segments of some faces, along their curved edges."""
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
