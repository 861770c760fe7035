"""A path that follows the part as it is: moved along the normals, and turned with the slope of the displacement."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planner.errors import fail
from planner.frames import Array, Transform
from planner.path.passes import contact_frames
from planner.surface.curved import CurvedSurface
from planner.toolpath import Role, ToolPath


class NormalField(Protocol):
    """A smooth displacement of a surface along its outward normals."""

    def on(self, face: NDArray, bary: Array) -> tuple[Array, Array]:
        """Return the displacement (n,), mm, and its gradient along the surface (n, 3) at barycentrics of faces."""
        ...


def adapt(path: ToolPath, curved: CurvedSurface, field: NormalField) -> ToolPath:
    """Return the path on the displaced surface: p' = p + f n, n' = normalise(n - grad f), travel made square to n'.

    Standoff and heading stay. Poses beyond an edge go on with the slope at the edge; approach and retract stand above the
    leads as before. Links, which keep their distance from the part, stay where they are. Raises EchoBaseError where the
    displacement is not finite or steeper than 45 deg.
    """
    frames = path.Ts_part_contact
    p, axes = frames.xyz_mm, frames.rotation_matrix
    foot = curved.closest(p)
    f, g = field.on(foot.face, foot.bary)
    f = f + np.einsum("ij,ij->i", g, p - foot.points)
    if not (np.isfinite(f).all() and np.isfinite(g).all() and (np.linalg.norm(g, axis=1) < 1.0).all()):
        raise fail(
            "adapt-field",
            "the displacement of the part is not a smooth one: it is steeper than 45 deg somewhere on the path.",
            "Run the alignment as rigid, or scan more of the surface.",
            path.kind,
        )
    n = axes[:, :, 2]
    # Over an edge the pose's own normal may have turned on from that of the foot: the slope goes with it.
    g = g - np.einsum("ij,ij->i", g, n)[:, None] * n
    turned = n - g
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    new = contact_frames(p + f[:, None] * n, turned, axes[:, :, 0])
    link = path.role == Role.LINK
    if link.any():
        rotation = np.where(link[:, None, None], axes, new.rotation_matrix)
        origin = np.where(link[:, None], p, new.xyz_mm)
        new = Transform.from_axes("part", "contact", rotation[:, :, 0], rotation[:, :, 1], rotation[:, :, 2], origin)
    return replace(path, Ts_part_contact=new)
