"""Where the real surface lies off the believed one, measured reading by reading and spread over the drawn surface."""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from alignment.cloud import PointCloud
from planner.frames import Array, Transform
from planner.surface.inspection import InspectionSurface

MAX_READINGS = 150_000


@dataclass(frozen=True, eq=False)
class Deviation:
    """Signed deviations of n readings along the surface normal, mm, + outside. feet (n, 3): where, in part, mm."""

    feet: Array
    values_mm: Array


def thin(cloud: PointCloud, limit: int = MAX_READINGS) -> np.ndarray:
    """Return indices of at most `limit` readings, evenly through the scan."""
    n = len(cloud)
    return np.arange(0, n, max(1, -(-n // limit)))


def deviation(cloud: PointCloud, surface: InspectionSurface, T_base_part: Transform) -> Deviation:
    """Return how far the measured surface stands off the CAD placed at T_base_part (part or partnom to base).

    For an ultrasonic reading: perpendicular distance from the law origin to the CAD minus the measured distance, which
    is the distance along the common normal. For a ready point: its signed distance. Readings whose foot is on the rim
    of the surface are left out, since their distance is not along the normal.
    """
    index = thin(cloud)
    origins = T_base_part.inv().points(cloud.origins_base[index])
    foot, face, distance = _closest(surface, origins)
    corners = surface.vertices[surface.faces[face]]
    normal = surface.face_normals[face]
    height = np.einsum("ij,ij->i", origins - foot, normal)
    inside = distance - np.abs(height) < np.maximum(0.02 * distance, 0.05)
    values = height - cloud.distance_mm[index] if cloud.beams_base is not None else height
    good = inside & np.isfinite(values) & (np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1) > 0)
    return Deviation(foot[good], values[good])


def less_shape(measured: Deviation, shape: tuple[Array, Array] | None) -> Deviation:
    """Return what is left of a deviation where the poses follow the shape of the part: places (m, 3), values (m,), mm."""
    if shape is None or not len(measured.feet):
        return measured
    places, values = shape
    # Linear kernel: the places may lie in a plane, where smoother ones have no unique answer.
    follow = RBFInterpolator(places, values, neighbors=min(12, len(places)), kernel="linear")
    return Deviation(measured.feet, measured.values_mm - follow(measured.feet))


def _closest(surface: InspectionSurface, points: Array) -> tuple[Array, np.ndarray, Array]:
    import igl  # noqa: PLC0415

    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    squared, face, foot = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)
    return np.asarray(foot), np.asarray(face), np.sqrt(np.asarray(squared))


def spread(measured: Deviation, vertices: Array, reach_mm: float) -> Array:
    """Return the deviation at vertices (v, 3): distance-weighted mean of up to 8 readings within reach, NaN beyond."""
    if not len(measured.feet):
        return np.full(len(vertices), np.nan)
    distance, index = cKDTree(measured.feet).query(vertices, k=8, distance_upper_bound=reach_mm)
    near = np.isfinite(distance)
    weight = np.where(near, 1.0 / (np.where(near, distance, 1.0) + reach_mm * 0.1), 0.0)
    value = np.where(near, measured.values_mm[np.where(near, index, 0)], 0.0)
    total = weight.sum(axis=1)
    return np.divide((weight * value).sum(axis=1), total, out=np.full(len(vertices), np.nan), where=total > 0)


def symmetric_limit(values: Array, floor_mm: float = 0.05) -> float:
    """Return a round limit for a signed map that holds 99 % of the values: 1, 2 or 5 times a power of ten."""
    known = np.abs(values[np.isfinite(values)])
    top = max(float(np.quantile(known, 0.99)) if len(known) else 0.0, floor_mm)
    decade = 10.0 ** np.floor(np.log10(top))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= top * 0.999))


def mean_edge_mm(vertices: Array, faces: np.ndarray) -> float:
    """Return the mean edge length of a mesh (mm)."""
    return float(trimesh.Trimesh(vertices, faces, process=False).edges_unique_length.mean())
