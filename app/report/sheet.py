"""The inspection surface laid flat, so that a map shows the part in its own shape: seen along its normal, or unrolled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array
from planner.surface.boundary import boundary
from planner.surface.inspection import InspectionSurface

# A face turned further than this from the viewer (cosine) is seen too obliquely to carry a map.
LEAST_COSINE = 0.25
# Share of the area that must be seen well for a plain view to do.
ENOUGH_SEEN = 0.98
# Cosine of the angle to a CAD axis, and ratio of the moments, from which on the picture lies along that axis.
NEARLY_ALONG = 0.985
NEARLY_SQUARE = 0.64
SAMPLES = 90_000
CELLS_ALONG = 460
MOST_CELLS = 140_000
# Additive recurrence with the plastic number: points spread evenly over a triangle. M. Roberts (2018), R2 sequence.
_R2 = np.array([0.7548776662466927, 0.5698402909980532])
EXACTLY_ALONG = 0.9998
AXES = "XYZ"
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat picture of a surface: points of `part` (mm) -> (u, v), mm, u along the longer side.

    frame (3, 3): columns u, v and towards the viewer. centre_part (3,), radius_mm, seam: of the unrolling about u; radius 0
    for a plain view. low (2,), cell_mm and inside (rows, columns): a grid of cells and which of them lie on the surface.
    """

    frame: Array
    centre_part: Array
    radius_mm: float
    seam: float
    outline: tuple[Array, ...]
    low: Array
    cell_mm: float
    inside: NDArray[np.bool_]

    @property
    def unrolled(self) -> bool:
        """True if distances across are measured around the part."""
        return self.radius_mm > 0.0

    def uv(self, points_part: Array) -> Array:
        """Return where points (n, 3) stand on the sheet (n, 2), mm."""
        return _lay(points_part, self.frame, self.centre_part, self.radius_mm, self.seam)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top of the grid, mm."""
        rows, columns = self.inside.shape
        u, v = self.low
        return float(u), float(u + columns * self.cell_mm), float(v), float(v + rows * self.cell_mm)

    @property
    def aspect(self) -> float:
        """Height over width."""
        rows, columns = self.inside.shape
        return rows / columns

    def title(self, axis: int) -> str:
        """Return what the horizontal (0) or vertical (1) axis of the picture is, in words."""
        if axis == 1 and self.unrolled:
            return "around (mm)"
        direction = self.frame[:, axis]
        main = int(np.argmax(np.abs(direction)))
        name = ("" if direction[main] > 0 else MINUS) + AXES[main]
        if abs(direction[main]) > EXACTLY_ALONG:
            return f"CAD {name} (mm)"
        return f"near CAD {name} (mm)" if abs(direction[main]) > NEARLY_ALONG else ("along (mm)", "across (mm)")[axis]


def sheet_of(surface: InspectionSurface) -> Sheet:
    """Return the sheet of a surface: a plain view along the mean normal where that shows it all, else unrolled."""
    normal = surface.mean_normal_part
    area = surface.face_areas_mm2
    seen = float(area[surface.face_normals @ normal > LEAST_COSINE].sum() / area.sum())
    samples = _samples(surface)
    if seen >= ENOUGH_SEEN:
        frame, centre, radius, seam = _view(samples, normal), np.zeros(3), 0.0, 0.0
    else:
        frame, centre, radius, seam = _roll(surface, samples)
    uv = _lay(samples, frame, centre, radius, seam)
    low, high = uv.min(axis=0), uv.max(axis=0)
    span = np.maximum(high - low, 1e-6)
    cell = max(float(span[0]) / CELLS_ALONG, float(np.sqrt(span.prod() / MOST_CELLS)))
    columns, rows = (int(n) for n in np.ceil(span / cell + 1e-9))
    spacing = float(np.sqrt(surface.area_mm2 / len(samples)))
    centres = _centres(low, cell, rows, columns)
    near = cKDTree(uv).query(centres, distance_upper_bound=max(1.6 * spacing, 0.75 * cell))[0]
    inside = np.isfinite(near).reshape(rows, columns)
    lines = () if radius else tuple(np.vstack([c.points, c.points[:1]]) @ frame[:, :2] for c in boundary(surface))
    return Sheet(frame, centre, radius, seam, lines, low, cell, inside)


def fill(sheet: Sheet, points_part: Array, values: Array, reach_mm: float | None = None) -> Array:
    """Return the values (n,) of points (n, 3) spread over the cells of a sheet (rows, columns); NaN where none is near.

    A cell takes the mean of what lies in it, an empty one the distance-weighted mean of up to eight cells within `reach_mm`
    (default: one and a half times the distance of the points from each other).
    """
    rows, columns = sheet.inside.shape
    out = np.full(rows * columns, np.nan)
    known = np.isfinite(values)
    if not known.any():
        return out.reshape(rows, columns)
    uv, values = sheet.uv(points_part[known]), values[known]
    place = np.floor((uv - sheet.low) / sheet.cell_mm).astype(np.int64)
    place = np.clip(place, 0, [columns - 1, rows - 1])
    cell = place[:, 1] * columns + place[:, 0]
    count = np.bincount(cell, minlength=rows * columns)
    total = np.bincount(cell, values, rows * columns)
    taken = np.flatnonzero(count)
    centres = _centres(sheet.low, sheet.cell_mm, rows, columns)
    mean = total[taken] / count[taken]
    reach = max(_spacing(uv) * 1.5 if reach_mm is None else reach_mm, 1.5 * sheet.cell_mm)
    wanted = np.flatnonzero(sheet.inside.ravel())
    near, index = cKDTree(centres[taken]).query(centres[wanted], k=min(8, len(taken)), distance_upper_bound=reach)
    near, index = near.reshape(len(wanted), -1), index.reshape(len(wanted), -1)
    found = np.isfinite(near)
    # Falls to nothing at the reach, so that no circles show: R. Franke, G. Nielson, Int. J. Numer. Methods Eng. 15 (1980) 1691.
    near = np.where(found, np.minimum(near, 0.999 * reach), reach)
    weight = ((reach - near) / (reach * (near + 0.25 * sheet.cell_mm))) ** 2
    value = np.where(found, mean[np.where(found, index, 0)], 0.0)
    sums = weight.sum(axis=1)
    out[wanted] = np.divide((weight * value).sum(axis=1), sums, out=np.full(len(wanted), np.nan), where=sums > 0)
    return out.reshape(rows, columns)


def _lay(points: Array, frame: Array, centre: Array, radius: float, seam: float) -> Array:
    if not radius:
        return np.asarray(points @ frame[:, :2])
    at = (points - centre) @ frame
    around = np.mod(np.arctan2(at[:, 1], at[:, 2]) - seam, 2.0 * np.pi)
    return np.stack([points @ frame[:, 0], radius * around], axis=1)


def _view(samples: Array, normal: Array) -> Array:
    """Return the axes of a view along the mean normal, along CAD axes where the surface lies along them."""
    flat = samples - samples.mean(axis=0)
    flat = flat - np.outer(flat @ normal, normal)
    value, vector = np.linalg.eigh(flat.T @ flat)
    along = vector[:, 2]
    nearest = np.eye(3)[np.argmax(np.abs(along))]
    lying = nearest - (nearest @ normal) * normal
    lying /= np.linalg.norm(lying)
    # The longest extent of a square is any direction; what is nearly along an axis of the CAD is meant to be along it.
    if abs(lying @ along) > NEARLY_ALONG or value[1] > NEARLY_SQUARE * value[2]:
        along = lying
    along = along * np.sign(along[np.argmax(np.abs(along))])
    return np.stack([along, np.cross(normal, along), normal], axis=1)


def _roll(surface: InspectionSurface, samples: Array) -> tuple[Array, Array, float, float]:
    """Return axes, centre, mean radius and seam of an unrolling about the direction that the normals turn least from."""
    normals, area = surface.face_normals, surface.face_areas_mm2
    axis = np.linalg.eigh((normals * area[:, None]).T @ normals)[1][:, 0]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    side = np.linalg.svd(axis[None])[2][1:]
    frame = np.stack([axis, side[0], np.cross(axis, side[0])], axis=1)
    # Circle through the samples in least squares: x^2 + y^2 = 2 a x + 2 b y + c (I. Kasa, 1976).
    xy = samples @ frame[:, 1:]
    solved = np.linalg.lstsq(np.column_stack([2.0 * xy, np.ones(len(xy))]), (xy**2).sum(axis=1), rcond=None)[0]
    centre = frame[:, 1:] @ solved[:2]
    off = xy - solved[:2]
    angle = np.sort(np.arctan2(off[:, 0], off[:, 1]))
    gaps = np.diff(np.append(angle, angle[0] + 2.0 * np.pi))
    widest = int(np.argmax(gaps))
    seam = float(angle[widest] + gaps[widest] / 2.0)
    return frame, centre, float(np.linalg.norm(off, axis=1).mean()), seam


def _samples(surface: InspectionSurface) -> Array:
    """Return points (n, 3) spread evenly over the area of the surface; the same every time."""
    cumulative = np.cumsum(surface.face_areas_mm2)
    at = (np.arange(SAMPLES) + 0.5) / SAMPLES * cumulative[-1]
    face = np.minimum(np.searchsorted(cumulative, at), len(cumulative) - 1)
    a, b = np.mod(0.5 + np.arange(SAMPLES)[:, None] * _R2, 1.0).T
    over = a + b > 1.0
    a, b = np.where(over, 1.0 - a, a), np.where(over, 1.0 - b, b)
    corners = surface.vertices[surface.faces[face]]
    return np.asarray(
        corners[:, 0] + a[:, None] * (corners[:, 1] - corners[:, 0]) + b[:, None] * (corners[:, 2] - corners[:, 0])
    )


def _centres(low: Array, cell: float, rows: int, columns: int) -> Array:
    x = low[0] + cell * (np.arange(columns) + 0.5)
    y = low[1] + cell * (np.arange(rows) + 0.5)
    return np.stack([np.tile(x, rows), np.repeat(y, columns)], axis=1)


def _spacing(uv: Array, most: int = 3000) -> float:
    """Return the usual distance of a point from its third neighbour, mm: neighbours along a line are nearer than its lines."""
    if len(uv) < 5:
        return 0.0
    some = uv[:: max(1, len(uv) // most)]
    return float(np.median(cKDTree(uv).query(some, k=4)[0][:, 3]))
