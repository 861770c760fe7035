"""`echobase align`."""

import argparse
from pathlib import Path
from typing import Any

from app import workflow
from app.cli.run import DONE, FAILED, progress_printer, say, say_issues
from app.folder import clear_programs, write_artifacts
from app.steps.corrections import earlier_in
from app.steps.records import read_record
from planner.errors import fail

CELLS = (("x_mm", "X", 3), ("y_mm", "Y", 3), ("z_mm", "Z", 3), ("a_deg", "A", 4), ("b_deg", "B", 4), ("c_deg", "C", 4))


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Find the part, write correction, report and (unless it failed) the corrected program of every plan given."""
    plans = [(args.directory, args.scans), *((folder, scans) for folder, *scans in args.together)]
    for scan in (scan for _, scans in plans for scan in scans):
        if not scan.is_file():
            raise fail("file-missing", f"there is no file '{scan.name}'.", "Check the path.", str(scan))
    record = None if args.record is None else read_record(args.record)
    options = [
        workflow.AlignOptions.from_folder(
            folder,
            method=args.method,
            edges=args.edges,
            non_rigid=args.non_rigid,
            base=args.base,
            record=record,
            earlier=earlier_in(folder),
        )
        for folder, _ in plans
    ]
    for folder, _ in plans:
        clear_programs(folder, "correction", "corrected")
    if not args.together:
        made = [workflow.align(args.directory, args.scans, options[0], progress_printer(args))]
    else:
        items = [
            workflow.PlanScans(folder, scans, option, name)
            for (folder, scans), option, name in zip(plans, options, _names([f for f, _ in plans]), strict=True)
        ]
        made = workflow.align_together(items, progress_printer(args))
    for (folder, _), result in zip(plans, made, strict=True):
        write_artifacts(folder, result.artifacts)
    for (folder, _), result in zip(plans, made, strict=True):
        if args.together:
            say(args, f"plan       {folder}")
        say_correction(args, result.correction)
        say_issues(args, list(result.issues))
        say(args, f"written to {folder}/correction" + ("" if result.failed else f" and {folder}/corrected"))
    failed = any(result.failed for result in made)
    answer = {"ok": not failed, "files": sorted(made[0].artifacts), **made[0].correction}
    if args.together:
        answer["together"] = [
            {"directory": str(folder), "ok": not result.failed, "files": sorted(result.artifacts), **result.correction}
            for (folder, _), result in zip(plans[1:], made[1:], strict=True)
        ]
    return answer, FAILED if failed else DONE


def _names(folders: list[Path]) -> list[str]:
    """Return what plans are called in reports: their folders' names, whole where two are alike."""
    short = [folder.resolve().name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]


def pose_line(pose: dict[str, float]) -> str:
    """Return a pose as `X 1.000 Y ... C 0.5000`."""
    return "  ".join(f"{name} {pose[key]:z9.{digits}f}" for key, name, digits in CELLS)


def base_line(content: dict[str, Any]) -> str:
    """Return the corrected BASE; of an untaught one what the program does, since numbers from zero mean nothing there."""
    base = content["base"]
    if all(base[key] == content["correction"][key] for key, _, _ in CELLS):
        text = "as taught on the controller; the program composes the correction onto it"
    else:
        text = pose_line(base)
    return f"BASE[{base['number']}]    {text}"


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
    say(args, base_line(content))
    say(args, f"residual   {content['residual']['rms_mm']:.3f} mm rms, {content['residual']['readings']} readings")
    for surface in content["surfaces"] or ():
        if surface["readings"]:
            say(args, f"           {surface['rms_mm']:.3f} mm rms on the surface of {surface['name']}")
    for name in ("before", "after"):
        p = content["prediction"].get(name)
        if p:
            say(
                args,
                f"{name:<10} ToF std {p['tof_std_mm']:.3f} mm, range {p['tof_range_mm']:.3f} mm, "
                f"largest tilt {p['tilt_max_deg']:.3f} deg, within 2 dB {p['within_2db']:.1%}",
            )
