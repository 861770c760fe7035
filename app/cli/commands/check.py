"""`echobase check`."""

import argparse
from typing import Any

from app.cli.run import DONE, FAILED, say
from kuka_export.check import check_files
from planner.errors import fail
from planner.issues import errors_in

MAX_BYTES = 64 * 1024 * 1024


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Read KRL back and print what is wrong; fail on errors only."""
    files: dict[str, bytes] = {}
    for path in args.files:
        if not path.is_file():
            raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
        if path.stat().st_size > MAX_BYTES:
            raise fail("file-too-large", "the file is over 64 MiB; no controller loads that.", "", str(path))
        if path.name in files:
            raise fail("file-doubled", f"'{path.name}' is given twice.", "Give each module once.", str(path))
        files[path.name] = path.read_bytes()
    issues = check_files(files)
    failed = bool(errors_in(issues))
    for issue in issues:
        say(args, f"{issue.severity} [{issue.code}] {issue.sentence()}")
    say(
        args,
        f"{len(files)} files: {len(errors_in(issues))} errors, {sum(i.severity == 'warning' for i in issues)} warnings",
    )
    return {
        "ok": not failed,
        "files": sorted(files),
        "issues": [i.to_json() for i in issues],
    }, FAILED if failed else DONE
