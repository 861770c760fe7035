"""The whole true part: the inspected face, everything else of it, and what the beam meets first."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from alignment.simulator.patches import patches
from alignment.simulator.shape import TrueFace, smooth_face
from alignment.simulator.truth import Field, TrueSurface
from planner.frames import Array
from planner.surface.inspection import InspectionSurface

SPRUNG_EDGE_MM = 6.0
"""Pieces of a sprung-back part are shorter than this, so that the displacement is seen between its corners."""
# Base of the central difference that turns a displacement field into a tilt (mm).
GRADIENT_STEP_MM = 0.05


@dataclass(frozen=True, eq=False)
class TrueBody:
    """The true part in `part`, mm. rest: its other faces, None if there are none; analytic: stands in for `face`."""

    face: TrueFace
    rest: TrueFace | None
    analytic: TrueSurface | None = None

    @cached_property
    def _scene(self) -> rtcore_scene.EmbreeScene:
        scene = rtcore_scene.EmbreeScene()
        corners = [self.face.corners] if self.rest is None else [self.face.corners, self.rest.corners]
        TriangleMesh(scene, np.concatenate(corners).reshape(-1, 3, 3).astype(np.float32))
        return scene

    def first_met(self, origins: Array, beams: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return whether each beam axis meets the rest of the part first (n,), and how far away (inf: nothing met)."""
        found = self._scene.run(origins.astype(np.float32), beams.astype(np.float32), output=True)
        hit = found["primID"] >= 0
        return hit & (found["primID"] >= len(self.face.corners) // 3), np.where(hit, found["tfar"], np.inf)


def true_body(surface: InspectionSurface, field: Field | None, analytic: TrueSurface | None) -> TrueBody:
    """Return the true part behind the triangles: smooth, cut at its creases, sprung back by `field`.

    The displacement is along the normal of the inspected face; the rest of the part follows the nearest point of it.
    """
    all_patches = patches(surface.part, surface.part_faces)
    edge_mm = np.inf if field is None else SPRUNG_EDGE_MM
    face = smooth_face(all_patches, all_patches.inspected, edge_mm)
    others = ~all_patches.inspected
    rest = smooth_face(all_patches, others, edge_mm) if others.any() else None
    if field is None:
        return TrueBody(face, rest, analytic)
    if rest is not None:
        feet, along = face.foot(rest.corners)
        moved = rest.corners + field(feet)[:, None] * along
        facing = np.einsum("ij,ij->i", rest.normals, along)[:, None]
        _, turned = displaced(feet, along, field)
        normals = rest.normals + facing * (turned - along)
        rest = replace(rest, corners=moved, normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))
    corners, normals = displaced(face.corners, face.normals, field)
    rim_a, rim_na = displaced(face.rim_a, face.rim_na, field)
    rim_b, rim_nb = displaced(face.rim_b, face.rim_nb, field)
    return TrueBody(TrueFace(corners, normals, rim_a, rim_b, rim_na, rim_nb), rest, analytic)


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
