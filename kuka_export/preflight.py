"""Everything that can be wrong with a program before a line of it is written. All of it collected, each with a remedy."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kuka_export.names import MAX_STEM, legal_name, name_problem
from kuka_export.numbers import SINGLE_PRECISION_MM
from kuka_export.options import ProgramOptions
from kuka_export.profiles import Profile
from kuka_export.route import Route, data_switches, repeats, scan_speed_mm_s, spacing_mm
from planner.frames import Transform
from planner.issues import Issue
from planner.setup import Setup
from planner.toolpath import Role, ToolPath

MAX_SPEED_MM_S = 3000.0
"""KSS: $VEL_MA.CP is 3 m/s."""
CLOSE_MM = 0.1
WIDE_MM = 15.0
WIDE_RATIO = 2.0


def check_request(path: ToolPath, setup: Setup, profile: Profile, name: str, options: ProgramOptions) -> list[Issue]:
    """Return what is wrong with name, indices, speeds and options."""
    issues: list[Issue] = []
    problem = name_problem(name, MAX_STEM)
    if problem:
        issues.append(
            _error("krl-name", f"The program name '{name[:40]}' {problem}.", f"Use '{legal_name(name)}'.", "name")
        )
    numbers = [
        ("base.number", setup.base.number, profile.base_numbers),
        ("tool.number", setup.tool.number, profile.tool_numbers),
    ]
    if setup.base.corrected_number is not None:
        numbers.append(("base.corrected_number", setup.base.corrected_number, profile.base_numbers))
    issues += [
        _error(
            "krl-index",
            f"{field} is {value}; {profile.name} has 1 to {most}.",
            "Choose a free index.",
            f"setup.json: {field}",
        )
        for field, value, most in numbers
        if not 1 <= value <= most
    ]
    speeds = [
        ("scan_speed_mm_s", scan_speed_mm_s(path.kind, setup, options)),
        ("approach_speed_mm_s", options.approach_speed_mm_s),
        ("link_speed_mm_s", options.link_speed_mm_s),
    ]
    issues += [
        _error(
            "krl-speed",
            f"{field} is {value:g} mm/s; the robot does {MAX_SPEED_MM_S:g} at most.",
            "Lower the speed.",
            field,
        )
        for field, value in speeds
        if not 0.01 <= value <= MAX_SPEED_MM_S
    ]
    if options.motion is not None and options.motion not in profile.families:
        have = " or ".join(profile.families)
        issues.append(
            _error(
                "krl-motion",
                f"{profile.name} programs do not use '{options.motion}' motions.",
                f"Use {have}.",
                "motion",
            )
        )
    return issues


def check_path(path: ToolPath) -> list[Issue]:
    """Return what makes a path unusable before a pose of it is computed: no poses, numbers that are none."""
    if len(path) == 0:
        return [_error("krl-empty", "The path has no poses.", "Plan the path again.", "path")]
    bad = np.flatnonzero(~(np.isfinite(path.Ts_part_contact.matrix).all(axis=(1, 2)) & np.isfinite(path.standoff_mm)))
    if len(bad):
        place = f"pass {int(path.pass_id[bad[0]]) + 1} pose {int(bad[0])}"
        return [
            _error(
                "krl-not-finite",
                f"{len(bad)} poses are not numbers.",
                "Plan the path again; the surface is damaged there.",
                place,
            )
        ]
    return []


def check_route(r: Route, spline: bool) -> list[Issue]:
    """Return what is wrong with the poses: repeated, too close or too far, data runs of one pose, no data."""
    issues: list[Issue] = []
    issues += [
        _error(
            "krl-repeated-pose",
            "A data pose repeats the one before it to rounding; the robot would stop with message 1456.",
            "Decimate the path, or ask for a wider point spacing.",
            _place(r, int(i)),
        )
        for i in np.flatnonzero(repeats(r.poses))[:10]
    ]
    first, last = data_switches(r)
    issues += [
        _error(
            "krl-short-data",
            "A data run has a single pose: no reading lies between its ends.",
            "Plan at least two data poses per pass.",
            _place(r, int(i)),
        )
        for i in np.flatnonzero(first & last)[:10]
    ]
    if not first.any():
        issues.append(
            _error("krl-no-data", "The path takes no data: it has no DATA pose.", "Plan the path again.", "path")
        )
    far = np.flatnonzero(np.abs(r.poses[:, :3]).max(axis=1) > SINGLE_PRECISION_MM)
    if len(far):
        issues.append(
            _warn(
                "krl-far",
                f"{len(far)} poses lie more than {SINGLE_PRECISION_MM:g} mm from the BASE origin, where the "
                "controller's 32-bit numbers no longer hold micrometres.",
                "Move the BASE origin to the part.",
                _place(r, int(far[0])),
            )
        )
    return issues + _spacing_issues(r, spline)


def _spacing_issues(r: Route, spline: bool) -> list[Issue]:
    inside = r.scan & ~r.arrival
    step = spacing_mm(r.poses)
    issues: list[Issue] = []
    close = np.flatnonzero(inside & (step < CLOSE_MM))
    if len(close):
        issues.append(
            _warn(
                "krl-close-poses",
                f"{len(close)} scan poses stand closer than {CLOSE_MM} mm to the one before; the robot will slow down.",
                "Decimate the path.",
                _place(r, int(close[0])),
            )
        )
    if spline:
        after = np.append(step[1:], np.inf)
        both = inside & np.append(inside[1:], False)
        ratio = np.divide(
            np.maximum(step, after),
            np.minimum(step, after),
            out=np.ones_like(step),
            where=both & (np.minimum(step, after) > 0),
        )
        odd = np.flatnonzero((both & (ratio > WIDE_RATIO * 1.001)) | (inside & (step > WIDE_MM * 1.001)))
        if len(odd):
            issues.append(
                _warn(
                    "krl-spline-spacing",
                    f"{len(odd)} spline poses are spaced wider than {WIDE_MM:g} mm or unevenly (beyond 1:{WIDE_RATIO:g}); "
                    "a smooth curve may leave the planned path there.",
                    "Decimate the path with the spline check.",
                    _place(r, int(odd[0])),
                )
            )
    return issues


def check_correction(
    setup: Setup, T_base_basecorr: Transform | None, centroid_base_mm: ArrayLike, r: Route
) -> list[Issue]:
    """Return the limits a correction breaks: displacement of the surface centroid, total rotation. Never clamps."""
    if T_base_basecorr is None:
        return []
    if not np.isfinite(T_base_basecorr.matrix).all():
        return [_error("krl-not-finite", "The correction is not a number.", "Align again.", "correction")]
    c = np.asarray(centroid_base_mm, dtype=np.float64)
    moved = float(np.linalg.norm(T_base_basecorr.points(c) - c))
    turned = float(T_base_basecorr.angle_deg())
    issues: list[Issue] = []
    remedy = "Check the scan and the fixture; if the part really sits there, raise limits in the setup or teach the base again."
    for what, value, most, unit, field in (
        ("moves the centre of the surface by", moved, setup.limits.correction_mm, "mm", "correction_mm"),
        ("turns the part by", turned, setup.limits.correction_deg, "deg", "correction_deg"),
    ):
        if value > most:
            issues.append(
                _error(
                    "correction-limit",
                    f"The correction {what} {value:.3f} {unit}; the limit is {most:g} {unit}.",
                    remedy,
                    f"setup.json: limits.{field}",
                )
            )
    return issues


def data_centroid_base_mm(r: Route, path: ToolPath, setup: Setup) -> np.ndarray:
    """Return the mean data contact point in base (3,), mm: stands in for the surface centroid where nobody gave it."""
    rows = r.source[r.role == Role.DATA]
    if len(rows) == 0:
        return np.zeros(3)
    return np.asarray(setup.T_base_partnom.points(path.Ts_part_contact.xyz_mm[rows].mean(axis=0)))


def size_issue(text: str, where: str) -> Issue:
    """Return the error of a program that does not fit into the controller."""
    return _error(
        "krl-size",
        f"The program does not fit: {text}.",
        "Decimate the path, or raise the limit if the controller holds more.",
        where,
    )


def loads_issue(loads: Sequence[int], total_bytes: int, profile: Profile, load_bytes: int, load_modules: int) -> Issue:
    """Return the warning that a program comes in several loads."""
    return _warn(
        "krl-loads",
        f"{total_bytes} bytes in {sum(loads)} motion modules are more than {profile.name} holds at once "
        f"({load_bytes} bytes, {load_modules} modules): {len(loads)} loads, each with a main module of its own.",
        "Load, run and delete one after the other, or decimate the path.",
        "size",
    )


def _place(r: Route, row: int) -> str:
    return f"pass {int(r.pass_id[row]) + 1} pose {int(r.source[row])}"


def _error(code: str, message: str, remedy: str, where: str) -> Issue:
    return Issue("error", code, message, remedy, where)


def _warn(code: str, message: str, remedy: str, where: str) -> Issue:
    return Issue("warning", code, message, remedy, where)
