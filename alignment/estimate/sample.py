"""A sample of the readings of a scan, to search with: its residuals at any placement."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.readings import model_readings, reading_weights, sample_rows
from alignment.estimate.surface_rows import Rows, Track
from planner.frames import Array, Transform
from planner.surface.curved import CurvedSurface
from planner.surface.follow import Follower

SAMPLE = 1500
# Of the sample so many find the way; all of it says where it ends.
FEW = 500


@dataclass(frozen=True, eq=False)
class Sample:
    """Readings of one scan, spread over it.

    heard (n,): how much each counts. rows: gives their residuals at a placement, motions about a centre.
    """

    heard: Array
    rows: Callable[[Transform, Array], Rows]

    def __len__(self) -> int:
        return len(self.heard)


@dataclass(frozen=True, eq=False)
class Sampler:
    """every: the whole sample. few: gives fewer of it, for one search: their feet are followed however far they go."""

    every: Sample
    few: Callable[[], Sample]


def sampler(cloud: PointCloud, curved: CurvedSurface, point_model: str, size: int = SAMPLE) -> Sampler:
    """Return the sample of at most `size` readings of a cloud on its own surface."""
    rows = sample_rows(len(cloud), size)
    origins, distance = model_readings(cloud, point_model, rows)
    beams = None if cloud.beams_base is None else cloud.beams_base[rows]
    heard = reading_weights(cloud, rows)
    every = Sample(heard, Track(curved, origins, distance, beams).rows)
    some = np.arange(0, len(rows), max(1, len(rows) // FEW))
    if len(some) == len(rows):
        return Sampler(every, lambda: every)

    def few() -> Sample:
        follower = Follower(curved, loose=True)
        track = Track(curved, origins[some], distance[some], None if beams is None else beams[some], follower)
        return Sample(heard[some], track.rows)

    return Sampler(every, few)
