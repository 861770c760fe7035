"""What KRL text becomes: expressions, statements, modules. Every statement knows its line."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Number:
    value: float
    integer: bool = False


@dataclass(frozen=True)
class Text:
    value: str


@dataclass(frozen=True)
class Enumeration:
    name: str


@dataclass(frozen=True)
class Omitted:
    """An argument left out, as in `F(1, ,2)`."""


@dataclass(frozen=True)
class Designator:
    """`$VEL.CP`, `BASE_DATA[1]`, `XP1.X`: names with indices, upper case. `indices[i]` belongs to `names[i]`."""

    names: tuple[str, ...]
    indices: tuple[tuple["Expression", ...] | None, ...]

    @property
    def root(self) -> str:
        return self.names[0]

    @property
    def dotted(self) -> str:
        return ".".join(self.names)

    @property
    def index(self) -> tuple["Expression", ...] | None:
        return self.indices[0]


@dataclass(frozen=True)
class CallExpression:
    name: str
    arguments: tuple["Expression", ...]


@dataclass(frozen=True)
class Aggregate:
    """`{X 1,Y 2}` or `{FRAME: X 1,Y 2}`; components in order, names upper case."""

    tag: str
    components: tuple[tuple[str, "Expression"], ...]

    def names(self) -> tuple[str, ...]:
        return tuple(n for n, _ in self.components)


@dataclass(frozen=True)
class Unary:
    operator: str
    operand: "Expression"


@dataclass(frozen=True)
class Chain:
    """Operands joined by binary operators of one precedence level: `a + b - c`, `p : q`."""

    operands: tuple["Expression", ...]
    operators: tuple[str, ...]


Expression = Number | Text | Enumeration | Omitted | Designator | CallExpression | Aggregate | Unary | Chain


@dataclass(frozen=True)
class Assign:
    line: int
    target: Designator
    value: Expression


@dataclass(frozen=True)
class CallStatement:
    line: int
    name: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Pulse:
    line: int
    output: Expression
    value: Expression
    seconds: Expression


@dataclass(slots=True, eq=False)
class Move:
    """A motion; `with_` are the assignments behind WITH.

    `pose` is set for a target of six plain numbers X Y Z A B C in this order, which is what long programs are made of;
    `targets` says the same as expressions.
    """

    line: int
    word: str
    given: tuple[Expression, ...]
    approximation: tuple[str, ...] = ()
    with_: tuple[Assign, ...] = ()
    pose: tuple[float, ...] | None = None

    @property
    def targets(self) -> tuple[Expression, ...]:
        if self.pose is None:
            return self.given
        return (Aggregate("", tuple(zip("XYZABC", map(Number, self.pose), strict=True))),)


@dataclass(frozen=True)
class SplineOpen:
    line: int
    word: str
    with_: tuple[Assign, ...]


@dataclass(frozen=True)
class SplineClose:
    line: int
    approximation: tuple[str, ...] = ()


@dataclass(frozen=True)
class Trigger:
    """`measure` DISTANCE or PATH, `amount` its value, `action` what it does."""

    line: int
    measure: str
    amount: Expression
    on_start: bool
    delay: Expression
    action: "Assign | CallStatement | Pulse"
    priority: Expression | None


@dataclass(frozen=True)
class Wait:
    line: int
    what: str
    value: Expression


@dataclass(frozen=True)
class Declaration:
    """`DECL [GLOBAL] [CONST] TYPE a, b[3]` with an initial value in data lists and, rarely, in code."""

    line: int
    type: str
    names: tuple[Designator, ...]
    value: Expression | None
    is_global: bool


@dataclass(frozen=True)
class External:
    line: int
    name: str


@dataclass(frozen=True)
class Control:
    """Anything that steers: IF, LOOP, FOR, GOTO, INTERRUPT...; `expressions` are kept for name checks."""

    line: int
    word: str
    expressions: tuple[Expression, ...] = ()
    names: tuple[str, ...] = ()


Statement = (
    Assign | CallStatement | Pulse | Move | SplineOpen | SplineClose | Trigger | Wait | Declaration | External | Control
)


@dataclass(frozen=True)
class Note:
    """A comment line, FOLD lines included; text without the semicolon."""

    line: int
    text: str


@dataclass
class Routine:
    """One DEF, DEFFCT or DEFDAT."""

    line: int
    word: str
    name: str
    parameters: tuple[str, ...] = ()
    is_global: bool = False
    is_public: bool = False
    body: list[Statement | Note] = field(default_factory=list)
    end_line: int = 0


@dataclass
class SourceFile:
    """A parsed file: headers, routines, findings (line, code, message)."""

    name: str
    headers: list[tuple[int, str]] = field(default_factory=list)
    routines: list[Routine] = field(default_factory=list)
    problems: list[tuple[int, str, str]] = field(default_factory=list)
    lines: int = 0
