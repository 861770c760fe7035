"""The sentences about the robot. Errors when BASE is taught, warnings when it is not."""

import numpy as np

from planner.checks.collect import collapse
from planner.checks.motion import RobotMotion, path_flange_poses, scan_speed_mm_s
from planner.checks.suggest import better_place
from planner.frames import Array
from planner.issues import Issue, Severity
from planner.robot.model import Robot
from planner.setup import Setup
from planner.toolpath import ToolPath


def say_robot(robot: Robot, path: ToolPath, setup: Setup, motion: RobotMotion) -> list[Issue]:
    """Return the issues of reach, axis limits, singularities, jumps and axis speeds."""
    found = motion.reach
    missing = int(np.count_nonzero(~found.reachable))
    if not setup.base.is_taught and missing:
        return collapse(
            path,
            ~found.reachable,
            "warning",
            "reach-untaught",
            f"BASE is untaught (all zeros), so the robot is checked as if the part stood at the world origin; there"
            f" {{count}} of {{of}} poses are out of reach of the {robot.file.title}.",
            "State base (and robot_root) in the setup for a check that means something.",
        )
    severity: Severity = "error" if setup.base.is_taught else "warning"
    issues = _say_reach(robot, path, setup, motion, severity)
    issues += collapse(
        path,
        found.wrist_singular & found.reachable,
        severity if motion.jumped.any() else "warning",
        "singularity-wrist",
        "At {count} of {of} poses A5 is within 5 deg of zero (wrist singularity): A4 and A6 turn fast for small motions.",
        "Tilt the tool on the flange, turn it about the beam, or move the part.",
    )
    issues += collapse(
        path,
        (found.elbow_singular | found.overhead) & found.reachable,
        "warning",
        "singularity-arm",
        "At {count} of {of} poses the arm is nearly stretched, or the wrist stands nearly above axis 1.",
        "Move the part nearer to the middle of the robot's reach.",
    )
    to_next = np.r_[motion.jumped, False]
    turned = np.r_[np.nan_to_num(np.abs(np.diff(found.axes_deg, axis=0))).max(axis=1), 0.0]
    issues += collapse(
        path,
        to_next,
        severity,
        "axis-jump",
        "At {count} steps inside a pass an axis turns far more than the tool does, by up to {worst:.0f} deg in one step.",
        "The path runs past a singularity; turn the tool about the beam, or move the part.",
        turned,
    )
    return issues + _say_speed(robot, path, setup, motion, severity)


def _say_reach(robot: Robot, path: ToolPath, setup: Setup, motion: RobotMotion, severity: Severity) -> list[Issue]:
    found = motion.reach
    if found.reachable.all():
        return []
    advice = _advice(robot, path, setup)
    issues = collapse(
        path,
        ~found.exists,
        severity,
        "reach",
        f"{{count}} of {{of}} poses are beyond the reach of the {robot.file.title} ({robot.reach_mm:.0f} mm to the wrist).",
        advice,
    )
    outside = found.exists & ~found.reachable
    if outside.any():
        beyond = np.where(outside[:, None], np.maximum(-found.margin_deg, 0.0), 0.0)
        names = ", ".join(f"A{i + 1} by {v:.1f} deg" for i, v in enumerate(beyond.max(axis=0)) if v > 0.0)
        issues += collapse(
            path,
            outside,
            severity,
            "axis-limit",
            f"{{count}} of {{of}} poses are outside the axis limits of the {robot.file.title}: {names}.",
            advice if not issues else "Move the part, or turn the tool on the flange.",
        )
    return issues


def _advice(robot: Robot, path: ToolPath, setup: Setup) -> str:
    """Return where the part would be in reach, as a shift in world axes."""
    move = better_place(robot, path_flange_poses(path, setup))
    if not move.shift_robroot_mm.any():
        return (
            "No shift of the part was found that brings more of the path into reach: turn the part, check tool.tcp, or"
            " choose a larger robot."
        )
    turn = setup.robot_root.transform("world", "robroot")
    x, y, z = turn.directions(move.shift_robroot_mm)
    share = "all" if move.share >= 1.0 else f"{100.0 * move.share:.0f} %"
    return (
        f"Move the part by about X {x:.0f}, Y {y:.0f}, Z {z:.0f} mm in world (or the robot the other way): {share} of the"
        " poses are in reach there."
    )


def _say_speed(robot: Robot, path: ToolPath, setup: Setup, motion: RobotMotion, severity: Severity) -> list[Issue]:
    share: Array = np.r_[np.nan_to_num(motion.speed_share, nan=0.0), 0.0]
    speed = scan_speed_mm_s(path, setup)
    worst = float(share.max(initial=0.0))
    safe = np.floor(speed / worst) if worst > 1.0 else speed
    issues = collapse(
        path,
        share > 1.0,
        severity,
        "axis-speed",
        f"At {{count}} steps the scan speed of {speed:g} mm/s asks an axis for up to {{worst:.1f}} times its top speed.",
        f"Scan at {safe:g} mm/s or less, or move the path away from the singularity.",
        share,
    )
    unknown = [f"A{i + 1}" for i, v in enumerate(robot.speeds_deg_s) if np.isnan(v)]
    if unknown:
        top = _top_speeds(motion.axis_speed_deg_s)
        issues.append(
            Issue(
                "info",
                "axis-speed-unknown",
                f"The top speeds of {', '.join(unknown)} of the {robot.file.title} are not known, so they are not checked;"
                f" the path asks for {top}.",
                "Import the robot's own $machine.dat.",
                f"robot {robot.name}",
            )
        )
    return issues


def _top_speeds(speeds_deg_s: Array) -> str:
    top = np.nan_to_num(speeds_deg_s).max(axis=0, initial=0.0)
    return ", ".join(f"{v:.0f}" for v in top) + " deg/s"
