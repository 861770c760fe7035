"""One line of KRL to one statement."""

from collections.abc import Callable

from kuka_export.language.expressions import Cursor, arguments, designator, expression
from kuka_export.language.lexer import KrlSyntaxError
from kuka_export.language.nodes import (
    Assign,
    CallStatement,
    Control,
    Declaration,
    Expression,
    External,
    Move,
    Omitted,
    Pulse,
    SplineClose,
    SplineOpen,
    Statement,
    Trigger,
    Wait,
)  # fmt: skip
from kuka_export.language.vocabulary import APPROXIMATION, KEYWORDS, MOTION_CIRCLE, MOTIONS, TYPES


def statement(c: Cursor, line: int) -> Statement:
    """Return the statement of one line; raises KrlSyntaxError."""
    token = c.token
    if token.kind != "name":
        raise c.error("Expected a statement")
    word = token.value
    if word in MOTIONS:
        made: Statement = _move(c, line)
    elif word in _TABLE:
        made = _TABLE[word](c, line)
    elif word in TYPES and c.ahead.kind == "name":
        made = declaration(c, line)
    else:
        made = _assign_or_call(c, line)
    c.end()
    return made


def _move(c: Cursor, line: int) -> Move:
    word = c.next().value
    targets = [expression(c)]
    if word in MOTION_CIRCLE or word.startswith(("CIRC", "SCIRC")):
        c.expect(",")
        targets.append(expression(c))
        if c.take(","):
            _circle_angle(c, targets)
    elif c.take(","):
        _circle_angle(c, targets)
    approximation: list[str] = []
    with_: tuple[Assign, ...] = ()
    while c.token.kind == "name":
        if c.token.value in APPROXIMATION:
            approximation.append(c.next().value)
            c.take(",")
        elif c.take("WITH"):
            with_ = _with(c, line)
        elif c.token.value.startswith("C_"):
            raise KrlSyntaxError(
                "krl-approximation",
                f"{c.token.value} is not an approximation; there are {', '.join(sorted(APPROXIMATION))}.",
            )
        elif c.token.value.startswith("#"):
            c.next()
        else:
            break
    return Move(line, word, tuple(targets), tuple(approximation), with_)


def _circle_angle(c: Cursor, targets: list[Expression]) -> None:
    if c.name("CA") != "CA":
        raise c.error("Expected CA")
    targets.append(expression(c))


def _with(c: Cursor, line: int) -> tuple[Assign, ...]:
    found: list[Assign] = []
    while True:
        target = designator(c, "a system variable")
        c.expect("=")
        found.append(Assign(line, target, expression(c)))
        if not c.take(","):
            return tuple(found)


def _spline(c: Cursor, line: int) -> SplineOpen:
    word = c.next().value
    return SplineOpen(line, word, _with(c, line) if c.take("WITH") else ())


def _spline_end(c: Cursor, line: int) -> SplineClose:
    c.next()
    found: list[str] = []
    while c.token.kind == "name" and c.token.value in APPROXIMATION:
        found.append(c.next().value)
    return SplineClose(line, tuple(found))


def _trigger(c: Cursor, line: int) -> Trigger:
    c.next()
    c.expect("WHEN")
    measure = c.expect("DISTANCE", "PATH")
    c.expect("=")
    amount = expression(c, 4)
    on_start = c.take("ONSTART")
    c.expect("DELAY")
    c.expect("=")
    delay = expression(c, 4)
    c.expect("DO")
    action = _pulse(c, line) if c.token.value == "PULSE" else _assign_or_call(c, line)
    priority = None
    if c.take("PRIO"):
        c.expect("=")
        priority = expression(c, 4)
    if on_start and measure == "DISTANCE":
        raise KrlSyntaxError("krl-trigger", "ONSTART belongs to PATH triggers; DISTANCE=0 is the start.")
    return Trigger(line, measure, amount, on_start, delay, action, priority)


def _pulse(c: Cursor, line: int) -> Pulse:
    c.next()
    given = arguments(c)
    if len(given) != 3:
        raise KrlSyntaxError("krl-syntax", "PULSE takes an output, a state and a time in seconds.")
    return Pulse(line, *given)


def _wait(c: Cursor, line: int) -> Wait:
    c.next()
    if c.token.value not in ("SEC", "FOR"):
        raise KrlSyntaxError("krl-wait", "WAIT is followed by SEC and a time, or by FOR and a condition.")
    return Wait(line, c.next().value, expression(c))


