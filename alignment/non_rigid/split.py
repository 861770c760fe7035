"""The rigid part of a field: what a motion of the part explains of it belongs into BASE, the rest into the poses."""

import numpy as np

from alignment.estimate.directions import Direction
from alignment.non_rigid.field import Field
from alignment.non_rigid.samples import Surroundings
from planner.frames import Array, Transform

# A slide along the surface must gain this share of its size along the normal: any shape has some slide that explains a
# little of it, and the part would leave the place that its edges give it.
SLIDE_COST = 1.0


def rigid_part(found: Field, around: Surroundings, T_base_part: Transform, directions: tuple[Direction, ...]) -> Array:
    """Return the motion xi (6,), rad and mm, axes of `base` about the centroid, that explains most of the field.

    Least squares over the supported area of normal displacement, with slides along the surface at a cost; only in
    directions that the rigid step did not hold.
    """
    free = [d.vector for d in directions if d.status != "held"]
    if not free:
        return np.zeros(6)
    basis = np.array(free).T
    f, _ = found.on(around.face, around.bary)
    normals = T_base_part.directions(around.normals)
    arm = T_base_part.directions(around.points - found.centre_part)
    # displacement (m, 3, 6) of each sample by rx .. z
    moves = np.zeros((len(around), 3, 6))
    for k, axis in enumerate(np.eye(3)):
        moves[:, :, k] = np.cross(axis, arm)
        moves[:, :, 3 + k] = axis
    moves = moves @ basis
    along = np.einsum("mi,mik->mk", normals, moves)
    slide = moves - normals[:, :, None] * along[:, None, :]
    assert found.support is not None
    w = found.support.inside.astype(np.float64)
    normal = (along * w[:, None]).T @ along
    slides = np.einsum("mik,m,mil->kl", slide, w, slide)
    system = normal + SLIDE_COST**2 * slides
    scale = np.sqrt(np.maximum(np.diag(system), 1e-300))
    system = system / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    return np.asarray(basis @ (np.linalg.solve(system, ((along * w[:, None]).T @ f) / scale) / scale))
