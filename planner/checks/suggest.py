"""Where to put a part that is out of reach: a search over translations of the part in the cell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from planner.frames import Array, Transform
from planner.robot.kinematics import inverse
from planner.robot.model import Robot
from planner.robot.reach import reach

SAMPLE_POSES = 30
# Poses of the path, in order, on which the best places are tried for good, one configuration throughout.
TRIAL_POSES = 2000
TRIALS = 8
# Half widths, as shares of the robot's reach, and counts of the grids: about where the part is, and about the middle of
# the robot's reach; then finer about the best.
AROUND_HERE, AROUND_HOME, FINER = (0.2, 5), (0.5, 7), (0.06, 5)
# Margins wider than this (deg) are as good as any; a shift of 100 mm is worth 1 deg of it.
ENOUGH_DEG = 15.0
DEG_PER_MM = 0.01


@dataclass(frozen=True, eq=False)
class Move:
    """A shift of the part (3,), mm, in robroot axes, and the share of the poses the robot then reaches, 0..1."""

    shift_robroot_mm: Array
    share: float


def better_place(robot: Robot, Ts_robroot_flange: Transform) -> Move:
    """Return the shift of the part that lets the robot reach most of a path in one configuration.

    Of equal shares the one with more margin to the axis limits and the shorter shift wins. A shift of zero means that
    nothing better was found.
    """
    poses = Ts_robroot_flange[_sample(Ts_robroot_flange.xyz_mm)]
    home = np.array([0.6 * robot.reach_mm, 0.0, robot.file.opw.c1_mm]) - poses.xyz_mm.mean(axis=0)
    shifts = np.vstack([_grid(robot, np.zeros(3), *AROUND_HERE), _grid(robot, home, *AROUND_HOME)])
    best = shifts[np.argmax(_scores(robot, poses, shifts))]
    shifts = np.vstack([shifts, _grid(robot, best, *FINER)]).round(0)
    order = np.argsort(-_scores(robot, poses, shifts), kind="stable")[:TRIALS]
    trial = Ts_robroot_flange[_evenly(len(Ts_robroot_flange), TRIAL_POSES)]
    found = Move(np.zeros(3), reach(robot, trial).share)
    for shift in shifts[order]:
        share = reach(robot, _shifted(trial, shift)).share
        if share > found.share:
            found = Move(shift, share)
        if found.share == 1.0:
            break
    if not found.shift_robroot_mm.any() or len(trial) == len(Ts_robroot_flange):
        return found
    return Move(found.shift_robroot_mm, reach(robot, _shifted(Ts_robroot_flange, found.shift_robroot_mm)).share)


def _shifted(poses: Transform, shift: Array) -> Transform:
    return Transform.from_parts(poses.dst, poses.src, poses.rotation, poses.xyz_mm + shift)


def _grid(robot: Robot, centre: Array, half: float, count: int) -> Array:
    line = np.linspace(-half, half, count) * robot.reach_mm
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3) + centre


def _evenly(n: int, count: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, n - 1, min(n, count)).round().astype(np.intp))


def _sample(xyz_mm: Array) -> NDArray[np.intp]:
    """Return some poses spread over the path, and those that lie farthest out in each direction."""
    spread = _evenly(len(xyz_mm), SAMPLE_POSES)
    return np.unique(np.concatenate([spread, xyz_mm.argmin(axis=0), xyz_mm.argmax(axis=0)]))


def _scores(robot: Robot, poses: Transform, shifts: Array) -> Array:
    """Return a score for each shift (k, 3): first the reachable share of the best branch, then margin and nearness."""
    k, n = len(shifts), len(poses)
    xyz = (poses.xyz_mm[None] + shifts[:, None]).reshape(-1, 3)
    rotation = type(poses.rotation).concatenate([poses.rotation] * k)
    stack = Transform("robroot", "flange", RigidTransform.from_components(xyz, rotation))
    axes = inverse(robot, stack)
    low, high = robot.limits_deg.T
    # A whole turn more or less may bring an axis inside its limits.
    turned = axes[..., None] + np.array([-360.0, 0.0, 360.0])
    margin = np.minimum(turned - low[:, None], high[:, None] - turned).max(axis=-1).min(axis=-1)
    margin = np.nan_to_num(margin, nan=-360.0).reshape(k, n, 8)
    share = (margin >= 0.0).mean(axis=1)
    comfort = np.clip(margin.min(axis=1), -30.0, ENOUGH_DEG)
    score = (share * 1e4 + comfort).max(axis=1)
    return np.asarray(score - np.linalg.norm(shifts, axis=1) * DEG_PER_MM)
