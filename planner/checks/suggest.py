"""Where to put a part that is out of reach: a search over translations of the part in the cell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from planner.frames import Array, Transform
from planner.robot.kinematics import inverse
from planner.robot.model import Robot
from planner.robot.reach import reach

SAMPLE_POSES = 60
# Half widths of the grids as shares of the robot's reach, coarse first; each searches about the best so far.
GRIDS = ((1.0, 7), (0.25, 5), (0.08, 5))


@dataclass(frozen=True, eq=False)
class Move:
    """A shift of the part (3,), mm, in robroot axes, and the share of the poses the robot then reaches, 0..1."""

    shift_robroot_mm: Array
    share: float


def better_place(robot: Robot, Ts_robroot_flange: Transform) -> Move:
    """Return the shift of the part that lets the robot reach most of a path in one configuration.

    Of equal shares the one with more margin to the axis limits wins, less 1 deg of it for every 100 mm of shift.
    """
    poses = Ts_robroot_flange[_sample(Ts_robroot_flange.xyz_mm)]
    # The first grid is centred where the middle of the path would stand at half reach in front of the robot.
    home = np.array([0.6 * robot.reach_mm, 0.0, robot.file.opw.c1_mm]) - poses.xyz_mm.mean(axis=0)
    best, best_score = home, -np.inf
    for half, count in GRIDS:
        line = np.linspace(-half, half, count) * robot.reach_mm * 0.5
        grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3) + best
        shares, margins = _try(robot, poses, grid)
        score = shares * 1e3 + margins - np.linalg.norm(grid, axis=1) * 0.01
        top = int(np.argmax(score))
        if score[top] > best_score:
            best, best_score = grid[top], float(score[top])
    best = best.round(0)
    moved = Transform.from_parts("robroot", "flange", Ts_robroot_flange.rotation, Ts_robroot_flange.xyz_mm + best)
    return Move(best, reach(robot, moved).share)


def _sample(xyz_mm: Array) -> NDArray[np.intp]:
    """Return some poses spread over the path, and those that lie farthest out in each direction."""
    n = len(xyz_mm)
    spread = np.linspace(0, n - 1, min(n, SAMPLE_POSES)).round().astype(np.intp)
    return np.unique(np.concatenate([spread, xyz_mm.argmin(axis=0), xyz_mm.argmax(axis=0)]))


def _try(robot: Robot, poses: Transform, shifts: Array) -> tuple[Array, Array]:
    """Return for each shift (k, 3) the reachable share of its best branch and that branch's least margin (deg)."""
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
    branch = share.argmax(axis=1)
    chosen = margin[np.arange(k), :, branch]
    return share[np.arange(k), branch], np.clip(chosen.min(axis=1), -30.0, 30.0)
