"""`echobase calibrate`."""

import argparse
import json
from typing import Any

from alignment.calibrate import calibrate
from alignment.calibrate.result import Target
from app.cli.run import DONE, FAILED, say, say_issues
from app.folder import write_artifacts
from app.inputs import read_setup
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Calibrate from measurements; print what was found, how well, and the patch of setup.json."""
    for path in args.files:
        if not path.is_file():
            raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
    target: Target = "sphere" if args.radius_mm is not None else args.target
    if args.kind != "tcp" and target != "plane":
        raise fail("calibration-target", "A sphere calibrates the TCP only.", "Leave --target and --radius-mm out.")
    found = calibrate(args.kind, args.files, read_setup(args.setup), target, args.radius_mm)
    content = found.to_json()
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
    return {"ok": found.observable, **content}, DONE if found.observable else FAILED
