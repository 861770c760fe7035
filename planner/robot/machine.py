"""From the values of `$machine.dat` to a `Robot`."""

import re

from pydantic import ValidationError

from planner.errors import EchoBaseError, fail
from planner.issues import Issue
from planner.robot.dat import Value
from planner.robot.model import Robot, RobotFile

Values = dict[tuple[str, int], Value]
AXES = range(1, 7)


def machine_robot(values: Values, where: str) -> tuple[Robot, list[str]]:
    """Return the robot and what had to be assumed.

    a1 = $LENGTH_A, c2 = $LENGTH_B, c3 = $TX3P3.X, a2 = -$TX3P3.Z, c1 = $TIRORO.Z, c4 = $TFLWP.Z; limits $SOFTN_END,
    $SOFTP_END; axis speed = 6 $VEL_AXIS_MA / |$RAT_MOT_AX| (motor speed in 1/min over the gear ratio), in deg/s. The
    rules were proven on the taught points of two real backups.
    """
    _check_kind(values, where)
    numbers = {
        "a1_mm": _number(values, "$LENGTH_A"),
        "c2_mm": _number(values, "$LENGTH_B"),
        "c3_mm": _field(values, "$TX3P3", "X"),
        "a2_mm": _field(values, "$TX3P3", "Z"),
        "c1_mm": _field(values, "$TIRORO", "Z"),
        "c4_mm": _field(values, "$TFLWP", "Z"),
    }
    low = [_number(values, "$SOFTN_END", i) for i in AXES]
    high = [_number(values, "$SOFTP_END", i) for i in AXES]
    _check_complete(numbers, low, high, where)
    lengths = {name: float(value or 0.0) for name, value in numbers.items()}
    lengths["a2_mm"] = -lengths["a2_mm"] + 0.0
    speeds = [_speed(values, i) for i in AXES]
    notes = [
        "Axis directions and zero as on every KUKA six-axis arm: A1, A4, A6 reversed, A2 = -90 deg upright.",
        "The wrist envelope (radius = distance from wrist centre to flange) is an assumption for the collision check.",
    ]
    missing = [f"A{i}" for i, speed in zip(AXES, speeds, strict=True) if speed is None]
    if missing:
        notes.append(f"Top speeds of {', '.join(missing)} are not in the file, so they are not checked.")
    title = next(
        (v for k in ("$TRAFONAME", "$ROBTRAFO", "$MODEL_NAME") if isinstance(v := values.get((k, 0)), str)), ""
    )
    file = {
        "name": re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60] or "robot-from-backup",
        "title": title.strip("# ") or "Robot from backup",
        "opw": {**lengths, "b_mm": 0.0},
        "axes": [{"min_deg": a, "max_deg": b, "speed_deg_s": s} for a, b, s in zip(low, high, speeds, strict=True)],
        "wrist_radius_mm": max(lengths["c4_mm"], 50.0),
        "sources": dict.fromkeys(("geometry", "limits", "speeds"), "the robot's own $machine.dat")
        | {"wrist": "Assumption of EchoBase: distance from wrist centre to flange"},
        "notes": notes,
    }
    try:
        return Robot(RobotFile.model_validate(file)), notes
    except ValidationError as error:
        raise EchoBaseError(
            *(
                Issue(
                    "error",
                    "backup-machine",
                    f"A value cannot be: {e['msg']}.",
                    "Check $machine.dat.",
                    f"{where}: {'.'.join(map(str, e['loc']))}",
                )
                for e in error.errors()
            )
        ) from error


def _check_kind(values: Values, where: str) -> None:
    """Refuse arms that the closed form does not describe."""
    expected = {"$MAIN_AXIS": ("NR", "an articulated arm"), "$WRIST_AXIS": ("ZEH", "a spherical wrist")}
    for name, (code, kind) in expected.items():
        value = values.get((name, 0))
        if isinstance(value, str) and value != code:
            raise fail(
                "backup-kinematics",
                f"{name} is #{value}: this robot is not {kind}.",
                "Six-axis arms with a spherical wrist are supported; state another robot.",
                where,
            )
    axes = values.get(("$NUM_AX", 0))
    if isinstance(axes, float) and axes < len(AXES):
        raise fail("backup-kinematics", f"The robot has {axes:.0f} axes.", "Six-axis arms are supported.", where)
    if values.get(("$A4PAR", 0)) not in (None, 0.0):
        raise fail(
            "backup-kinematics",
            "The robot keeps its flange level ($A4PAR), as palletisers do.",
            "Six-axis arms with a spherical wrist are supported.",
            where,
        )
    sideways = {"$TIRORO": "XY", "$TFLWP": "XY", "$TX3P3": "Y"}
    for name, parts in sideways.items():
        value = values.get((name, 0))
        if isinstance(value, dict) and any(abs(value.get(part, 0.0)) > 1e-6 for part in parts):
            raise fail(
                "backup-kinematics",
                f"{name} has a sideways offset, which the six-axis arms supported here do not have.",
                "Six-axis arms whose axes lie in one plane are supported; state another robot.",
                where,
            )


def _check_complete(numbers: dict[str, float | None], low: list, high: list, where: str) -> None:
    source = {
        "a1_mm": "$LENGTH_A",
        "c2_mm": "$LENGTH_B",
        "c3_mm": "$TX3P3.X",
        "a2_mm": "$TX3P3.Z",
        "c1_mm": "$TIRORO.Z",
        "c4_mm": "$TFLWP.Z",
    }
    missing = [source[name] for name, value in numbers.items() if value is None]
    missing += [f"$SOFTN_END[{i}]" for i, v in zip(AXES, low, strict=True) if v is None]
    missing += [f"$SOFTP_END[{i}]" for i, v in zip(AXES, high, strict=True) if v is None]
    if missing:
        raise fail(
            "backup-machine",
            f"$machine.dat does not state {', '.join(missing)}.",
            "Take the file from KRC/R1/MADA of the backup; the one from STEU does not describe the arm.",
            where,
        )


def _number(values: Values, name: str, index: int = 0) -> float | None:
    value = values.get((name, index))
    return value if isinstance(value, float) else None


def _field(values: Values, name: str, part: str) -> float | None:
    value = values.get((name, 0))
    return value.get(part) if isinstance(value, dict) else None


def _speed(values: Values, index: int) -> float | None:
    rpm = _number(values, "$VEL_AXIS_MA", index)
    ratio = values.get(("$RAT_MOT_AX", index))
    if rpm is None or not isinstance(ratio, dict) or not ratio.get("N") or not ratio.get("D"):
        return None
    return round(abs(6.0 * rpm * ratio["D"] / ratio["N"]), 3) or None
