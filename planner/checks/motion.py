"""The robot along the path: reach, limits, singularities, jumps and speeds, pose by pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform
from planner.placement import assume_nominal
from planner.robot.kinematics import flange_poses
from planner.robot.model import Robot
from planner.robot.reach import Reach, reach
from planner.setup import Setup
from planner.toolpath import Role, ToolPath

# An axis that turns this far in one step, and this many times farther than the tool's own motion asks of an arm that
# stands well, has jumped.
JUMP_DEG = 20.0
JUMP_RATIO = 5.0
# Arm length (mm) at which a shift of the flange counts as a turn, when a step is judged.
ARM_MM = 300.0
# Without translation the controller turns the tool at $VEL.ORI; KSS default (deg/s).
TURN_SPEED_DEG_S = 200.0


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """The robot on a path of n poses: `reach`, and per step to the next pose (n - 1,): jumped, and axis speeds.

    axis_speed_deg_s (n - 1, 6): at the scan speed, NaN outside passes and where a pose is out of reach. speed_share
    (n - 1,): the largest share of an axis's top speed, NaN where unknown.
    """

    reach: Reach
    jumped: NDArray[np.bool_]
    axis_speed_deg_s: Array
    speed_share: Array


def scan_speed_mm_s(path: ToolPath, setup: Setup) -> float:
    """Return the speed asked for on the passes of this kind of path (mm/s)."""
    return setup.alignment.scan_speed_mm_s if path.kind == "alignment" else setup.inspection.scan_speed_mm_s


def path_flange_poses(path: ToolPath, setup: Setup) -> Transform:
    """Return `Ts_robroot_flange` of a path on the nominally placed part."""
    return flange_poses(setup, assume_nominal(setup.T_base_partnom) @ path.Ts_part_tcp)


def robot_motion(robot: Robot, path: ToolPath, setup: Setup) -> RobotMotion:
    """Return how the robot goes through the path."""
    flange = path_flange_poses(path, setup)
    found = reach(robot, flange)
    n = len(path)
    if n < 2:
        return RobotMotion(found, np.zeros(0, dtype=bool), np.zeros((0, 6)), np.zeros(0))
    step = np.abs(np.diff(found.axes_deg, axis=0))
    shift_mm = np.linalg.norm(np.diff(flange.xyz_mm, axis=0), axis=1)
    turned_deg = np.degrees((flange.rotation[:-1].inv() * flange.rotation[1:]).magnitude())
    same = path.pass_id[1:] == path.pass_id[:-1]
    asked = turned_deg + np.degrees(shift_mm / ARM_MM)
    largest = np.nan_to_num(step).max(axis=1)
    jumped = same & (largest > JUMP_DEG) & (largest > JUMP_RATIO * asked)
    speed = _speeds(path, setup, step, turned_deg, same)
    share = np.nan_to_num(speed / robot.speeds_deg_s, nan=-1.0).max(axis=1)
    return RobotMotion(found, jumped, speed, np.where(share < 0.0, np.nan, share))


def _speeds(path: ToolPath, setup: Setup, step: Array, turned_deg: Array, same: NDArray[np.bool_]) -> Array:
    scanning = (path.role >= Role.LEAD_IN) & (path.role <= Role.LEAD_OUT)
    moved_mm = np.linalg.norm(np.diff(path.Ts_part_tcp.xyz_mm, axis=0), axis=1)
    seconds = np.maximum(moved_mm / scan_speed_mm_s(path, setup), turned_deg / TURN_SPEED_DEG_S)
    counted = same & scanning[1:] & scanning[:-1] & (seconds > 1e-9)
    return np.where(counted[:, None], step / np.where(counted, seconds, 1.0)[:, None], np.nan)
