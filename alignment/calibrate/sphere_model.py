"""What a probe with a wrong TCP sees of a fixed sphere: distance and level of every reading, with their derivatives."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from planner.frames import Array

# Columns of the unknown: centre of the sphere in base (mm), radius (mm), level (dB), its slope with distance (dB/mm),
# logarithms of the two tilt losses over those of the setup, and last the TCP's error (turns rad, shifts mm).
CENTRE, RADIUS, LEVEL, SLOPE, LOSS, TCP = slice(0, 3), 3, 4, 5, slice(6, 8), slice(8, 14)
UNKNOWNS = 14
DEG = 180.0 / np.pi


@dataclass(frozen=True, eq=False)
class SphereViews:
    """n readings of a sphere from m poses.

    rotation (m, 3, 3), origin_base (m, 3): EchoBase's TCP (beam z, array x) as the robot believes it. pose (n,): row of
    these. law_tcp (n, 3): law origins in the TCP, mm. distance_mm, level_db (n,): measured; level NaN if unknown.
    loss_b, loss_c: tilt losses of the setup, dB/deg^2. pose_of_scan (m,): row of each pose in the scan's poses.
    """

    rotation: Array
    origin_base: Array
    pose: NDArray[np.int32]
    law_tcp: Array
    distance_mm: Array
    level_db: Array
    loss_b: float
    loss_c: float
    pose_of_scan: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pose)

    def subset(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> "SphereViews":
        """Return some of the readings, of the same poses."""
        return replace(
            self,
            pose=self.pose[rows],
            law_tcp=self.law_tcp[rows],
            distance_mm=self.distance_mm[rows],
            level_db=self.level_db[rows],
        )


@dataclass(frozen=True, eq=False)
class Seen:
    """What the unknown lets the readings expect.

    distance_mm, level_db, loss_db (n,); d_distance, d_level (n, 14): derivatives. A robot that stands off by e (3,) mm in
    base sees the sphere moved by -e: the derivative by a pose's error is minus that by the centre.
    """

    distance_mm: Array
    level_db: Array
    loss_db: Array
    d_distance: Array
    d_level: Array


def see(views: SphereViews, unknown: Array, distance_at_mm: float) -> Seen:
    """Return expected readings of the unknown (14,); the level is that at `distance_at_mm` on the axis.

    d = |centre - origin| - radius, perpendicular to the sphere wherever the beam leaves it an echo. Level: tilt of the beam
    against that perpendicular about y and x (b, c), quadratic in deg, as for a plane.
    """
    turn = Rotation.from_rotvec(unknown[TCP][:3])
    axes, left = turn.as_matrix(), _left_jacobian(unknown[TCP][:3])
    law = views.law_tcp @ axes.T
    rotation = views.rotation[views.pose]
    to_centre = np.einsum("nji,nj->ni", rotation, unknown[CENTRE] - views.origin_base[views.pose])
    to_centre = to_centre - unknown[TCP][3:] - law
    length = np.linalg.norm(to_centre, axis=1)
    w = to_centre / length[:, None]
    n = len(views)
    distance = length - unknown[RADIUS]
    d_distance = np.zeros((n, UNKNOWNS))
    d_distance[:, CENTRE] = np.einsum("nij,nj->ni", rotation, w)
    d_distance[:, RADIUS] = -1.0
    d_distance[:, TCP] = np.hstack([np.cross(w, law) @ left, -w])
    level = unknown[LEVEL] + unknown[SLOPE] * (distance - distance_at_mm)
    d_level = unknown[SLOPE] * d_distance
    d_level[:, LEVEL], d_level[:, SLOPE] = 1.0, distance - distance_at_mm
    # A step of a search may ask for any loss; e^5 times the setup's is none that a probe has.
    losses = np.array([views.loss_b, views.loss_c]) * np.exp(np.clip(unknown[LOSS], -5.0, 5.0))
    loss = np.zeros(n)
    for i, k in enumerate(losses):
        axis = axes[:, i]
        sine = np.clip(w @ axis, -0.999, 0.999)
        tilt = DEG * np.arcsin(sine)
        g = (axis - sine[:, None] * w) / length[:, None]
        d_sine = np.zeros((n, UNKNOWNS))
        d_sine[:, CENTRE] = np.einsum("nij,nj->ni", rotation, g)
        d_sine[:, TCP] = np.hstack([(np.cross(g, law) - np.cross(w, axis)) @ left, -g])
        loss += k * tilt**2
        d_level -= (2.0 * k * DEG * tilt / np.sqrt(1.0 - sine**2))[:, None] * d_sine
        d_level[:, LOSS.start + i] -= k * tilt**2
    return Seen(distance, level - loss, loss, d_distance, d_level)


def _left_jacobian(r: Array) -> Array:
    """Left Jacobian of SO(3), (3, 3): what a change of the rotation vector turns (Sola et al., arXiv:1812.01537, eq. 145)."""
    angle = float(np.linalg.norm(r))
    x = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    if angle < 1e-6:
        return np.eye(3) + 0.5 * x
    return np.asarray(np.eye(3) + (1.0 - np.cos(angle)) / angle**2 * x + (angle - np.sin(angle)) / angle**3 * (x @ x))
