"""Values of expressions while a program is followed: numbers, texts, aggregates as dicts of upper-case names."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from kuka_export.language.lexer import KrlSyntaxError
from kuka_export.language.nodes import (
    Aggregate,
    Chain,
    Designator,
    Enumeration,
    Expression,
    Number,
    Text,
    Unary,
)  # fmt: skip
from kuka_export.language.vocabulary import CARTESIAN, COMPONENTS
from planner.frames import Transform

Value = Any
NULL_FRAME = dict.fromkeys(CARTESIAN, 0.0)


class UnknownValueError(Exception):
    """A name whose value the given files do not say."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name


def evaluate(e: Expression, known: Mapping[str, Value]) -> Value:  # noqa: PLR0911 (one return a kind)
    """Return the value of an expression; raises UnknownValueError for a name without one, KrlSyntaxError for nonsense."""
    if isinstance(e, Number):
        return e.value
    if isinstance(e, Text):
        return e.value
    if isinstance(e, Enumeration):
        return "#" + e.name
    if isinstance(e, Aggregate):
        parts = {name: evaluate(v, known) for name, v in e.components}
        if len(parts) < len(e.components):
            raise KrlSyntaxError("krl-component-twice", "A component is given twice.")
        return parts
    if isinstance(e, Designator):
        return _named(e, known)
    if isinstance(e, Unary):
        return _unary(e.operator, evaluate(e.operand, known))
    if isinstance(e, Chain):
        total = evaluate(e.operands[0], known)
        for operator, operand in zip(e.operators, e.operands[1:], strict=True):
            total = _binary(operator, total, evaluate(operand, known))
        return total
    raise UnknownValueError(getattr(e, "name", "a left-out argument"))


def key_of(d: Designator, known: Mapping[str, Value]) -> str:
    """Return the name of the variable behind a designator, indices evaluated: `BASE_DATA[3]`; components are not in it."""
    index = d.index
    if not index:
        return d.root
    return f"{d.root}[{','.join(str(int(number(evaluate(i, known)))) for i in index)}]"


def number(value: Value) -> float:
    """Return a number; raises KrlSyntaxError if the value is something else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise KrlSyntaxError("krl-type", "A number is needed here.")
    return float(value)


def frame_of(value: Value) -> tuple[float, ...]:
    """Return X Y Z A B C of an aggregate; what is missing is 0. Raises KrlSyntaxError if it is no frame."""
    if not isinstance(value, dict) or not set(value) & set(CARTESIAN):
        raise KrlSyntaxError("krl-type", "A frame {X, Y, Z, A, B, C} is needed here.")
    only_components(value, "E6POS")
    return tuple(number(value.get(k, 0.0)) for k in CARTESIAN)


def only_components(value: dict[str, Value], kind: str) -> None:
    """Raise KrlSyntaxError if an aggregate has a component that a `kind` (E6POS, E6AXIS) does not know."""
    strange = set(value) - COMPONENTS[kind]
    if strange:
        raise KrlSyntaxError("krl-component", f"{min(strange)} is no component of a {kind}.")


def compose(first: tuple[float, ...], second: tuple[float, ...]) -> tuple[float, ...]:
    """Return `first : second`: the second frame, given in the first, as X Y Z A B C."""
    a = Transform.from_xyzabc("world", "base", np.array(first))
    b = Transform.from_xyzabc("base", "basecorr", np.array(second))
    return tuple(float(v) for v in (a @ b).xyzabc)


def _named(d: Designator, known: Mapping[str, Value]) -> Value:
    if d.dotted in ("TRUE", "FALSE"):
        return d.dotted == "TRUE"
    if d.dotted == "$NULLFRAME":
        return dict(NULL_FRAME)
    if d.dotted in known:
        return known[d.dotted]
    key = key_of(d, known)
    if key not in known:
        raise UnknownValueError(key)
    value = known[key]
    for name in d.names[1:]:
        if not isinstance(value, dict) or name not in value:
            raise UnknownValueError(d.dotted)
        value = value[name]
    return value


def _unary(operator: str, value: Value) -> Value:
    if operator == "NOT":
        return not value
    if operator == "B_NOT":
        return float(~int(number(value)))
    return -number(value) if operator == "-" else number(value)


def _binary(operator: str, a: Value, b: Value) -> Value:
    if operator == ":":
        return dict(zip(CARTESIAN, compose(frame_of(a), frame_of(b)), strict=True))
    if operator in ("==", "<>"):
        return (a == b) == (operator == "==")
    if operator in ("AND", "OR", "EXOR"):
        return {"AND": a and b, "OR": a or b, "EXOR": bool(a) != bool(b)}[operator]
    x, y = number(a), number(b)
    if operator == "/":
        if y == 0.0:
            raise KrlSyntaxError("krl-number", "Division by zero.")
        return x / y
    table = {"+": x + y, "-": x - y, "*": x * y, "<": x < y, ">": x > y, "<=": x <= y, ">=": x >= y}
    if operator not in table:
        raise KrlSyntaxError("krl-type", f"{operator} is not followed here.")
    return table[operator]
