"""Robots as data files: the shipped ones in `models/`, and a folder of the user's own."""

import os
from functools import cache
from pathlib import Path

from pydantic import ValidationError

from planner.errors import EchoBaseError, fail
from planner.issues import Issue
from planner.robot.model import Robot, RobotFile

MODELS = Path(__file__).parent / "models"
OWN_ROBOTS = "ECHOBASE_ROBOTS"


def own_folder() -> Path | None:
    """Return the folder of the user's own robot files, as the environment names it."""
    named = os.environ.get(OWN_ROBOTS)
    return Path(named) if named else None


def robot_names(folder: Path | None = None) -> tuple[str, ...]:
    """Return the names that `load_robot` knows, sorted; `folder` (default: ECHOBASE_ROBOTS) adds the user's own files."""
    folder = own_folder() if folder is None else folder
    folders = (MODELS,) if folder is None else (folder, MODELS)
    return tuple(sorted({path.stem for place in folders if place.is_dir() for path in place.glob("*.json")}))


def load_robot(name: str, folder: Path | None = None) -> Robot:
    """Return the robot of this name; a file in `folder` (default: ECHOBASE_ROBOTS) hides a shipped one.

    Raises EchoBaseError `robot-unknown` (listing the names) or `robot-file` (a field that is missing or wrong).
    """
    folder = own_folder() if folder is None else folder
    names = robot_names(folder)
    if name not in names:
        raise fail(
            "robot-unknown",
            f"There is no robot named '{name}'.",
            f"Choose one of {', '.join(names)}, or import the robot's own backup: `echobase robot '$machine.dat'`.",
            "setup.json: robot",
        )
    own = None if folder is None else folder / f"{name}.json"
    return parse_robot(own.read_text("utf-8"), own.name) if own is not None and own.is_file() else _shipped(name)


@cache
def _shipped(name: str) -> Robot:
    path = MODELS / f"{name}.json"
    return parse_robot(path.read_text("utf-8"), path.name)


def parse_robot(text: str, where: str) -> Robot:
    """Return the robot of a data file's text; raise EchoBaseError `robot-file` naming each wrong field."""
    try:
        return Robot(RobotFile.model_validate_json(text))
    except ValidationError as error:
        issues = [
            Issue(
                "error",
                "robot-file",
                f"The robot file is not usable: {e['msg']}.",
                "Correct this field.",
                f"{where}: {'.'.join(str(part) for part in e['loc']) or 'whole file'}",
            )
            for e in error.errors()
        ]
        raise EchoBaseError(*issues) from error
