"""Poses of a calibration scan near each other, between which the robot's error hardly changes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

# For a correlation through the air, which couples all of them; and for one along the way, which couples neighbours.
MOST_STATIONS, MOST_ALONG = 160, 4000
# A turn of the wrist by one radian makes the robot's error as new as a move of this many mm.
LEVER_MM = 100.0
# A step this many times the usual one begins another pass, whose errors may be new.
JUMP, FAR_MM = 4.0, 1e6
# With so many passes each counts as one error; else stretches of this many mm do.
ENOUGH_RUNS, STRETCH_MM = 12, 50.0


@dataclass(frozen=True, eq=False)
class Stations:
    """Poses near each other, between which the robot's error hardly changes.

    of_pose (m,): station of each pose. apart: distances (s, s) between stations, mm: along the way recorded ("path"), the
    same but far between passes ("passes"), and through the air ("space"). next_mm: of the first two, those from each
    station to the next (s - 1,).
    """

    of_pose: NDArray[np.int64]
    apart: dict[str, Array]
    next_mm: dict[str, Array]

    def __len__(self) -> int:
        return len(self.next_mm["path"]) + 1


def runs(rotation: Array, origin_base: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the pass of each pose (m,), told from how far the robot travels between them, and the way to it (m,), mm."""
    turn = np.arccos(np.clip((np.einsum("nij,nij->n", rotation[1:], rotation[:-1]) - 1.0) / 2.0, -1.0, 1.0))
    step = np.linalg.norm(np.diff(origin_base, axis=0), axis=1) + LEVER_MM * turn
    path = np.concatenate([[0.0], np.cumsum(step)])
    moved = step[step > 1e-6]
    if not len(moved):
        return np.zeros(len(path), dtype=np.int64), path
    # Between passes the robot travels farther than from pose to pose, and perhaps another way.
    return np.concatenate([[0], np.cumsum(step > JUMP * np.median(moved))]), path


def stretches(rotation: Array, origin_base: Array) -> NDArray[np.int64]:
    """Return, for m poses, which of them share the robot's error (m,): a pass, or stretches of it if passes are few."""
    run, path = runs(rotation, origin_base)
    if run[-1] + 1 >= ENOUGH_RUNS:
        return run
    start = np.unique(run, return_index=True)[1]
    part = np.floor((path - path[start][run]) / STRETCH_MM).astype(np.int64)
    return np.asarray(np.unique(run * (part.max() + 1) + part, return_inverse=True)[1].ravel())


def stations(rotation: Array, origin_base: Array) -> tuple[Stations, Stations]:
    """Return stations of m poses in the order recorded, few and many; rotation (m, 3, 3), origin_base (m, 3).

    No station holds poses of two passes, whose errors are not one. The many have no `apart`.
    """
    run, path = runs(rotation, origin_base)
    few = _stations(run, path, MOST_STATIONS)
    # The pose in the middle of each station stands for it.
    middle, next_mm = _middles(few, run, path)
    r, p, s = rotation[middle], origin_base[middle], path[middle]
    cosine = (np.einsum("aij,bij->ab", r, r) - 1.0) / 2.0
    turned = np.arccos(np.clip(cosine, -1.0, 1.0))
    np.fill_diagonal(turned, 0.0)
    air = np.hypot(np.linalg.norm(p[:, None] - p[None], axis=2), LEVER_MM * turned)
    way = np.abs(s[:, None] - s[None])
    same = run[middle][:, None] == run[middle][None]
    apart = {"path": way, "passes": np.where(same, way, FAR_MM), "space": air}
    many = _stations(run, path, MOST_ALONG)
    return Stations(few, apart, next_mm), Stations(many, {}, _middles(many, run, path)[1])


def _stations(run: NDArray[np.int64], path: Array, most: int) -> NDArray[np.int64]:
    """Return the station of each pose (m,): a stretch of a pass, as short as makes no more than `most` stations."""
    start = np.unique(run, return_index=True)[1]
    within, width = path - path[start][run], 0.5
    while True:
        stretch = np.floor(within / width).astype(np.int64)
        station = np.unique(run * (stretch.max() + 1) + stretch, return_inverse=True)[1].ravel()
        if station.max() < max(most, len(start)):
            return np.asarray(station)
        width *= 1.3


def _middles(
    station: NDArray[np.int64], run: NDArray[np.int64], path: Array
) -> tuple[NDArray[np.int64], dict[str, Array]]:
    """Return the pose in the middle of each station (s,), and the ways from each to the next."""
    first = np.unique(station, return_index=True)[1]
    middle = first + (np.bincount(station) - 1) // 2
    way = np.maximum(np.diff(path[middle]), 1e-6)
    return middle, {"path": way, "passes": np.where(np.diff(run[middle]) == 0, way, FAR_MM)}
