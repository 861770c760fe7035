"""The axis values a program starts with."""

from dataclasses import dataclass

import numpy as np

from planner.errors import fail
from planner.frames import Array, Transform
from planner.robot.kinematics import flange_poses
from planner.robot.model import Robot
from planner.robot.reach import reach
from planner.setup import Setup


@dataclass(frozen=True, eq=False)
class FirstAxes:
    """Axis values (6,), deg, KUKA Status and Turn of the first pose of a path."""

    axes_deg: Array
    status: int
    turn: int


def first_axes(robot: Robot, setup: Setup, Ts_base_tcp: Transform, T_world_base: Transform | None = None) -> FirstAxes:
    """Return the axis values for the first of a stack of n poses, in the configuration that serves the whole stack.

    `Ts_base_tcp`: poses of EchoBase's TCP (beam z, array x) in the nominal base. For a corrected program pass
    `T_world_basecorr` as `T_world_base`, and the stack as `Ts_basecorr_tcp`. With an untaught base (all zeros) the result
    means nothing: the caller does not ask.

    Raises EchoBaseError `robot-out-of-reach` if the first pose cannot be reached in that configuration, or the stack is
    empty; poses further on are the business of `planner.checks`.
    """
    if not Ts_base_tcp.is_stack:
        Ts_base_tcp = Transform.from_matrix(Ts_base_tcp.dst, Ts_base_tcp.src, Ts_base_tcp.matrix[None])
    if len(Ts_base_tcp) == 0:
        raise fail("robot-out-of-reach", "There is no pose to start from.", "Plan a path first.")
    found = reach(robot, flange_poses(setup, Ts_base_tcp, T_world_base))
    if not found.reachable[0]:
        why = "lies outside the axis limits" if found.exists[0] else "is beyond the arm's reach"
        raise fail(
            "robot-out-of-reach",
            f"The first pose of the program {why} of the {robot.file.title}"
            f" ({np.count_nonzero(~found.reachable)} of {len(found.reachable)} poses cannot be reached).",
            "Check base, placement, robot_root and tool in the setup, or move the part.",
            "pose 0",
        )
    return FirstAxes(found.axes_deg[0], found.status, found.turn)
