"""Walks over statements and expressions."""

from collections.abc import Iterator

from kuka_export.language.nodes import (
    Aggregate,
    Assign,
    CallExpression,
    CallStatement,
    Chain,
    Control,
    Declaration,
    Designator,
    Expression,
    Move,
    Pulse,
    SplineOpen,
    Statement,
    Trigger,
    Unary,
    Wait,
)  # fmt: skip


def expressions_of(s: Statement) -> Iterator[Expression]:  # noqa: PLR0912 (one branch a kind)
    """Yield the expressions a statement reads or writes; declared names are not among them."""
    if isinstance(s, Assign):
        yield from (s.target, s.value)
    elif isinstance(s, CallStatement):
        yield from s.arguments
    elif isinstance(s, Pulse):
        yield from (s.output, s.value, s.seconds)
    elif isinstance(s, Move):
        yield from s.targets
        for a in s.with_:
            yield from (a.target, a.value)
    elif isinstance(s, SplineOpen):
        for a in s.with_:
            yield from (a.target, a.value)
    elif isinstance(s, Trigger):
        yield from (s.amount, s.delay)
        if s.priority is not None:
            yield s.priority
        yield from expressions_of(s.action)
        if isinstance(s.action, CallStatement):
            yield CallExpression(s.action.name, ())
    elif isinstance(s, Wait):
        yield s.value
    elif isinstance(s, Control):
        yield from s.expressions
    elif isinstance(s, Declaration) and s.value is not None:
        yield s.value


def nested(e: Expression) -> Iterator[Expression]:
    """Yield an expression and all within it."""
    yield e
    if isinstance(e, Aggregate):
        for _, v in e.components:
            yield from nested(v)
    elif isinstance(e, Unary):
        yield from nested(e.operand)
    elif isinstance(e, Chain):
        for v in e.operands:
            yield from nested(v)
    elif isinstance(e, CallExpression):
        for v in e.arguments:
            yield from nested(v)
    elif isinstance(e, Designator):
        for index in e.indices:
            for v in index or ():
                yield from nested(v)