def _assign_or_call(c: Cursor, line: int) -> Assign | CallStatement:
    first = c.token
    if first.kind == "name" and first.value not in KEYWORDS and c.ahead.value == "(":
        name = c.name("a statement")
        return CallStatement(line, name, arguments(c))
    if first.kind == "name" and c.ahead.kind == "name" and first.value not in KEYWORDS:
        raise KrlSyntaxError("krl-syntax", f"'{first.value}' is not a statement of KRL.")
    target = designator(c, "the start of a statement")
    if c.token.value == "==":
        raise KrlSyntaxError("krl-assignment", "'==' compares; assign with '='.")
    if c.token.kind == "end":
        raise KrlSyntaxError("krl-syntax", f"'{target.dotted}' alone is no statement; a call needs parentheses.")
    c.expect("=")
    value = expression(c)
    return Assign(line, target, value)


def declaration(c: Cursor, line: int) -> Declaration | Control:
    """Return a declaration: `[DECL] [GLOBAL] [CONST] TYPE a, b[3] [= value]`, STRUC, ENUM, SIGNAL."""
    is_global = False
    while c.token.value in ("DECL", "GLOBAL", "CONST"):
        is_global |= c.next().value == "GLOBAL"
    if c.token.value in ("STRUC", "ENUM"):
        return _type_definition(c, line)
    if c.token.value == "SIGNAL":
        return _signal(c, line)
    if c.token.value == "INTERRUPT":
        return _interrupt(c, line)
    kind = c.next()
    if kind.kind != "name" or (kind.value in KEYWORDS and kind.value not in TYPES):
        raise KrlSyntaxError("krl-syntax", "A declaration names a type first.")
    names = [designator(c, "a variable")]
    while c.take(","):
        names.append(designator(c, "a variable"))
    value = expression(c) if c.take("=") else None
    return Declaration(line, kind.value, tuple(names), value, is_global)


def _type_definition(c: Cursor, line: int) -> Control:
    word = c.next().value
    names = [c.name("a type name")]
    while c.token.kind in ("name", "op", "number") and c.token.kind != "end":
        names.append(c.next().value)
    return Control(line, word, (), tuple(names))


def _signal(c: Cursor, line: int) -> Declaration:
    c.next()
    name = designator(c, "a signal name")
    value: Expression = designator(c, "$IN or $OUT")
    if c.take("TO"):
        designator(c, "$IN or $OUT")
    return Declaration(line, "SIGNAL", (name,), value, False)


def _interrupt(c: Cursor, line: int) -> Control:
    c.next()
    word = c.expect("DECL", "ON", "OFF", "ENABLE", "DISABLE") if c.token.value in _INTERRUPT else ""
    if not word:
        raise c.error("Expected DECL, ON, OFF, ENABLE or DISABLE")
    if word != "DECL":
        given = () if c.token.kind == "end" else (expression(c),)
        return Control(line, f"INTERRUPT {word}", given)
    number = expression(c, 4)
    c.expect("WHEN")
    when = expression(c)
    c.expect("DO")
    action = _assign_or_call(c, line)
    names = (action.name,) if isinstance(action, CallStatement) else ()
    return Control(line, "INTERRUPT DECL", (number, when), names)


_INTERRUPT = ("DECL", "ON", "OFF", "ENABLE", "DISABLE")


def _external(c: Cursor, line: int) -> External:
    c.next()
    kind = c.token
    if kind.value in TYPES and c.ahead.kind == "name":
        c.next()
    name = c.name("a routine name")
    c.expect("(")
    depth = 1
    while depth and c.token.kind != "end":
        depth += {"(": 1, ")": -1}.get(c.next().value, 0)
    if depth:
        raise c.error("Expected )")
    return External(line, name)


def _if(c: Cursor, line: int) -> Control:
    c.next()
    test = expression(c)
    c.expect("THEN")
    return Control(line, "IF", (test,))


def _for(c: Cursor, line: int) -> Control:
    c.next()
    variable: Expression = designator(c, "a counter")
    c.expect("=")
    parts = [variable, expression(c)]
    c.expect("TO")
    parts.append(expression(c))
    if c.take("STEP"):
        parts.append(expression(c))
    return Control(line, "FOR", tuple(parts))


def _one(word: str) -> Callable[[Cursor, int], Control]:
    def read(c: Cursor, line: int) -> Control:
        c.next()
        return Control(line, word, (expression(c),))

    return read


def _bare(word: str) -> Callable[[Cursor, int], Control]:
    def read(c: Cursor, line: int) -> Control:
        c.next()
        return Control(line, word)

    return read


