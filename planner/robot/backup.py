"""A robot's own backup: geometry, limits and speeds from `$machine.dat`; tools, bases and HOME from `$config.dat`."""

from dataclasses import dataclass, field

import numpy as np
from pydantic import ValidationError

from planner.errors import fail
from planner.frames import Array
from planner.robot.dat import Value, read_values
from planner.robot.machine import machine_robot
from planner.robot.model import Robot
from planner.setup import Pose

Values = dict[tuple[str, int], Value]
FILES = ("$machine.dat", "$config.dat")


@dataclass(frozen=True, eq=False)
class Backup:
    """What a backup says about a cell.

    robot: None without `$machine.dat`. robot_root: `T_world_robroot` ($ROBROOT), None if not stated. tools, bases:
    `T_flange_tcp` and `T_world_base` by number, as far as they are not all zero. tool_names, base_names: by number.
    home_deg (6,): XHOME, or None. notes: what was assumed or left out, for a person.
    """

    robot: Robot | None
    robot_root: Pose | None
    tools: dict[int, Pose]
    bases: dict[int, Pose]
    home_deg: Array | None
    tool_names: dict[int, str] = field(default_factory=dict)
    base_names: dict[int, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_backup(files: dict[str, bytes]) -> Backup:
    """Return what the `$machine.dat` and `$config.dat` among the files (path -> bytes) say.

    Of several files of one name (R1 and STEU of one backup) all are read. Raises EchoBaseError `backup-empty` (none of
    them is there), `backup-machine` (values missing or out of bounds), `backup-kinematics` (not a six-axis arm with a
    spherical wrist), `backup-frame` (a frame that cannot be).
    """
    found: dict[str, list[str]] = {name: [] for name in FILES}
    for path in sorted(files):
        base = path.replace("\\", "/").rsplit("/", 1)[-1].lower()
        if base in found:
            found[base].append(path)
    if not any(found.values()):
        raise fail(
            "backup-empty",
            "There is no $machine.dat and no $config.dat among the files.",
            "Upload them from the backup: KRC/R1/MADA/$machine.dat and KRC/R1/SYSTEM/$config.dat.",
        )
    machine, config = (_merged(files, found[name]) for name in FILES)
    notes: list[str] = []
    robot = None
    if found["$machine.dat"]:
        robot, said = machine_robot(machine, found["$machine.dat"][0])
        notes += said
    else:
        notes.append("No $machine.dat: robot geometry and limits are not known from this backup.")
    if not found["$config.dat"]:
        notes.append("No $config.dat: tools, bases and HOME are not known from this backup.")
    root = machine.get(("$ROBROOT", 0))
    return Backup(
        robot,
        _pose(root, "$ROBROOT", "$machine.dat") if isinstance(root, dict) else None,
        _frames(config, "TOOL_DATA"),
        _frames(config, "BASE_DATA"),
        _home(config, notes),
        _names(config, "TOOL_NAME"),
        _names(config, "BASE_NAME"),
        tuple(notes),
    )


def _merged(files: dict[str, bytes], names: list[str]) -> Values:
    values: Values = {}
    for name in names:
        values.update(read_values(name, files[name]))
    return values


def _frames(values: Values, array: str) -> dict[int, Pose]:
    frames = {
        index: _pose(value, f"{array}[{index}]", "$config.dat")
        for (name, index), value in sorted(values.items(), key=lambda item: item[0])
        if name == array and index > 0 and isinstance(value, dict)
    }
    return {index: pose for index, pose in frames.items() if any(v != 0.0 for v in pose.xyzabc())}


def _pose(value: Value, what: str, where: str) -> Pose:
    fields = value if isinstance(value, dict) else {}
    missing = [name for name in "XYZABC" if name not in fields]
    if missing:
        raise fail("backup-frame", f"{what} has no {', '.join(missing)}.", "Check the file.", where)
    x, y, z, a, b, c = (fields[name] for name in "XYZABC")
    try:
        return Pose(x_mm=x, y_mm=y, z_mm=z, a_deg=a, b_deg=b, c_deg=c)
    except ValidationError as error:
        message = error.errors()[0]
        raise fail(
            "backup-frame", f"{what} cannot be: {message['loc'][0]} {message['msg']}.", "Check the file.", where
        ) from error


def _home(values: Values, notes: list[str]) -> Array | None:
    home = values.get(("XHOME", 0))
    if not isinstance(home, dict) or any(f"A{i}" not in home for i in range(1, 7)):
        notes.append("XHOME is not in $config.dat.")
        return None
    return np.array([home[f"A{i}"] for i in range(1, 7)])


def _names(values: Values, array: str) -> dict[int, str]:
    return {
        index: value for (name, index), value in values.items() if name == array and isinstance(value, str) and value
    }
