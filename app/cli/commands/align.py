"""`echobase align`."""

import argparse
from typing import Any

from app import workflow
from app.cli.run import DONE, FAILED, progress_printer, say, say_issues
from app.folder import clear_programs, write_artifacts
from app.steps.records import read_record
from planner.errors import fail

CELLS = (("x_mm", "X", 3), ("y_mm", "Y", 3), ("z_mm", "Z", 3), ("a_deg", "A", 4), ("b_deg", "B", 4), ("c_deg", "C", 4))


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Find the part, write correction, report and (unless it failed) the corrected program."""
    for scan in args.scans:
        if not scan.is_file():
            raise fail("file-missing", f"there is no file '{scan.name}'.", "Check the path.", str(scan))
    options = workflow.AlignOptions.from_folder(
        args.directory,
        method=args.method,
        edges=args.edges,
        non_rigid=args.non_rigid,
        base=args.base,
        record=None if args.record is None else read_record(args.record),
    )
    clear_programs(args.directory, "correction", "corrected")
    result = workflow.align(args.directory, args.scans, options, progress_printer(args))
    write_artifacts(args.directory, result.artifacts)
    say_correction(args, result.correction)
    say_issues(args, list(result.issues))
    say(args, f"written to {args.directory}/correction" + ("" if result.failed else f" and {args.directory}/corrected"))
    return {
        "ok": not result.failed,
        "files": sorted(result.artifacts),
        **result.correction,
    }, FAILED if result.failed else DONE


def pose_line(pose: dict[str, float]) -> str:
    """Return a pose as `X 1.000 Y ... C 0.5000`."""
    return "  ".join(f"{name} {pose[key]:9.{digits}f}" for key, name, digits in CELLS)


def say_correction(args: argparse.Namespace, content: dict[str, Any]) -> None:
    """Print verdict, correction, statuses and prediction of a correction.json."""
    say(args, f"verdict    {content['verdict'].upper()} ({content['method']})")
    if content["correction"] is None:
        return
    say(args, f"correction {pose_line(content['correction'])}")
    say(
        args,
        "           " + "  ".join(f"{k.upper()} {d['status']} {d['sigma']:.3g}" for k, d in content["dof"].items()),
    )
    say(args, f"BASE[{content['base']['number']}]    {pose_line(content['base'])}")
    say(args, f"residual   {content['residual']['rms_mm']:.3f} mm rms, {content['residual']['readings']} readings")
    for name in ("before", "after"):
        p = content["prediction"].get(name)
        if p:
            say(
                args,
                f"{name:<10} ToF std {p['tof_std_mm']:.3f} mm, range {p['tof_range_mm']:.3f} mm, "
                f"largest tilt {p['tilt_max_deg']:.3f} deg, within 2 dB {p['within_2db']:.1%}",
            )
