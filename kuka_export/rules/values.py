"""Rules of numbers: speeds, indices, ranges."""

from collections.abc import Iterator

from kuka_export.language.nodes import (
    Assign,
    CallExpression,
    CallStatement,
    Control,
    Declaration,
    Designator,
    Enumeration,
    Expression,
    Move,
    Note,
    Number,
    Pulse,
    Routine,
    SplineOpen,
    Statement,
)
from kuka_export.language.parse import constant
from kuka_export.rules.finding import Finding
from kuka_export.rules.walk import expressions_of, nested

MAX_SPEED_M_S = 3.0
MAX_REAL = 3.4e38
OUTPUTS = 8192
_INDEXED = ("BASE_DATA", "TOOL_DATA", "LOAD_DATA")
# Variable -> lowest and highest value.
_RANGES = {
    "$ADVANCE": (0.0, 5.0),
    "$APO.CDIS": (0.0, 1e4),
    "$APO.CORI": (0.0, 360.0),
    "$APO.CVEL": (0.0, 100.0),
    "$APO.CPTP": (0.0, 100.0),
    "$VEL.ORI1": (1e-6, 1e4),
    "$VEL.ORI2": (1e-6, 1e4),
    "$ACC.CP": (1e-6, 100.0),
    "$ACC.ORI1": (1e-6, 1e5),
    "$ACC.ORI2": (1e-6, 1e5),
    "$OV_PRO": (0.0, 100.0),
    "$VEL_AXIS": (0.0, 100.0),
    "$ACC_AXIS": (0.0, 100.0),
}


def check_values(routine: Routine, bases: int, tools: int) -> Iterator[Finding]:
    """Yield speeds, indices and settings out of range."""
    for s in routine.body:
        if isinstance(s, Note) or (
            isinstance(s, Move) and s.pose is not None and not s.with_ and max(map(abs, s.pose)) < MAX_REAL
        ):
            continue
        for e in expressions_of(s):
            for x in nested(e):
                yield from _value(s.line, x, bases, tools)
        yield from _settings(s, bases, tools)


def _value(line: int, x: Expression, bases: int, tools: int) -> Iterator[Finding]:
    if isinstance(x, Number) and abs(x.value) > MAX_REAL:
        yield Finding(line, "krl-real", "The number is too large for a REAL")
    elif isinstance(x, Designator) and x.index and len(x.index) == 1:
        index = constant(x.index[0])
        if index is None:
            return
        if x.root in _INDEXED:
            yield from _index(line, x.root, index, tools if x.root == "TOOL_DATA" else bases)
        elif x.root in ("$IN", "$OUT") and not 1 <= index <= OUTPUTS:
            yield Finding(line, "krl-index", f"{x.root}[{index:g}] does not exist; 1 to {OUTPUTS} do")
        elif x.root in ("$VEL_AXIS", "$ACC_AXIS") and not 1 <= index <= 12:
            yield Finding(line, "krl-index", f"{x.root}[{index:g}] does not exist; 1 to 12 do")
    elif isinstance(x, CallExpression) and x.name == "SVEL_CP" and x.arguments:
        yield from _speed(line, constant(x.arguments[0]))
    elif isinstance(x, CallExpression) and x.name == "SBASE" and x.arguments:
        yield from _number(line, "base", constant(x.arguments[0]), bases)


def _settings(s: Statement, bases: int, tools: int) -> Iterator[Finding]:
    pairs: list[tuple[Designator, Expression]] = []
    if isinstance(s, Assign):
        pairs = [(s.target, s.value)]
    elif isinstance(s, Move | SplineOpen):
        pairs = [(w.target, w.value) for w in s.with_]
    for target, value in pairs:
        got = constant(value)
        if got is None:
            continue
        if target.dotted == "$VEL.CP":
            yield from _speed(s.line, got)
        elif target.dotted in _RANGES:
            low, high = _RANGES[target.dotted]
            if not low <= got <= high:
                code = "krl-advance" if target.dotted == "$ADVANCE" else "krl-range"
                yield Finding(s.line, code, f"{target.dotted} is {got:g}; it goes from {low:g} to {high:g}")
    yield from _orders(s, bases, tools)


def _orders(s: Statement, bases: int, tools: int) -> Iterator[Finding]:
    if (
        isinstance(s, CallStatement)
        and s.name == "BAS"
        and len(s.arguments) > 1
        and isinstance(s.arguments[0], Enumeration)
    ):
        command, got = s.arguments[0].name, constant(s.arguments[1])
        if command in ("VEL_CP", "CP_PARAMS"):
            yield from _speed(s.line, got)
        elif command in ("BASE", "TOOL"):
            yield from _number(s.line, command.lower(), got, bases if command == "BASE" else tools)
    elif isinstance(s, Control) and s.word == "INTERRUPT DECL":
        got = constant(s.expressions[0])
        if got is not None and not 1 <= got <= 128:
            yield Finding(s.line, "krl-interrupt", f"There is no interrupt {got:g}")
    elif isinstance(s, Pulse):
        got = constant(s.seconds)
        if got is not None and not 0.0 < got <= 3600.0:
            yield Finding(s.line, "krl-range", f"A pulse of {got:g} s is not possible")
    elif isinstance(s, Declaration):
        for d in s.names:
            if d.root in _INDEXED and s.value is not None and d.index:
                index = constant(d.index[0])
                if index is not None:
                    yield from _index(s.line, d.root, index, tools if d.root == "TOOL_DATA" else bases)


def _speed(line: int, m_s: float | None) -> Iterator[Finding]:
    if m_s is not None and not 0.0 < m_s <= MAX_SPEED_M_S:
        yield Finding(line, "krl-speed", f"The path speed is {m_s:g} m/s")


def _index(line: int, name: str, index: float, most: int) -> Iterator[Finding]:
    if not (1 <= index <= most and index == int(index)):
        yield Finding(line, "krl-index", f"{name}[{index:g}] does not exist; 1 to {most} do")


def _number(line: int, what: str, number: float | None, most: int) -> Iterator[Finding]:
    # 0 and -1 select WORLD and the flange.
    if number is not None and not -1 <= number <= most:
        yield Finding(line, "krl-index", f"There is no {what} {number:g}; 1 to {most} exist")
