"""`echobase assess`."""

import argparse
from typing import Any

from app import workflow
from app.cli.run import DONE, progress_printer, say, say_issues
from app.folder import clear_programs, write_artifacts
from app.steps.corrections import earlier_in
from app.steps.records import read_record
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Judge an inspection scan; write assessment.json and its report."""
    for scan in (*args.scans, *args.before):
        if not scan.is_file():
            raise fail("file-missing", f"there is no file '{scan.name}'.", "Check the path.", str(scan))
    record = None if args.record is None else read_record(args.record)
    options = workflow.AssessOptions(
        tuple(args.before), args.base, args.before_base, record, earlier_in(args.directory)
    )
    clear_programs(args.directory, "assessment")
    result = workflow.assess(args.directory, args.scans, options, progress_printer(args))
    write_artifacts(args.directory, result.artifacts)
    for name in ("before", "after"):
        row = result.content[name]
        if row:
            say(
                args,
                f"{name:<7} within 2 dB {row['within_2db']:.1%}, mean |dB| {row['mean_abs_db']:.2f}, "
                f"dB range {row['db_range_db']:.2f}, "
                f"ToF std {row['tof_std_mm']:.3f} mm, range {row['tof_range_mm']:.3f} mm, over-spray {row['over_spray']:.1%}",
            )
    if result.content["improvement_pct"] is not None:
        say(args, f"improvement {result.content['improvement_pct']:.1f} %")
    say_issues(args, list(result.issues))
    say(args, f"written to {args.directory}/assessment.json and {args.directory}/assessment")
    return {"ok": True, **result.content, "issues": [i.to_json() for i in result.issues]}, DONE
