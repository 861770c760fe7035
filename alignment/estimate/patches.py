"""Readings condensed to patches in one linear pass: robust means that a curved surface does not bias."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.cells import Cells
from alignment.estimate.robust import mad_sigma, tukey_weights
from planner.frames import Array, Transform
from planner.surface.curved import CurvedSurface

# Readings that are looked at to find the median of their cell.
SORTED_READINGS = 150_000
# Below this share of the usual amplitude a reading counts less: half the beam may be off the part.
FULL_AMPLITUDE = 0.6


@dataclass(frozen=True, eq=False)
class Patches:
    """p patches; each stands for the weighted mean of its readings.

    origins_base (p, 3), distance_mm (p,): means. spread (p, 3, 3): covariance of the origins within, mm2. hessian_base
    (p, 3, 3): curvature of the distance to the surface, 1/mm. count (p,): readings it is worth. scatter_mm (p,): their
    standard deviation. amplitude_pct (p,). beams_base (p, 3): zero without beams. cells: where on the path.
    rejected: readings thrown out as not belonging to their neighbours. sigma_mm: scatter of single readings.
    """

    origins_base: Array
    distance_mm: Array
    spread: Array
    hessian_base: Array
    count: Array
    scatter_mm: Array
    amplitude_pct: Array
    beams_base: Array
    cells: Cells
    kept: NDArray[np.bool_]
    sigma_mm: float

    def __len__(self) -> int:
        return len(self.distance_mm)

    @property
    def bend_mm(self) -> Array:
        """How much farther than its mean origin the surface is for the readings of a patch, on average (p,), mm."""
        return 0.5 * np.einsum("pij,pij->p", self.hessian_base, self.spread)


def model_readings(cloud: PointCloud, point_model: str) -> tuple[Array, Array]:
    """Return (origins (n, 3), distances (n,)) such that distance - dist(origin, surface) is the residual.

    perpendicular: law origins and measured distances. axial (and ready surface points): points, which lie at distance 0.
    """
    if cloud.beams_base is None or point_model == "axial":
        return cloud.axial_points_base, np.zeros(len(cloud))
    return cloud.origins_base, cloud.distance_mm


def reading_weights(cloud: PointCloud) -> Array:
    """Return weights (n,) from amplitude: full from 60 % of the median on, falling to zero with it; 1 where unknown."""
    a = cloud.amplitude_pct
    known = np.isfinite(a)
    if not known.any():
        return np.ones(len(a))
    usual = float(np.median(a[known]))
    if usual <= 0.0:
        return np.ones(len(a))
    return np.where(known, np.clip(a / (FULL_AMPLITUDE * usual), 0.0, 1.0) ** 2, 1.0)


def condense(
    cloud: PointCloud, cells: Cells, curved: CurvedSurface, T_base_part: Transform, point_model: str
) -> Patches:
    """Return the patches of a cloud whose part is already placed to about the robust scatter of the readings.

    Within a patch the distance to the surface is expanded to second order about the patch's middle, so that the robust
    mean and the rejection see no curvature; the expansion's mean (tr H Cov / 2) is kept and added back exactly.
    """
    origins, distance = model_readings(cloud, point_model)
    weight = reading_weights(cloud)
    cell, c = cells.of_reading, len(cells)
    count = np.maximum(np.bincount(cell, minlength=c), 1)
    middle = np.stack([np.bincount(cell, origins[:, k], c) / count for k in range(3)], axis=1)
    T_part_base = T_base_part.inv()
    foot = curved.closest(T_part_base.points(middle))
    normal = T_base_part.directions(foot.normals)
    hessian = distance_hessian(curved.shape_operator(foot.face, foot.bary), foot.distance_mm)
    r = T_base_part.rotation_matrix
    hessian = r @ hessian @ r.T
    d = origins - middle[cell]
    expected = foot.distance_mm[cell] + np.einsum("ni,ni->n", d, normal[cell])
    expected += 0.5 * quadratic(hessian, cell, d)
    residual = distance - expected
    weight, sigma = _robust(residual, weight, cell, c)
    total = np.bincount(cell, weight, c)
    safe = np.where(total > 0, total, 1.0)

    def mean(values: Array) -> Array:
        return np.bincount(cell, weight * values, c) / safe

    offset = np.stack([mean(d[:, k]) for k in range(3)], axis=1)
    spread = np.zeros((c, 3, 3))
    for i in range(3):
        for j in range(i, 3):
            spread[:, i, j] = spread[:, j, i] = mean(d[:, i] * d[:, j]) - offset[:, i] * offset[:, j]
    centre = mean(residual)
    scatter = np.sqrt(np.maximum(mean(residual**2) - centre**2, 0.0))
    worth = np.divide(total**2, np.bincount(cell, weight**2, c), out=np.zeros(c), where=total > 0)
    amplitude = (
        mean(np.nan_to_num(cloud.amplitude_pct)) if np.isfinite(cloud.amplitude_pct).any() else np.full(c, np.nan)
    )
    beams = np.zeros((c, 3))
    if cloud.beams_base is not None:
        beams = np.stack([mean(cloud.beams_base[:, k]) for k in range(3)], axis=1)
    return Patches(
        middle + offset,
        mean(distance),
        spread,
        hessian,
        worth,
        scatter,
        amplitude,
        beams,
        cells,
        weight > 0,
        sigma,
    )


def quadratic(matrices: Array, of_row: NDArray, d: Array) -> Array:
    """Return d' M d (n,) with symmetric M (c, 3, 3) picked by of_row (n,)."""
    out = np.zeros(len(d))
    for i in range(3):
        for j in range(i, 3):
            entry = matrices[:, i, j] * (1.0 if i == j else 2.0)
            if np.abs(entry).max(initial=0.0) > 1e-12:
                out += entry[of_row] * d[:, i] * d[:, j]
    return out


