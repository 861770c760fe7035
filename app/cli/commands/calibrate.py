"""`echobase calibrate`."""

import argparse
import json
from typing import Any

from app.cli.run import DONE, FAILED, say, say_issues
from app.folder import write_artifacts
from app.inputs import read_setup
from app.steps.calibrate import run_calibration
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Calibrate from measurements; print what was found, how well, and the patch of setup.json."""
    for path in args.files:
        if not path.is_file():
            raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
    made = run_calibration(args.kind, args.files, read_setup(args.setup), args.target, args.radius_mm)
    found, content = made.found, made.content
    for name, value in content["estimates"].items():
        say(
            args,
            f"{name:<14} "
            + ", ".join(f"{k} {v:.6g}" if isinstance(v, float) else f"{k} {v}" for k, v in value.items()),
        )
    say_issues(args, list(found.issues))
    patch = json.dumps(found.patch, indent=1) + "\n"
    say(args, "patch of setup.json: " + patch.strip())
    if args.output is not None:
        write_artifacts(args.output.parent, {args.output.name: patch.encode()})
    if args.report is not None:
        write_artifacts(args.report.parent, {args.report.name: made.report.html()})
    return content, DONE if found.observable else FAILED
