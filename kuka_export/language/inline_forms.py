"""What inline forms set: BAS(...) of the classic ones, WITH clauses of the spline ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kuka_export.language.followed import BaseState
from kuka_export.language.nodes import Assign, CallExpression, CallStatement, Enumeration, Expression
from kuka_export.language.parse import constant
from kuka_export.language.values import UnknownValueError, evaluate, number

if TYPE_CHECKING:
    from kuka_export.language.follow import Follower

# $config.dat ships DEF_VEL_CP = 2 m/s; BAS(#INITMOV,0) sets it.
INITIAL_SPEED_MM_S = 2000.0


def basis_call(f: Follower, s: CallStatement) -> None:
    """Follow BAS(#COMMAND, value): INITMOV, BASE, TOOL, FRAMES, VEL_CP and CP_PARAMS change what is followed."""
    command = s.arguments[0].name if s.arguments and isinstance(s.arguments[0], Enumeration) else ""
    value = s.arguments[1] if len(s.arguments) > 1 else None
    given = constant(value)
    f.out.basis.append(command if given is None else f"{command},{given:g}")
    if command == "INITMOV":
        f.base, f.tool, f.speed_mm_s = BaseState(0), 1, INITIAL_SPEED_MM_S
    elif command == "BASE" and value is not None:
        f.base = BaseState(max(0, int(number(evaluate(value, f.known)))))
    elif command == "TOOL" and value is not None:
        f.tool = int(number(evaluate(value, f.known)))
    elif command in ("VEL_CP", "CP_PARAMS") and value is not None:
        f.speed_mm_s = 1000.0 * number(evaluate(value, f.known))
    elif command == "FRAMES":
        _frames(f, f.known.get("FDAT_ACT"))


def _frames(f: Follower, data: object) -> None:
    if not isinstance(data, dict):
        raise UnknownValueError("FDAT_ACT")
    if "BASE_NO" in data:
        f.base = BaseState(int(number(data["BASE_NO"])))
    if "TOOL_NO" in data:
        f.tool = int(number(data["TOOL_NO"]))


def with_clause(f: Follower, clause: tuple[Assign, ...]) -> float | None:
    """Follow the assignments behind WITH; return the speed they set (mm/s), or None."""
    speed: float | None = None
    for item in clause:
        name, value = item.target.dotted, item.value
        if name == "$VEL.CP":
            speed = 1000.0 * number(evaluate(value, f.known))
        elif name == "$VEL" and isinstance(value, CallExpression) and value.name == "SVEL_CP":
            speed = 1000.0 * number(evaluate(value.arguments[0], f.known))
        elif name == "$BASE" and isinstance(value, CallExpression) and value.name == "SBASE":
            f.base = BaseState(int(number(evaluate(value.arguments[0], f.known))))
        elif name == "$TOOL" and isinstance(value, CallExpression) and value.name in ("STOOL", "STOOL2"):
            f.tool = _tool(f, value.arguments[0])
    return speed


def _tool(f: Follower, argument: Expression) -> int:
    value = evaluate(argument, f.known)
    return int(number(value["TOOL_NO"] if isinstance(value, dict) else value))