def distance_hessian(shape_operator: Array, distance_mm: Array) -> Array:
    """Return the second derivative (n, 3, 3) of the distance to a surface, at a distance from it: W (I + d W)^-1."""
    system = np.eye(3) + distance_mm[:, None, None] * shape_operator
    # At a centre of curvature the distance has no second derivative; the surface is then far too curved for a patch.
    low = np.linalg.eigvalsh(system)[:, 0]
    system[low < 0.2] = np.eye(3)
    return np.asarray(np.linalg.solve(system, shape_operator))


def _robust(residual: Array, weight: Array, cell: NDArray[np.int32], c: int) -> tuple[Array, float]:
    """Return weights (n,) and the scatter of single readings, by Tukey's biweight about each cell's location."""
    n = len(residual)
    step = max(1, n // SORTED_READINGS)
    look = np.arange(0, n, step)
    look = look[weight[look] > 0]
    order = look[np.lexsort((residual[look], cell[look]))]
    counts = np.bincount(cell[look], minlength=c)
    first = np.r_[0, np.cumsum(counts)[:-1]]
    lower, upper = first + np.maximum(counts - 1, 0) // 2, first + counts // 2
    sorted_residual = np.append(residual[order], 0.0)
    last = len(order)
    centre = 0.5 * (sorted_residual[np.minimum(lower, last)] + sorted_residual[np.minimum(upper, last)])
    unseen = counts == 0
    if unseen.any():
        centre[unseen] = float(np.median(residual[look])) if len(look) else 0.0
    many = counts[cell[look]] > 2
    inside = residual[look][many] - centre[cell[look]][many]
    sigma = mad_sigma(inside, 1e-4, about_zero=True)
    out = weight
    for _ in range(2):
        out = weight * tukey_weights(residual - centre[cell], 1.2 * sigma)
        total = np.bincount(cell, out, c)
        shifted = np.bincount(cell, out * residual, c) / np.where(total > 0, total, 1.0)
        centre = np.where(total > 0, shifted, centre)
    return out, sigma
