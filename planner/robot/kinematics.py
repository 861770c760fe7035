"""Forward and inverse kinematics of `Robot`, and KUKA's Status and Turn. Stacks in, stacks out; mm and degrees."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import RigidTransform

from planner.frames import Array, Transform
from planner.probe import tool_axes
from planner.robot.model import Robot
from planner.setup import Setup

BRANCHES = 8
Ints = NDArray[np.int64]

# A window that no axis value meets: the solver then skips the conditioning of each branch, which nobody reads here.
_NO_WINDOW = [(1e6, 1e6 + 1.0)] * 6


def forward(robot: Robot, axes_deg: ArrayLike) -> Transform:
    """Return `T_robroot_flange` of axis values (6,) or `Ts_robroot_flange` of (n, 6), deg."""
    axes = np.asarray(axes_deg, dtype=np.float64)
    rigid = robot.opw.batch_forward(np.atleast_2d(axes))
    return Transform("robroot", "flange", rigid if axes.ndim == 2 else rigid[0])


def inverse(robot: Robot, Ts_robroot_flange: Transform) -> Array:
    """Return the axis values of all eight branches (n, 8, 6), deg in (-180, 180]; NaN where a branch does not exist.

    Limits are not applied. Branch b = 4 wrist + 2 shoulder + elbow keeps one Status: see `branch_status`.
    """
    rigid = Ts_robroot_flange.rigid
    stack = RigidTransform.concatenate([rigid]) if rigid.single else rigid
    return np.asarray(robot.opw.reach(stack, joint_limits=_NO_WINDOW).joints)


def flange_poses(setup: Setup, Ts_base_tcp: Transform, T_world_base: Transform | None = None) -> Transform:
    """Return `Ts_robroot_flange` that brings EchoBase's TCP (beam z, array x) to `Ts_base_tcp`.

    `Ts_base_tcp` in the nominal base; for a corrected one pass `T_world_basecorr` and a stack that is named alike.
    """
    T_world = setup.T_world_base if T_world_base is None else T_world_base
    T_robroot_world = setup.robot_root.transform("world", "robroot").inv()
    T_tcp_flange = setup.tool.tcp.transform("flange", "tcp").inv()
    return T_robroot_world @ T_world @ Ts_base_tcp @ tool_axes(setup.tool).inv() @ T_tcp_flange


def wrist_x_mm(robot: Robot, axes_deg: ArrayLike) -> Array:
    """Return the x coordinate of the wrist centre in the frame that turns with axis 1 (n,), mm; negative: overhead."""
    axes = np.atleast_2d(np.asarray(axes_deg, dtype=np.float64))
    o, sign = robot.file.opw, np.where(robot.file.reversed, -1.0, 1.0)
    raw = np.radians((axes - robot.file.offset_deg) * sign)
    upper, forearm = raw[:, 1], raw[:, 1] + raw[:, 2]
    return np.asarray(o.a1_mm + o.c2_mm * np.sin(upper) + o.c3_mm * np.sin(forearm) + o.a2_mm * np.cos(forearm))


def status(robot: Robot, axes_deg: ArrayLike) -> Ints:
    """Return KUKA's Status of axis values (n, 6), shape (n,).

    Bit 0: wrist centre behind axis 1 (overhead). Bit 1: A3 beyond the stretched arm (0 deg where the wrist does not lie
    off the forearm axis). Bit 2: A5 negative. Rules resolved on 1,588 taught points of a real backup.
    """
    axes = np.atleast_2d(np.asarray(axes_deg, dtype=np.float64))
    axes = axes.round(4)
    overhead = wrist_x_mm(robot, axes) < 0.0
    elbow = axes[:, 2] > robot.elbow_singular_deg
    flip = axes[:, 4] < 0.0
    return overhead.astype(np.int64) + 2 * elbow + 4 * flip


def turn(axes_deg: ArrayLike) -> Ints:
    """Return KUKA's Turn of axis values (n, 6), shape (n,): bit i - 1 is set where A_i is negative.

    Values that a program writes as 0.0000 count as zero, so that text and bits agree.
    """
    axes = np.atleast_2d(np.asarray(axes_deg, dtype=np.float64)).round(4)
    return np.asarray((axes < 0.0) @ (1 << np.arange(6)), dtype=np.int64)
