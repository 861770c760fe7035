"""Whole files: headers, DEF ... END, folds, lines. Findings are collected, not raised: a reader wants them all."""

import re

from kuka_export.language.expressions import Cursor
from kuka_export.language.lexer import KrlSyntaxError, tokens
from kuka_export.language.nodes import Control, Move, Note, Number, Routine, SourceFile, Unary
from kuka_export.language.statements import label, statement
from kuka_export.language.vocabulary import KEYWORDS, TYPES

_ENDS = {"DEF": "END", "DEFFCT": "ENDFCT", "DEFDAT": "ENDDAT"}
_OPENING = re.compile(r"^\s*(?:GLOBAL\s+)?(?:DEF|DEFFCT|DEFDAT)\b", re.IGNORECASE)
_CLOSING = re.compile(r"^\s*(END|ENDFCT|ENDDAT)\s*(?:;.*)?$", re.IGNORECASE)

# Most lines of a long program are one motion to six plain numbers: read those without a token list. The slow way gives
# the same answer; tests hold them together.
_REAL = r"\s*([+-]?\d+(?:\.\d*)?)\s*"
_PLAIN_MOVE = re.compile(
    rf"^\s*(LIN|SLIN|SPL|PTP|SPTP)\s*\{{\s*X\b{_REAL},\s*Y\b{_REAL},\s*Z\b{_REAL},\s*A\b{_REAL},\s*B\b{_REAL},\s*C\b{_REAL}\}}"
    r"\s*(C_DIS|C_SPL|C_VEL|C_ORI)?\s*$",
    re.IGNORECASE,
)


def parse_file(name: str, text: str, fast: bool = True) -> SourceFile:  # noqa: PLR0912 (one branch a kind)
    """Return the parsed file; `problems` holds (line, code, message) of every line that is not KRL."""
    source = SourceFile(name)
    lines = text.split("\n")
    if lines and lines[-1] == "":
        lines.pop()
    source.lines = len(lines)
    routine: Routine | None = None
    for number, raw in enumerate(lines, 1):
        line = raw.rstrip("\r")
        if fast and routine is not None:
            match = _PLAIN_MOVE.match(line)
            if match is not None:
                routine.body.append(_plain_move(match, number))
                continue
        stripped = line.strip()
        if not stripped:
            continue
        if stripped[0] == ";":
            _note(source, routine, number, stripped[1:])
        elif stripped[0] == "&":
            source.headers.append((number, stripped))
            if routine is not None or source.routines:
                source.problems.append((number, "krl-header", "Header lines stand before the first DEF."))
        elif _OPENING.match(line):
            if routine is not None:
                source.problems.append(
                    (number, "krl-end", f"{routine.word} {routine.name} is not closed by {_ENDS[routine.word]}.")
                )
            routine = _open(source, number, line)
        elif (closing := _CLOSING.match(line)) and routine is not None:
            _close(source, routine, number, closing.group(1).upper())
            routine = None
        else:
            _line(source, routine, number, line)
    if routine is not None:
        source.problems.append(
            (routine.line, "krl-end", f"{routine.word} {routine.name} is not closed by {_ENDS[routine.word]}.")
        )
        routine.end_line = source.lines
    if not source.routines:
        source.problems.append((1, "krl-def", "The file has no DEF, DEFFCT or DEFDAT."))
    return source


def _plain_move(match: re.Match[str], number: int) -> Move:
    word, x, y, z, a, b, c, approximation = match.groups()
    pose = (float(x), float(y), float(z), float(a), float(b), float(c))
    return Move(number, word.upper(), (), (approximation.upper(),) if approximation else (), (), pose)


def _note(source: SourceFile, routine: Routine | None, number: int, text: str) -> None:
    if routine is not None:
        routine.body.append(Note(number, text))
    elif source.routines:
        source.routines[-1].body.append(Note(number, text))


def _open(source: SourceFile, number: int, line: str) -> Routine | None:
    routine = Routine(number, "DEF", "")
    try:
        c = Cursor(tokens(line))
        routine.is_global = c.take("GLOBAL")
        routine.word = c.expect("DEF", "DEFFCT", "DEFDAT")
        if routine.word == "DEFFCT":
            kind = c.next()
            if kind.kind != "name" or (kind.value in KEYWORDS and kind.value not in TYPES):
                raise KrlSyntaxError("krl-syntax", "DEFFCT names the type of its result first.")
            if c.take("["):
                while not c.take("]"):
                    c.next()
                    if c.token.kind == "end":
                        raise c.error("Expected ]")
        routine.name = c.name("a routine name")
        if routine.word == "DEFDAT":
            routine.is_public = c.take("PUBLIC")
        else:
            routine.parameters = _parameters(c)
        c.end()
    except KrlSyntaxError as error:
        source.problems.append((number, error.code, error.message))
        routine.name = routine.name or "?"
    source.routines.append(routine)
    return routine


def _parameters(c: Cursor) -> tuple[str, ...]:
    c.expect("(")
    found: list[str] = []
    if c.take(")"):
        return ()
    while True:
        found.append(c.name("a parameter"))
        if c.take("["):
            while not c.take("]"):
                if c.next().kind == "end":
                    raise c.error("Expected ]")
        if c.take(":"):
            direction = c.next().value
            if direction not in ("IN", "OUT"):
                raise KrlSyntaxError("krl-syntax", f"A parameter is :IN or :OUT, not :{direction}.")
        if c.take(")"):
            return tuple(found)
        c.expect(",")


def _close(source: SourceFile, routine: Routine, number: int, word: str) -> None:
    routine.end_line = number
    if word != _ENDS[routine.word]:
        source.problems.append(
            (number, "krl-end", f"{routine.word} {routine.name} is closed by {word}, not {_ENDS[routine.word]}.")
        )


def _line(source: SourceFile, routine: Routine | None, number: int, line: str) -> None:
    try:
        c = Cursor(tokens(line))
        if c.token.kind == "end":
            return
        if routine is None:
            after = "after END" if source.routines else "before DEF"
            raise KrlSyntaxError("krl-outside", f"'{c.token.value}' stands {after}, outside of any routine.")
        name = label(c)
        if name:
            routine.body.append(Control(number, "LABEL", (), (name,)))
            return
        routine.body.append(statement(c, number))
    except KrlSyntaxError as error:
        source.problems.append((number, error.code, error.message))


def constant(expression: object) -> float | None:
    """Return the value of a number with its sign, None if it is anything else."""
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Unary) and expression.operator in "+-":
        value = constant(expression.operand)
        return None if value is None else (-value if expression.operator == "-" else value)
    return None
