"""`echobase robot`: a controller's own backup."""

import argparse
from typing import Any

from app.cli.commands.align import pose_line
from app.cli.run import DONE, say
from app.folder import write_artifacts
from planner.errors import fail
from planner.robot.backup import read_backup
from planner.robot.load import OWN_ROBOTS

MAX_BYTES = 16 * 1024 * 1024


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Read `$machine.dat` and `$config.dat`; write the robot file; print tools, bases and HOME."""
    for path in args.files:
        if not path.is_file():
            raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
        if path.stat().st_size > MAX_BYTES:
            raise fail("file-too-large", "the file is over 16 MiB; no backup's data list is.", "", str(path))
    found = read_backup({str(path): path.read_bytes() for path in args.files})
    content: dict[str, Any] = {
        "ok": True,
        "robot": None if found.robot is None else found.robot.name,
        "robot_root": None if found.robot_root is None else found.robot_root.model_dump(),
        "tools": {n: pose.model_dump() for n, pose in found.tools.items()},
        "bases": {n: pose.model_dump() for n, pose in found.bases.items()},
        "home_deg": None if found.home_deg is None else found.home_deg.tolist(),
        "notes": list(found.notes),
    }
    if found.robot is not None:
        name = found.robot.name
        write_artifacts(args.output, {f"{name}.json": (found.robot.file.model_dump_json(indent=1) + "\n").encode()})
        say(args, f"robot   {found.robot.file.title}: written to {args.output / name}.json")
        say(
            args,
            f'        use it with "robot": "{name}" in setup.json and {OWN_ROBOTS}={args.output} in the environment',
        )
    for kind in ("tools", "bases"):
        for number, pose in content[kind].items():
            say(args, f"{kind[:-1]} {number:<3}{pose_line(pose)}")
    if content["home_deg"] is not None:
        say(args, "HOME    " + "  ".join(f"A{i} {v:z.3f}" for i, v in enumerate(content["home_deg"], 1)))
    for note in found.notes:
        say(args, f"note: {note}")
    return content, DONE
