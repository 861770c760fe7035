"""Feet of all readings of a scan on the CAD: searched at some laws of each sweep, interpolated exactly between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.metrics.expected import Closest
from planner.frames import Array, Transform
from planner.probe import law_offsets_mm
from planner.setup import Probe

LAW_STRIDE_MM = 3.0
"""Distance along the array between the laws that are searched; shorter gaps of the surface are seen at their rims only."""
CHUNK = 200_000


@dataclass(frozen=True, eq=False)
class Feet:
    """points, normals (n, 3), distance_mm (n,), interior (n,): as `planner.surface.closest.Foot`, in `part`."""

    points: Array
    normals: Array
    distance_mm: Array
    interior: NDArray[np.bool_]


def search(curved: Closest, points_part: Array) -> Feet:
    """Return the feet of points (n, 3), each searched."""
    found = Feet(
        points_part.copy(), points_part.copy(), points_part[:, 0].copy(), np.zeros(len(points_part), dtype=bool)
    )
    for begin in range(0, len(points_part), CHUNK):
        rows = slice(begin, begin + CHUNK)
        foot = curved.closest(points_part[rows])
        found.points[rows], found.normals[rows] = foot.points, foot.normals
        found.distance_mm[rows], found.interior[rows] = foot.distance_mm, foot.interior
    return found


def feet(cloud: PointCloud, curved: Closest, T_part_base: Transform, probe: Probe) -> Feet:
    """Return the foot of every reading of a cloud of echoes.

    Along the array the distance to the surface has the slope normal . array, so that a cubic through two searched laws
    and their slopes is good to the fourth order of their distance over the radius of curvature. Where one of the two is
    not on the surface, each reading is searched.
    """
    assert cloud.beams_base is not None
    assert cloud.arrays_base is not None
    offsets = law_offsets_mm(probe)
    stride = max(1, round(LAW_STRIDE_MM / probe.pitch_mm))
    origins = T_part_base.points(cloud.origins_base)
    if probe.laws < 3 * stride or stride < 2:
        return search(curved, origins)
    nodes = np.unique(np.append(np.arange(0, probe.laws, stride), probe.laws - 1))
    _, first, sweep = np.unique(cloud.pose_index, return_index=True, return_inverse=True)
    array = T_part_base.directions(cloud.arrays_base[first])
    shift = offsets[nodes] - offsets[cloud.law[first] - 1][:, None]
    start = origins[first][:, None] + shift[:, :, None] * array[:, None]
    at = search(curved, start.reshape(-1, 3))
    shape = (len(first), len(nodes))
    distance, inside = at.distance_mm.reshape(shape), at.interior.reshape(shape)
    normals = at.normals.reshape(*shape, 3)
    slope = np.einsum("ukj,uj->uk", normals, array)
    law = cloud.law - 1
    j = np.clip(np.searchsorted(nodes, law, side="right") - 1, 0, len(nodes) - 2)
    gap = offsets[nodes[j + 1]] - offsets[nodes[j]]
    t = (offsets[law] - offsets[nodes[j]]) / gap
    d = _hermite(t, gap, distance[sweep, j], distance[sweep, j + 1], slope[sweep, j], slope[sweep, j + 1])
    n = (1.0 - t)[:, None] * normals[sweep, j] + t[:, None] * normals[sweep, j + 1]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    found = Feet(origins - d[:, None] * n, n, d, np.ones(len(cloud), dtype=bool))
    unsure = np.flatnonzero(~(inside[sweep, j] & inside[sweep, j + 1]))
    exact = search(curved, origins[unsure])
    found.points[unsure], found.normals[unsure] = exact.points, exact.normals
    found.distance_mm[unsure], found.interior[unsure] = exact.distance_mm, exact.interior
    return found


def _hermite(t: Array, gap: Array, d0: Array, d1: Array, s0: Array, s1: Array) -> Array:
    """The cubic over t in 0..1 with values d0, d1 and slopes s0, s1 (per mm) at the ends of a gap (mm)."""
    u = 1.0 - t
    return np.asarray(u * u * (1.0 + 2.0 * t) * d0 + t * t * (1.0 + 2.0 * u) * d1 + gap * t * u * (u * s0 - t * s1))
