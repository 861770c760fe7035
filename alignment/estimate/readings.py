"""Which readings of a cloud are looked at, how much each counts, and what its residual is measured from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from planner.frames import Array

# Readings that are looked at to find a median.
SORTED_READINGS = 75_000
# Below this share of the usual amplitude a reading counts less: half the beam may be off the part.
FULL_AMPLITUDE = 0.6
EVERY = slice(None)
# Of more readings so many are looked at, spread over the scan. What the mean of a cell's forty then still owes to the scatter
# of single readings, a sixth of it, is far less than how much a robot wanders from one cell to the next.
MOST_READINGS = 200_000


@dataclass(frozen=True, eq=False)
class Readings:
    """The m of the `total` readings of a cloud that are looked at: all of them, but in very dense scans.

    rows (m,): which. origins_base (m, 3), distance_mm (m,): as of `model_readings`. amplitude_pct, weight (m,): as of
    `reading_weights`. beams_base (m, 3) or None. pose_index, law (m,): as of the cloud.
    """

    rows: NDArray[np.int64]
    total: int
    origins_base: Array
    distance_mm: Array
    amplitude_pct: Array
    weight: Array
    beams_base: Array | None
    pose_index: NDArray[np.int32]
    law: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.distance_mm)


def look_at(cloud: PointCloud, point_model: str, most: int = MOST_READINGS) -> Readings:
    """Return the readings that are looked at."""
    chosen = sample_rows(len(cloud), most)
    # A slice copies nothing.
    rows = EVERY if len(chosen) == len(cloud) else chosen
    return Readings(
        chosen,
        len(cloud),
        *model_readings(cloud, point_model, rows),
        cloud.amplitude_pct[rows],
        reading_weights(cloud, rows),
        None if cloud.beams_base is None else cloud.beams_base[rows],
        cloud.pose_index[rows],
        cloud.law[rows],
    )


def model_readings(cloud: PointCloud, point_model: str, rows: NDArray | slice = EVERY) -> tuple[Array, Array]:
    """Return (origins (n, 3), distances (n,)) such that distance - dist(origin, surface) is the residual.

    perpendicular: law origins and measured distances. axial (and ready surface points): points, which lie at distance 0.
    """
    origins, distance = cloud.origins_base[rows], cloud.distance_mm[rows]
    if cloud.beams_base is None:
        return origins, np.zeros(len(origins))
    if point_model == "axial":
        return origins + distance[:, None] * cloud.beams_base[rows], np.zeros(len(origins))
    return origins, distance


def reading_weights(cloud: PointCloud, rows: NDArray | slice = EVERY) -> Array:
    """Return weights (n,) from amplitude: full from 60 % of the median on, falling to zero with it; 1 where unknown.

    Of very many readings the median of a part of them, spread evenly, is taken.
    """
    a = cloud.amplitude_pct[rows]
    # An odd step does not keep to the rhythm of an even number of laws.
    look = cloud.amplitude_pct[:: (len(cloud) // SORTED_READINGS) | 1]
    look = look[np.isfinite(look)]
    usual = float(np.median(look)) if len(look) else 0.0
    if usual <= 0.0:
        return np.ones(len(a))
    weight = a * (1.0 / (FULL_AMPLITUDE * usual))
    np.clip(weight, 0.0, 1.0, out=weight)
    weight *= weight
    weight[np.isnan(weight)] = 1.0
    return weight


def sample_rows(n: int, size: int) -> NDArray[np.int64]:
    """Return at most `size` row numbers spread over n rows, always the same ones.

    The step is irrational to the rhythm of laws and poses (golden ratio), so that no law is favoured.
    """
    if n <= size:
        return np.arange(n)
    golden = 0.6180339887498949
    rows = ((np.arange(size) + np.modf(np.arange(size) * golden)[0]) * n // size).astype(np.int64)
    return rows[np.r_[True, rows[1:] != rows[:-1]]]
