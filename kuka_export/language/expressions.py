"""KRL expressions by recursive descent."""

from kuka_export.language.lexer import KrlSyntaxError, Token
from kuka_export.language.nodes import (
    Aggregate,
    CallExpression,
    Chain,
    Designator,
    Enumeration,
    Expression,
    Number,
    Omitted,
    Text,
    Unary,
)  # fmt: skip
from kuka_export.language.vocabulary import KEYWORDS

# Loosest first; the geometric operator `:` binds tightest of the binary ones.
_LEVELS = (
    frozenset({"==", "<>", "<", ">", "<=", ">="}),
    frozenset({"OR", "B_OR"}),
    frozenset({"EXOR", "B_EXOR"}),
    frozenset({"AND", "B_AND"}),
    frozenset({"+", "-"}),
    frozenset({"*", "/"}),
    frozenset({":"}),
)
_UNARY = ("NOT", "B_NOT", "-", "+")
MAX_DEPTH = 60


class Cursor:
    """The tokens of one line and where reading stands."""

    def __init__(self, tokens: list[Token]) -> None:
        self.tokens = tokens
        self.at = 0
        self.depth = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    @property
    def ahead(self) -> Token:
        return self.tokens[min(self.at + 1, len(self.tokens) - 1)]

    def next(self) -> Token:
        token = self.token
        if token.kind != "end":
            self.at += 1
        return token

    def take(self, *values: str) -> bool:
        """Step over the token if it is one of these words or signs."""
        if self.token.kind in ("name", "op") and self.token.value in values:
            self.at += 1
            return True
        return False

    def expect(self, *values: str) -> str:
        token = self.token
        if not self.take(*values):
            raise self.error(f"Expected {' or '.join(values)}")
        return token.value

    def name(self, what: str) -> str:
        """Take a name that is no keyword."""
        token = self.token
        if token.kind != "name":
            raise self.error(f"Expected {what}")
        if token.value in KEYWORDS:
            raise KrlSyntaxError("krl-name-keyword", f"{token.value} is a word of the language, not {what}.")
        self.at += 1
        return token.value

    def end(self) -> None:
        if self.token.kind != "end":
            slip = " (one statement a line)" if self.token.kind == "name" else ""
            raise self.error(f"Nothing more may follow{slip}")

    def error(self, message: str) -> KrlSyntaxError:
        token = self.token
        found = f"'{token.value}' in column {token.column}" if token.kind != "end" else "the end of the line"
        if token.value == ":=":
            return KrlSyntaxError("krl-assignment", "':=' is not KRL; assign with '='.")
        return KrlSyntaxError("krl-syntax", f"{message}, found {found}.")


def expression(c: Cursor, level: int = 0) -> Expression:
    """Return the expression at the cursor."""
    if level == len(_LEVELS):
        return _unary(c)
    first = expression(c, level + 1)
    operands, operators = [first], []
    while c.token.kind in ("op", "name") and c.token.value in _LEVELS[level]:
        operators.append(c.next().value)
        operands.append(expression(c, level + 1))
    return Chain(tuple(operands), tuple(operators)) if operators else first


def _unary(c: Cursor) -> Expression:
    c.depth += 1
    if c.depth > MAX_DEPTH:
        raise KrlSyntaxError("krl-nesting", f"Nested deeper than {MAX_DEPTH} levels.")
    try:
        if c.token.value in _UNARY and c.token.kind in ("op", "name"):
            sign = c.next().value
            return Unary(sign, _unary(c))
        return _primary(c)
    finally:
        c.depth -= 1


def _primary(c: Cursor) -> Expression:  # noqa: PLR0911 (one return a kind)
    t = c.token
    if t.kind == "number":
        c.next()
        return Number(float(t.value), t.value.isdigit())
    if t.kind == "bits":
        c.next()
        return _bits(t.value)
    if t.kind == "text":
        c.next()
        return Text(t.value[1:-1])
    if t.kind == "enum":
        c.next()
        return Enumeration(t.value[1:])
    if c.take("("):
        inner = expression(c)
        c.expect(")")
        return inner
    if t.value == "{":
        return aggregate(c)
    if t.kind == "name":
        if t.value in ("TRUE", "FALSE"):
            c.next()
            return Designator((t.value,), (None,))
        if c.ahead.value == "(":
            name = c.name("a function")
            return CallExpression(name, arguments(c))
        return designator(c)
    raise c.error("Expected a value")


def _bits(value: str) -> Number:
    body = value[1:-1]
    base = {"B": 2, "H": 16, "D": 10}.get(body[0])
    if base is None:
        base, body = 10, "D" + body
    try:
        return Number(float(int(body[1:], base)), True)
    except ValueError as error:
        raise KrlSyntaxError("krl-number", f"{value} is not a number.") from error


def arguments(c: Cursor) -> tuple[Expression, ...]:
    """Return the arguments in parentheses; left-out ones are `Omitted`."""
    c.expect("(")
    found: list[Expression] = []
    if c.take(")"):
        return ()
    while True:
        found.append(Omitted() if c.token.value in (",", ")") else expression(c))
        if c.take(")"):
            return tuple(found)
        c.expect(",")


def designator(c: Cursor, what: str = "a name") -> Designator:
    """Return `NAME[i].FIELD...`; components may be words of the language (`.POS`, `.TO`)."""
    names, indices = [c.name(what)], [_index(c)]
    while c.take("."):
        token = c.token
        if token.kind != "name":
            raise c.error("Expected a component")
        names.append(c.next().value)
        indices.append(_index(c))
    return Designator(tuple(names), tuple(indices))


def _index(c: Cursor) -> tuple[Expression, ...] | None:
    if not c.take("["):
        return None
    found: list[Expression] = []
    while not c.take("]"):
        found.append(Omitted() if c.token.value in (",", "]") else expression(c))
        if c.token.value != "]":
            c.expect(",")
            if c.token.value == "]":
                found.append(Omitted())
    return tuple(found)


def aggregate(c: Cursor) -> Aggregate:
    """Return `{[TYPE:] NAME value, ...}`."""
    c.expect("{")
    tag = ""
    if c.token.kind == "name" and c.ahead.value == ":":
        tag = c.next().value
        c.next()
    parts: list[tuple[str, Expression]] = []
    if c.take("}"):
        return Aggregate(tag, ())
    while True:
        token = c.token
        if token.kind != "name":
            raise c.error("Expected a component name")
        name = c.next().value
        while True:
            index = _index(c)
            if index is not None:
                name += "[]"
            if not c.take("."):
                break
            name += "." + c.next().value
        if c.token.value == "=":
            raise KrlSyntaxError("krl-assignment", f"Inside braces a value follows its name without '=' ({name}).")
        parts.append((name, expression(c, len(_LEVELS) - 3)))
        if c.take("}"):
            return Aggregate(tag, tuple(parts))
        c.expect(",")
