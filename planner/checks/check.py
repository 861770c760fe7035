"""All checks of a path: one call, collected issues, and the arrays behind them."""

import numpy as np

from planner.checks.clearance import Envelope
from planner.checks.collision import path_clearance
from planner.checks.fixture import fixture_reach_mm
from planner.checks.keepout import keep_out_gap_mm, keep_out_wrist_mm
from planner.checks.motion import robot_motion
from planner.checks.path_check import PathCheck
from planner.checks.say import say_clearance, say_fixture, say_seen
from planner.checks.say_robot import say_robot
from planner.checks.ultrasound import seen
from planner.issues import Issue
from planner.probe import tool_axes
from planner.robot.load import load_robot
from planner.robot.model import Robot
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.solid import solid_of
from planner.toolpath import ToolPath

_ORDER = {"error": 0, "warning": 1, "info": 2}


def check(curved: CurvedSurface, path: ToolPath, setup: Setup, robot: Robot | None = None) -> PathCheck:
    """Return everything that can be said about a path before the robot moves.

    `path`: dense or decimated; between its poses clearance is proven for straight and for splined motion. `robot`: by
    default the one `setup.robot` names. Raises EchoBaseError `robot-unknown`.
    """
    arm = load_robot(setup.robot) if robot is None else robot
    what = seen(curved, path, setup)
    moving = envelope(setup, arm)
    clear = path_clearance(solid_of(curved.surface.part), path, moving, 0.0)
    beside, crossed = keep_out_gap_mm(curved, path, setup)
    wrist_off, touched = keep_out_wrist_mm(curved, path, setup, moving)
    fixture = fixture_reach_mm(curved, path, setup)
    motion = robot_motion(arm, path, setup)
    issues: list[Issue] = []
    if len(path) == 0:
        issues.append(Issue("error", "path-empty", f"The {path.kind} path has no poses.", "Plan it first.", path.kind))
    else:
        issues += (
            say_seen(path, setup, what)
            + say_clearance(path, clear)
            + crossed
            + touched
            + say_fixture(path, setup, fixture)
        )
        issues += say_robot(arm, path, setup, motion)
    issues.sort(key=lambda issue: _ORDER[issue.severity])
    found = motion.reach
    pad = len(path) - len(motion.jumped)
    return PathCheck(
        what.tilt_deg,
        what.standoff_mm,
        what.curvature_loss_db,
        what.sagitta_mm,
        what.effective_swath_mm,
        clear.nozzle_mm,
        np.minimum(clear.wrist_mm, wrist_off),
        beside,
        fixture,
        found.axes_deg,
        found.reachable,
        found.singular,
        np.r_[motion.jumped, np.zeros(pad, dtype=bool)],
        found.margin_deg.min(axis=1),
        np.r_[motion.speed_share, np.full(pad, np.nan)],
        found.status,
        found.turn,
        arm.name,
        tuple(issues),
    )


def check_path(curved: CurvedSurface, path: ToolPath, setup: Setup, robot: Robot | None = None) -> list[Issue]:
    """Return the issues of `check`, most severe first."""
    return list(check(curved, path, setup, robot).issues)


def envelope(setup: Setup, robot: Robot) -> Envelope:
    """Return nozzle and wrist as they move with EchoBase's TCP."""
    T_flange_tcp = setup.tool.tcp.transform("flange", "tcp")
    T_tcp_flange = tool_axes(setup.tool).inv() @ T_flange_tcp.inv()
    # T_flange_tcp is that of the tool as taught; its axes are renamed to beam z, array x before use.
    wrist = T_tcp_flange.points(np.array([0.0, 0.0, -robot.file.opw.c4_mm]))
    return Envelope(setup.tool.nozzle_radius_mm, setup.tool.nozzle_length_mm, wrist, robot.file.wrist_radius_mm)
