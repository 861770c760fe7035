"""Can the robot follow the whole path in one configuration, and how close to trouble does it come?

LIN, SLIN and splines keep the Status they start with and let every axis turn on without a jump, so one branch of the
inverse kinematics is followed through all poses and its axes are unwrapped; whole turns are added once, for the path.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform
from planner.robot.kinematics import BRANCHES, inverse, status, turn, wrist_x_mm
from planner.robot.model import Robot

# Closer to A5 = 0 than this, A4 and A6 turn about almost one line and small motions ask for large axis speeds.
WRIST_SINGULAR_DEG = 5.0
# Closer than this to the stretched arm (A3), or to the wrist standing above axis 1, the same holds for A2/A3 and A1.
ELBOW_SINGULAR_DEG = 3.0
OVERHEAD_SINGULAR_MM = 50.0
# Where margins are wider than this they no longer decide between configurations.
COMFORT_DEG = 30.0
MAX_TURNS = 2


@dataclass(frozen=True, eq=False)
class Reach:
    """The axes of a path of n poses in the configuration that serves it best.

    axes_deg (n, 6): unwrapped; NaN where the configuration does not exist. reachable (n,): it exists, within the limits.
    exists (n,): within the arm's reach, limits apart. margin_deg (n, 6): distance to the nearer limit of each axis,
    negative beyond. wrist_singular, elbow_singular, overhead (n,): within the thresholds above. branch: 0..7, or -1
    when no pose can be reached in any. status, turn: of the first pose that exists.
    """

    axes_deg: Array
    exists: NDArray[np.bool_]
    reachable: NDArray[np.bool_]
    margin_deg: Array
    wrist_singular: NDArray[np.bool_]
    elbow_singular: NDArray[np.bool_]
    overhead: NDArray[np.bool_]
    branch: int
    status: int
    turn: int

    @property
    def singular(self) -> NDArray[np.bool_]:
        """Near any singularity (n,)."""
        return self.wrist_singular | self.elbow_singular | self.overhead

    @property
    def share(self) -> float:
        """Share of the poses that are reachable, 0..1."""
        return float(self.reachable.mean()) if len(self.reachable) else 1.0


def reach(robot: Robot, Ts_robroot_flange: Transform) -> Reach:
    """Return how the robot goes through a stack of n flange poses, in order, in one configuration.

    Of the eight branches the one with most reachable poses is taken; of equals the one with the best mixture of margin
    to limits and singularities and of axis travel.
    """
    every = _unwrapped(inverse(robot, Ts_robroot_flange))
    limits = robot.limits_deg
    every = every + _whole_turns(every, limits)
    margin = np.minimum(every - limits[:, 0], limits[:, 1] - every)
    exists = np.isfinite(every[:, :, 0])
    inside = exists & (np.where(exists[:, :, None], margin, -1.0) >= 0.0).all(axis=2)
    best = _best_branch(robot, every, margin, exists, inside)
    axes = every[:, best]
    first = axes[exists[:, best]][:1]
    return Reach(
        axes,
        exists[:, best],
        inside[:, best],
        margin[:, best],
        _below(np.abs(axes[:, 4]), WRIST_SINGULAR_DEG),
        _below(np.abs(axes[:, 2] - robot.elbow_singular_deg), ELBOW_SINGULAR_DEG),
        _below(np.abs(wrist_x_mm(robot, axes)), OVERHEAD_SINGULAR_MM),
        best if len(first) else -1,
        int(status(robot, first)[0]) if len(first) else 0,
        int(turn(first)[0]) if len(first) else 0,
    )


def _below(value: Array, threshold: float) -> NDArray[np.bool_]:
    return np.nan_to_num(value, nan=np.inf) < threshold


def _unwrapped(axes: Array) -> Array:
    """Let every axis of every branch (n, 8, 6) go on from pose to pose without a jump of more than half a turn."""
    n = len(axes)
    if n < 2:
        return axes
    known = np.isfinite(axes[:, :, 0])
    # A pose that does not exist hands on the last one that did, so that the path continues where it comes back.
    last = np.maximum.accumulate(np.where(known, np.arange(n)[:, None], -1), axis=0)
    filled = np.take_along_axis(axes, np.maximum(last, 0)[:, :, None], axis=0)
    filled = np.where(np.isfinite(filled), filled, 0.0)
    step = np.diff(filled, axis=0)
    turns = np.zeros_like(filled)
    np.cumsum(-360.0 * np.round(step / 360.0), axis=0, out=turns[1:])
    return np.where(known[:, :, None], axes + turns, np.nan)


def _whole_turns(axes: Array, limits: Array) -> Array:
    """Return the whole turns (1, 8, 6), deg, that bring most of each axis inside its limits, with the widest margin."""
    n = len(axes)
    best = np.zeros((1, BRANCHES, 6))
    if n == 0 or not np.isfinite(axes).any():
        return best
    shifts = 360.0 * np.arange(-MAX_TURNS, MAX_TURNS + 1)
    score = np.zeros((len(shifts), BRANCHES, 6))
    for i, shift in enumerate(shifts):
        margin = np.minimum(axes + shift - limits[:, 0], limits[:, 1] - axes - shift)
        known = np.nan_to_num(margin, nan=-np.inf)
        inside = (known >= 0.0).sum(axis=0)
        least = np.where(np.isneginf(known), np.inf, known).min(axis=0)
        score[i] = inside + np.clip(least, -1e3, 1e3) * 1e-4
    best[0] = shifts[np.argmax(score, axis=0)]
    return best


def _best_branch(robot: Robot, axes: Array, margin: Array, exists: NDArray[np.bool_], inside: NDArray[np.bool_]) -> int:
    """Return the branch with most reachable poses, then most existing ones, then the best comfort."""
    if len(axes) == 0:
        return 0
    keep = np.where(exists[:, :, None], 1.0, np.nan)
    least = {
        "limit": np.where(exists, margin.min(axis=2), np.inf).min(axis=0),
        "wrist": np.nan_to_num(np.abs(axes[:, :, 4]), nan=np.inf).min(axis=0),
        "elbow": np.nan_to_num(np.abs(axes[:, :, 2] - robot.elbow_singular_deg), nan=np.inf).min(axis=0),
    }
    comfort = sum(np.clip(value, 0.0, COMFORT_DEG) / COMFORT_DEG for value in least.values())
    steps = np.abs(np.diff(axes * keep, axis=0))
    travel = np.nansum(steps, axis=(0, 2))
    # The longest travel of the eight costs as much as one full margin.
    comfort = comfort - travel / max(float(travel.max(initial=0.0)), 1e-9)
    # Of equals the one nearest to HOME: hoses and cables lie best with A1, A4 and A6 near zero.
    wound = np.nan_to_num(np.abs(axes[:, :, [0, 3, 5]])).mean(axis=0).sum(axis=1)
    comfort = comfort - wound / 1080.0
    order = np.lexsort((comfort, exists.sum(axis=0), inside.sum(axis=0)))
    return int(order[-1])
