"""The way of the probe, rebuilt from its readings: where each pose stood, in which pass, and how far along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from planner.frames import Array
from planner.probe import law_offsets_mm
from planner.setup import Probe


@dataclass(frozen=True, eq=False)
class PoseLine:
    """m poses in order of time. position_base (m, 3): middle of the array, mm. array_base, beam_base (m, 3): its axis,
    and where it fires. pass_id (m,).

    s_mm (m,): path length, straight across the gaps between passes. travel_base (m, 3): unit direction of travel, zero
    where the probe stood. present (m,): False for a pose without any reading, whose other rows mean nothing.
    """

    position_base: Array
    array_base: Array
    beam_base: Array
    pass_id: NDArray[np.int32]
    s_mm: Array
    travel_base: Array
    present: NDArray[np.bool_]

    @property
    def spacing_mm(self) -> float:
        """Median distance between neighbouring poses of a pass (mm)."""
        rows = np.flatnonzero(self.present)
        step = np.diff(self.s_mm[rows])[np.diff(self.pass_id[rows]) == 0]
        step = step[step > 0]
        return float(np.median(step)) if len(step) else 0.0


def pose_line(cloud: PointCloud, probe: Probe) -> PoseLine:
    """Return the poses of an ultrasonic cloud."""
    offsets = law_offsets_mm(probe)
    m = 1 + max(int(cloud.pose_index.max(initial=-1)), int(cloud.lost_pose_index.max(initial=-1)))
    position, array, beam, pass_id = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros((m, 3)), np.zeros(m, dtype=np.int32)
    present = np.zeros(m, dtype=bool)
    arrays = np.zeros((len(cloud), 3)) if cloud.arrays_base is None else cloud.arrays_base
    last = np.full(m, -1, dtype=np.int64)
    ends = np.flatnonzero(np.r_[cloud.pose_index[1:] != cloud.pose_index[:-1], len(cloud) > 0])
    last[cloud.pose_index[ends]] = ends
    heard = np.flatnonzero(last >= 0)
    row = last[heard]
    array[heard] = arrays[row]
    position[heard] = cloud.origins_base[row] - offsets[cloud.law[row] - 1][:, None] * arrays[row]
    if cloud.beams_base is not None:
        beam[heard] = cloud.beams_base[row]
    pass_id[heard], present[heard] = cloud.pass_id[row], True
    _add_silent_poses(cloud, offsets, position, array, beam, pass_id, present)
    rows = np.flatnonzero(present)
    step = np.diff(position[rows], axis=0)
    length = np.linalg.norm(step, axis=1)
    s = np.zeros(m)
    s[rows] = np.concatenate([[0.0], np.cumsum(length)])[: len(rows)]
    return PoseLine(position, array, beam, pass_id, s, _travel(rows, step, pass_id, m), present)


def _add_silent_poses(
    cloud: PointCloud,
    offsets: Array,
    position: Array,
    array: Array,
    beam: Array,
    pass_id: NDArray,
    present: NDArray,
) -> None:
    """Fill in the poses that heard nothing, from two of their lost laws (the ends of the array)."""
    if not len(cloud.lost_pose_index):
        return
    m = len(present)
    low, high = np.full(m, -1, dtype=np.int64), np.full(m, -1, dtype=np.int64)
    order = np.argsort(cloud.lost_law, kind="stable")
    low[cloud.lost_pose_index[order[::-1]]] = order[::-1]
    high[cloud.lost_pose_index[order]] = order
    silent = np.flatnonzero(~present & (low >= 0))
    a, b = low[silent], high[silent]
    xa, xb = offsets[cloud.lost_law[a] - 1], offsets[cloud.lost_law[b] - 1]
    span = (xb - xa)[:, None]
    along = np.divide(
        cloud.lost_origins_base[b] - cloud.lost_origins_base[a], span, out=np.zeros((len(a), 3)), where=span != 0
    )
    array[silent], beam[silent] = along, cloud.lost_beams_base[a]
    position[silent] = cloud.lost_origins_base[a] - xa[:, None] * along
    pass_id[silent], present[silent] = cloud.lost_pass_id[a], True


def _travel(rows: NDArray, step: Array, pass_id: NDArray[np.int32], m: int) -> Array:
    """Unit direction of travel at each pose: the mean of the steps before and after it within its pass."""
    inside = (np.diff(pass_id[rows]) == 0)[:, None]
    total = np.zeros((len(rows), 3))
    total[:-1] += np.where(inside, step, 0.0)
    total[1:] += np.where(inside, step, 0.0)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    travel = np.zeros((m, 3))
    travel[rows] = np.divide(total, length, out=np.zeros_like(total), where=length > 0)
    return travel
