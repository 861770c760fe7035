"""`echobase calibrate`."""

import argparse
import math
from typing import Any

from app.cli.run import DONE, FAILED, say, say_issues
from app.folder import write_artifacts
from app.inputs import read_setup
from app.steps.calibrate import patch_text, run_calibration
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Calibrate from measurements; print what was found, how well, and the patch of setup.json."""
    for path in args.files:
        if not path.is_file():
            raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
    made = run_calibration(args.kind, args.files, read_setup(args.setup), args.target, args.radius_mm)
    found, content = made.found, made.content
    for name, value in content["estimates"].items():
        say(args, f"{name:<14} {estimate_text(value)}")
    say_issues(args, list(found.issues))
    patch = patch_text(found.patch)
    say(args, "patch of setup.json: " + patch.strip())
    if args.output is not None:
        write_artifacts(args.output.parent, {args.output.name: patch.encode()})
    if args.report is not None:
        write_artifacts(args.report.parent, {args.report.name: made.report.html()})
    return content, DONE if found.observable else FAILED


def estimate_text(value: dict[str, Any]) -> str:
    """Return an estimate as `1.36 +- 0.0099 dB/deg^2 (95 %), measured`, to the decimals that its half width deserves."""
    if value["status"] == "held":
        return "held: stays as it was"
    half, unit = value["half_95"], value["unit"]
    decimals = 6 if not half else max(0, min(6, 1 - math.floor(math.log10(half))))
    return f"{value['value']:z.{decimals}f} +- {half:.2g} {unit} (95 %), {value['status']}"