def _case(c: Cursor, line: int) -> Control:
    c.next()
    values = [expression(c)]
    while c.take(","):
        values.append(expression(c))
    return Control(line, "CASE", tuple(values))


def _return(c: Cursor, line: int) -> Control:
    c.next()
    return Control(line, "RETURN", () if c.token.kind == "end" else (expression(c),))


def _goto(c: Cursor, line: int) -> Control:
    c.next()
    return Control(line, "GOTO", (), (c.name("a label"),))


def _global(c: Cursor, line: int) -> Statement:
    if c.ahead.value == "INTERRUPT":
        c.next()
        return _interrupt(c, line)
    return declaration(c, line)


def _stop_when(c: Cursor, line: int) -> Control:
    c.next()
    c.expect("WHEN")
    c.expect("PATH")
    c.expect("=")
    parts = [expression(c, 4)]
    c.take("ONSTART")
    c.expect("IF")
    parts.append(expression(c))
    return Control(line, "STOP WHEN", tuple(parts))


def _section(c: Cursor, line: int) -> Control:
    word = c.next().value
    mark = c.expect("START", "PART", "END") if c.token.kind == "name" else ""
    parts: tuple[Expression, ...] = ()
    c.take("=")
    if c.token.kind != "end":
        parts = (expression(c),)
        c.take("ONSTART")
    return Control(line, f"{word} {mark}", parts)


def _io(c: Cursor, line: int) -> Control:
    word = c.next().value
    if c.take("ON"):
        target: Expression = designator(c)
        c.expect("=")
        return Control(line, word, (target, expression(c)))
    if c.take("OFF"):
        designator(c)
        return Control(line, word)
    return Control(line, word, tuple(a for a in arguments(c) if not isinstance(a, Omitted)))


def _import(c: Cursor, line: int) -> Declaration:
    c.next()
    kind = c.next().value
    name = designator(c, "a variable")
    c.expect("IS")
    c.expect("/")
    while c.token.kind != "end":
        c.next()
    return Declaration(line, kind, (name,), None, False)


def label(c: Cursor) -> str:
    """Return the name of a jump label `NAME:` at the cursor, '' if there is none."""
    if c.token.kind == "name" and c.token.value not in KEYWORDS and c.ahead.value == ":":
        after = c.tokens[c.at + 2] if c.at + 2 < len(c.tokens) else None
        if after is not None and after.kind == "end":
            return c.token.value
    return ""


def _brake(c: Cursor, line: int) -> Control:
    c.next()
    if c.token.value == "F":
        c.next()
    return Control(line, "BRAKE")


_TABLE: dict[str, Callable[[Cursor, int], Statement]] = {
    "SPLINE": _spline, "PTP_SPLINE": _spline, "ENDSPLINE": _spline_end, "TRIGGER": _trigger, "PULSE": _pulse, "WAIT": _wait,
    "DECL": declaration, "GLOBAL": _global, "CONST": declaration, "STRUC": declaration, "ENUM": declaration,
    "SIGNAL": declaration, "INTERRUPT": _interrupt, "EXT": _external, "EXTFCT": _external, "EXTP": _external,
    "EXTFCTP": _external, "IF": _if, "FOR": _for, "WHILE": _one("WHILE"), "UNTIL": _one("UNTIL"), "SWITCH": _one("SWITCH"),
    "ELSE": _bare("ELSE"), "ENDIF": _bare("ENDIF"), "ENDFOR": _bare("ENDFOR"), "ENDWHILE": _bare("ENDWHILE"),
    "REPEAT": _bare("REPEAT"), "LOOP": _bare("LOOP"), "ENDLOOP": _bare("ENDLOOP"), "ENDSWITCH": _bare("ENDSWITCH"),
    "CASE": _case, "DEFAULT": _bare("DEFAULT"), "EXIT": _bare("EXIT"), "HALT": _bare("HALT"), "CONTINUE": _bare("CONTINUE"),
    "RESUME": _bare("RESUME"), "BRAKE": _brake, "RETURN": _return, "GOTO": _goto, "STOP": _stop_when,
    "TIME_BLOCK": _section, "CONST_VEL": _section, "ANIN": _io, "ANOUT": _io, "DIGIN": _io, "CWRITE": _io, "CREAD": _io,
    "COPEN": _io, "CCLOSE": _io, "SREAD": _io, "SWRITE": _io, "CONFIRM": _one("CONFIRM"), "IMPORT": _import,
}  # fmt: skip
