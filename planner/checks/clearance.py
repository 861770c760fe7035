"""How far the nozzle and the wrist stay from the whole part.

The nozzle is a cylinder behind the TCP, the wrist a sphere about the wrist centre. Spheres around the nozzle, large ones
first, prove most poses clear with one closest-point query each; what they leave open goes to smaller spheres and at
last to samples of the cylinder's own surface.
"""

from dataclasses import dataclass

import numpy as np

from planner.frames import Array, Transform
from planner.surface.solid import Solid

# Below this clearance (mm) spheres no longer decide: the cylinder itself is sampled.
NEAR_MM = 2.0
# Sample spacing on the cylinder as a share of its radius.
SAMPLE_SHARE = 0.25
# Centres of the enclosing spheres behind the TCP, in nozzle lengths; from half a length on they hold the whole nozzle.
# The near ones are cheap to ask and fit into hollows; the far ones prove small standoffs on flat and convex parts.
SPHERE_LENGTHS = (0.5, 1.0, 2.0, 4.0)
# The wrist is far from the part and asking far is slow: it is asked again after this much motion (mm), or when near.
WRIST_STRIDE_MM = 40.0


@dataclass(frozen=True)
class Envelope:
    """What moves with the TCP: nozzle cylinder along -z of the TCP, and the wrist sphere (centre in TCP axes)."""

    radius_mm: float
    length_mm: float
    wrist_tcp: Array | None = None
    wrist_radius_mm: float = 0.0

    @property
    def has_nozzle(self) -> bool:
        """Whether there is a nozzle to check at all."""
        return self.radius_mm > 0.0 and self.length_mm > 0.0

    def farthest_mm(self) -> float:
        """Distance from the TCP to the farthest point of nozzle and wrist (mm)."""
        nozzle = float(np.hypot(self.radius_mm, self.length_mm))
        wrist = 0.0 if self.wrist_tcp is None else float(np.linalg.norm(self.wrist_tcp)) + self.wrist_radius_mm
        return max(nozzle, wrist)


def clearance_mm(solid: Solid, Ts_part_tcp: Transform, envelope: Envelope) -> tuple[Array, Array]:
    """Return the clearance of nozzle and of wrist (n,) each, mm, at n TCP poses.

    The nozzle's is a lower bound (on a flat part by up to radius^2 / length below the truth); below `NEAR_MM` it is
    measured on the nearest part points found, to about 0.2 mm, negative by their depth inside the cylinder. The wrist's is a
    lower bound too, up to `WRIST_STRIDE_MM` below the truth, and exact where it is less than that. Without a nozzle or a
    wrist it is infinite. Poses with the TCP in the material have the nozzle's depth, negative.
    """
    origin, beam = Ts_part_tcp.xyz_mm, Ts_part_tcp.rotation_matrix[:, :, 2]
    nozzle = np.full(len(origin), np.inf)
    if envelope.has_nozzle:
        nozzle = _nozzle(solid, Ts_part_tcp, origin, beam, envelope)
    wrist = np.full(len(origin), np.inf)
    if envelope.wrist_tcp is not None:
        centres = Ts_part_tcp.points(np.tile(envelope.wrist_tcp, (len(origin), 1)))
        wrist = _strided_distance_mm(solid, centres, envelope.wrist_radius_mm) - envelope.wrist_radius_mm
    buried = solid.inside(origin)
    if buried.any():
        nozzle[buried] = -solid.distance_mm(origin[buried])
    return nozzle, wrist


def _strided_distance_mm(solid: Solid, centres: Array, radius: float) -> Array:
    """Return a lower bound (n,), mm, of the distances of points on a way: no point is nearer by more than it moved."""
    if len(centres) == 0:
        return np.zeros(0)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))]
    _, anchor, back = np.unique(np.floor(along / WRIST_STRIDE_MM), return_index=True, return_inverse=True)
    moved = np.linalg.norm(centres - centres[anchor][back], axis=1)
    distance = solid.distance_mm(centres[anchor])[back] - moved
    near = (distance - radius < WRIST_STRIDE_MM) & (moved > 0.0)
    distance[near] = solid.distance_mm(centres[near])
    return distance


def _nozzle(solid: Solid, poses: Transform, origin: Array, beam: Array, envelope: Envelope) -> Array:
    radius, length = envelope.radius_mm, envelope.length_mm
    bound = np.full(len(origin), -np.inf)
    for share in SPHERE_LENGTHS:
        open_ = np.flatnonzero(bound < NEAR_MM)
        if len(open_) == 0:
            return bound
        back = share * length
        found = solid.distance_mm(origin[open_] - back * beam[open_]) - np.hypot(radius, back)
        bound[open_] = np.maximum(bound[open_], found)
    open_ = np.flatnonzero(bound < NEAR_MM)
    if len(open_) == 0:
        return bound
    count = max(1, int(np.ceil(length / radius)))
    step = length / count
    middles = -(np.arange(count) + 0.5) * step
    centres = origin[open_, None] + middles[:, None] * beam[open_, None]
    spheres = solid.distance_mm(centres.reshape(-1, 3)).reshape(len(open_), count) - np.hypot(radius, step / 2.0)
    bound[open_] = np.maximum(bound[open_], spheres.min(axis=1))
    for slice_ in range(count):
        mask = (spheres[:, slice_] < NEAR_MM) & (bound[open_] < NEAR_MM)
        rows = open_[mask]
        if len(rows):
            samples = _surface(radius, length, slice_ * step, (slice_ + 1) * step)
            spheres[mask, slice_] = _sampled(solid, poses[rows], samples, radius, length)
    bound[open_] = np.where(bound[open_] < NEAR_MM, spheres.min(axis=1), bound[open_])
    return bound


def _surface(radius: float, length: float, near: float, far: float) -> Array:
    """Return samples (k, 3) of the slice of the cylinder between `near` and `far` behind the TCP, in TCP axes."""
    spacing = SAMPLE_SHARE * radius
    rings = [(radius, -z) for z in np.linspace(near, far, max(2, int(np.ceil((far - near) / spacing)) + 1))]
    caps = [z for z, there in ((0.0, near <= 0.0), (length, far >= length - 1e-9)) if there]
    rings += [(r, -z) for z in caps for r in np.arange(0.0, radius, spacing)]
    return np.vstack([_ring(r, z, spacing) for r, z in rings])


def _ring(radius: float, z: float, spacing: float) -> Array:
    count = max(1, int(np.ceil(2.0 * np.pi * radius / spacing)))
    angle = np.arange(count) * (2.0 * np.pi / count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)])


def _sampled(solid: Solid, poses: Transform, samples: Array, radius: float, length: float) -> Array:
    """Return the smallest signed distance (m,), mm, from the cylinder of the part points nearest to its samples."""
    rotation, origin = poses.rotation_matrix, poses.xyz_mm
    points = np.einsum("nij,kj->nki", rotation, samples) + origin[:, None]
    _, _, at = solid.closest(points.reshape(-1, 3))
    local = np.einsum("nji,nkj->nki", rotation, at.reshape(points.shape) - origin[:, None])
    return np.asarray(cylinder_distance_mm(local, radius, length).min(axis=1))


def cylinder_distance_mm(points_tcp: Array, radius: float, length: float) -> Array:
    """Return the signed distance (...,), mm, of points (..., 3) from the cylinder 0 >= z >= -length; negative inside."""
    side = np.hypot(points_tcp[..., 0], points_tcp[..., 1]) - radius
    end = np.maximum(points_tcp[..., 2], -length - points_tcp[..., 2])
    outside = np.hypot(np.maximum(side, 0.0), np.maximum(end, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(side, end), 0.0))
