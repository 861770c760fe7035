"""Which way to scan: the long axis of a surface, its straightest direction, or a line drawn; whatever its tessellation."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from planner.errors import fail
from planner.frames import Array
from planner.path.guide import Guide, guide_through
from planner.path.sampling import sample_equal_area
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface

# Below this length of the area-mean of the unit normals a surface closes on itself (a half tube has 0.64).
_WRAPPED = 0.25


# A direction of lowest curvature is one only if the surface bends this much less along it than across (mean square) ...
_STRAIGHTER = 0.9
# ... and bends at all: mean turn (rad) over the size of the surface.
_BENDS_RAD = 2e-3
_SAMPLES = 5000


@dataclass(frozen=True, eq=False)
class ScanAxes:
    """Right-handed axes of a raster in `part`: along the passes, across them, mean outward normal; the line drawn, if any."""

    along: Array
    across: Array
    normal: Array
    guide: Guide | None = None


def raster_axes(curved: CurvedSurface, setup: Setup) -> ScanAxes:
    """Return the axes of the raster as `inspection.direction` asks, turned by `inspection.direction_deg`.

    Raises EchoBaseError `guide-degenerate` for a line that cannot be drawn on the surface.
    """
    inspection = setup.inspection
    if inspection.direction == "extent":
        return scan_axes(curved.surface, inspection.direction_deg)
    axes = scan_axes(curved.surface, 0.0)
    if inspection.direction == "lowest_curvature":
        return _turned(_straightest(curved, axes), inspection.direction_deg)
    guide = guide_through(curved, np.array(inspection.guide), axes.normal, inspection.direction_deg)
    across = np.cross(guide.normal, guide.along)
    return ScanAxes(guide.along, across, guide.normal, guide)


def _straightest(curved: CurvedSurface, axes: ScanAxes) -> ScanAxes:
    """Return axes along the direction in which the normals turn least: the mean square turn per mm, over the area.

    dn = W dp, so the mean of |W a|^2 over the area is a . M a with M the area mean of W^2; its weakest eigenvector in the
    plane of the surface is the direction. W of a cylinder has its axis as null vector wherever it is taken, so that the
    tessellation does not matter. A surface that bends alike in all directions, or not at all, keeps the longest extent.
    """
    surface = curved.surface
    s = sample_equal_area(surface.face_areas_mm2, _SAMPLES)
    W = curved.shape_operator(s.face, s.bary)
    M = np.einsum("nij,njk->ik", W, W) / len(W)
    if float(np.linalg.norm(surface.face_areas_mm2 @ surface.face_normals)) < _WRAPPED * surface.area_mm2:
        values, vectors = np.linalg.eigh(M)
        along = _canonical(vectors[:, 0])
    else:
        plane = np.stack([axes.along, axes.across], axis=1)
        values, vectors = np.linalg.eigh(plane.T @ M @ plane)
        along = _canonical(plane @ vectors[:, 0])
    size = np.sqrt(surface.area_mm2)
    if values[0] > _STRAIGHTER**2 * values[1] or np.sqrt(values[1]) * size < _BENDS_RAD:
        return axes
    normal = axes.normal - (axes.normal @ along) * along
    normal /= np.linalg.norm(normal)
    return ScanAxes(along, np.cross(normal, along), normal)


def _turned(axes: ScanAxes, direction_deg: float) -> ScanAxes:
    turn = np.radians(direction_deg)
    along = np.cos(turn) * axes.along + np.sin(turn) * axes.across
    return replace(axes, along=along, across=np.cross(axes.normal, along))


def scan_axes(surface: InspectionSurface, direction_deg: float) -> ScanAxes:
    """Return the axes of the longest extent, turned by `direction_deg` about the mean normal.

    The longest extent is the long side of the smallest rectangle around the surface seen along its mean normal, so
    that neither the number nor the place of the triangles matters; a square keeps the part axis nearest to X. A surface
    that closes on itself (a tube, a full skin) has no mean normal: its passes run round the principal axis of its area,
    with the array along it, where such surfaces are straight and passes in one plane do not graze; `direction_deg` 90
    turns them along the axis.
    """
    a = surface.face_areas_mm2
    total = float(a.sum())
    if not total > 0.0:
        raise fail("surface-empty", "The inspection surface has no area.", "Choose another surface.")
    mean = a @ surface.face_normals / total
    if float(np.linalg.norm(mean)) < _WRAPPED:
        _, vectors = np.linalg.eigh(_area_tensor(surface))
        normal = _canonical(vectors[:, 1])
        longest = np.cross(_canonical(vectors[:, 2]), normal)
    else:
        normal = mean / np.linalg.norm(mean)
        longest = _long_side(surface.vertices, normal)
        longest = _canonical(longest)
    longest /= np.linalg.norm(longest)
    return _turned(ScanAxes(longest, np.cross(normal, longest), normal), direction_deg)


def _canonical(v: Array) -> Array:
    """Return the axis with its largest component positive (the first of equals)."""
    k = int(np.argmax(np.round(np.abs(v), 9)))
    return v if v[k] > 0 else -v


def _area_tensor(surface: InspectionSurface) -> Array:
    """Return the exact second moment of the area about its centroid (3, 3)."""
    tri = surface.vertices[surface.faces] - surface.centroid_part
    s = tri.sum(axis=1)
    w = surface.face_areas_mm2 / 12.0
    return np.asarray(np.einsum("t,tki,tkj->ij", w, tri, tri) + np.einsum("t,ti,tj->ij", w, s, s))


def _long_side(vertices: Array, normal: Array) -> Array:
    """Return the direction of the long side of the smallest rectangle around the vertices seen along `normal`."""
    e = np.eye(3)[int(np.argmin(np.round(np.abs(normal), 9)))]
    x = e - normal * (e @ normal)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    flat = np.stack([vertices @ x, vertices @ y], axis=1)
    try:
        corner = flat[ConvexHull(flat - flat.mean(axis=0)).vertices]
    except (QhullError, ValueError):
        raise fail(
            "surface-degenerate", "The inspection surface is a line or a point.", "Choose another one."
        ) from None
    edge = np.roll(corner, -1, axis=0) - corner
    u = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    length = np.ptp(corner @ u.T, axis=0)
    width = np.ptp(corner @ np.stack([-u[:, 1], u[:, 0]]), axis=0)
    best = int(np.argmin(np.round(length * width / (length * width).min(), 6)))
    d, w = u[best], np.array([-u[best, 1], u[best, 0]])
    if width[best] > length[best] * 1.01:
        d = w
    along = d[0] * x + d[1] * y
    other = np.cross(normal, along)
    if abs(width[best] / length[best] - 1.0) <= 0.01 and _first_axis(other) > _first_axis(along):
        along = other
    return along


def _first_axis(v: Array) -> float:
    """Return how much an axis looks along X, then Y: what decides between the sides of a square."""
    return float(abs(v[0]) + 1e-3 * abs(v[1]))
