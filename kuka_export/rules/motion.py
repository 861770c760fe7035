"""Rules of points: components, targets, repeated poses, the first motion, where INI may stand."""

from collections.abc import Iterator

from kuka_export.language.library import Library
from kuka_export.language.nodes import (
    Aggregate,
    Assign,
    CallStatement,
    Chain,
    Control,
    Declaration,
    Designator,
    Enumeration,
    Expression,
    Move,
    Note,
    Routine,
    SourceFile,
    SplineOpen,
    Statement,
    Text,
)  # fmt: skip
from kuka_export.language.parse import constant
from kuka_export.language.vocabulary import AXIS_NAMES, CARTESIAN, COMPONENTS
from kuka_export.rules.finding import Finding

_POSITION = COMPONENTS["E6POS"]
_AXES = COMPONENTS["E6AXIS"]
_NOT_NUMBERS = frozenset({"NAN", "INF", "INFINITY", "NULL", "NONE"})
_FRAMES = frozenset({"$BASE", "$TOOL", "BASE_DATA", "TOOL_DATA", "$WORLD", "$ROBROOT"})
SAME = 5e-4


def check_points(routine: Routine) -> Iterator[Finding]:
    """Yield wrong, double and impossible components of every point and frame written as numbers."""
    for s in routine.body:
        if isinstance(s, Move):
            if s.pose is not None:
                continue  # six plain numbers with the right names
            for t in s.targets:
                for a in aggregates(t):
                    yield from _target(s, a)
        elif isinstance(s, Assign) and len(s.target.names) == 1 and s.target.root in _FRAMES:
            for a in aggregates(s.value):
                yield from _components(s.line, a, COMPONENTS["FRAME"], f"the frame {s.target.root}")
                if not set(CARTESIAN) <= set(a.names()) and s.target.root.endswith(
                    ("BASE", "BASE_DATA", "TOOL", "TOOL_DATA")
                ):
                    yield Finding(
                        s.line,
                        "krl-frame-incomplete",
                        f"{s.target.root} is given without all of X Y Z A B C",
                        "warning",
                    )
        elif isinstance(s, Declaration) and s.type in COMPONENTS and isinstance(s.value, Aggregate):
            yield from _components(s.line, s.value, COMPONENTS[s.type], f"{s.names[0].root} of type {s.type}")


def aggregates(e: Expression) -> Iterator[Aggregate]:
    """Yield the aggregates of a frame expression."""
    if isinstance(e, Aggregate):
        yield e
    elif isinstance(e, Chain):
        for o in e.operands:
            yield from aggregates(o)


def _target(s: Move, a: Aggregate) -> Iterator[Finding]:
    names = set(a.names())
    axes = bool(names & set(AXIS_NAMES[:6]))
    point_to_point = s.word in ("PTP", "SPTP", "PTP_REL", "SPTP_REL")
    if axes and names & set(CARTESIAN):
        yield Finding(s.line, "krl-component", f"{s.word} mixes axis values and a position")
    elif axes and not point_to_point:
        yield Finding(s.line, "krl-target", f"{s.word} cannot go to axis values")
    else:
        yield from _components(s.line, a, _AXES if axes else _POSITION, f"the target of {s.word}")
    if not names:
        yield Finding(s.line, "krl-target", f"{s.word} goes nowhere: the braces are empty")
    for name, most in (("S", 31.0), ("T", 4095.0)):
        value = next((constant(v) for n, v in a.components if n == name), None)
        if value is not None and not (0.0 <= value <= most and value == int(value)):
            yield Finding(s.line, "krl-status", f"{name} is {value:g}")


def _components(line: int, a: Aggregate, allowed: frozenset[str], what: str) -> Iterator[Finding]:
    if a.tag and a.tag in COMPONENTS:
        allowed = COMPONENTS[a.tag]
    seen: set[str] = set()
    for name, value in a.components:
        if name not in allowed:
            yield Finding(line, "krl-component", f"{name} is no component of {what}")
        elif name in seen:
            yield Finding(line, "krl-component-twice", f"{name} is given twice in {what}")
        seen.add(name)
        if isinstance(value, Text | Enumeration | Aggregate) or (
            isinstance(value, Designator) and value.dotted in ("TRUE", "FALSE")
        ):
            yield Finding(line, "krl-type", f"{name} is not a number in {what}")
        if isinstance(value, Designator) and value.dotted in _NOT_NUMBERS:
            yield Finding(line, "krl-not-finite", f"{name} is {value.dotted} in {what}")


def check_repeats(routine: Routine) -> Iterator[Finding]:
    """Yield motions that end where they start."""
    last: Move | None = None
    for s in routine.body:
        if isinstance(s, CallStatement) or (isinstance(s, Control) and s.word not in ("CONTINUE",)):
            last = None
        if isinstance(s, Assign) and s.target.root in ("$BASE", "$TOOL"):
            last = None
        if not isinstance(s, Move):
            continue
        if s.word.endswith("_REL"):
            last = None
            continue
        if last is not None and _ends_alike(last, s):
            exact = isinstance(s.targets[-1], Aggregate) and "PTP" not in s.word
            where = f"{s.word} ends where the motion of line {last.line} ends"
            yield Finding(s.line, "krl-duplicate-pose", where, "error" if exact else "warning")
        last = s


def _ends_alike(a: Move, b: Move) -> bool:
    if a.pose is not None and b.pose is not None:
        return all(abs(x - y) < SAME for x, y in zip(a.pose, b.pose, strict=True))
    return _same(a.targets[-1], b.targets[-1])


def _same(a: Expression, b: Expression) -> bool:
    if isinstance(a, Aggregate) and isinstance(b, Aggregate):
        left, right = ({n: constant(v) for n, v in e.components if n not in ("S", "T")} for e in (a, b))
        if set(left) != set(right):
            return False
        return all(
            x is not None and y is not None and abs(x - y) < SAME for x, y in ((left[k], right[k]) for k in left)
        )
    return isinstance(a, Designator) and a == b and a.root not in ("$POS_ACT", "$AXIS_ACT")


def is_init(s: Statement | Note) -> bool:
    """True for BAS(#INITMOV, 0), the heart of the INI fold."""
    return (
        isinstance(s, CallStatement)
        and s.name == "BAS"
        and bool(s.arguments)
        and isinstance(s.arguments[0], Enumeration)
        and s.arguments[0].name == "INITMOV"
    )


def check_start(library: Library, source: SourceFile, routine: Routine, called: set[str]) -> Iterator[Finding]:
    """Yield what is wrong with how a selected module starts, and INI in a module that others call."""
    init = next((s.line for s in routine.body if is_init(s)), None)
    if init is None:
        return
    if routine.name in called:
        yield Finding(
            init, "krl-sub-ini", f"{routine.name} is called by another module and initialises again", "warning"
        )
    steps = list(_steps(library, source, routine, frozenset()))
    first = next((s for s in steps if isinstance(s, Move | SplineOpen)), None)
    if first is None:
        return
    word = first.word
    if word not in ("PTP", "SPTP"):
        yield Finding(routine.line, "krl-first-motion", f"The first motion is {word}")
    elif isinstance(first, Move):
        target = first.targets[0]
        if isinstance(target, Aggregate) and not (
            set(AXIS_NAMES[:6]) <= set(target.names()) or set(CARTESIAN) <= set(target.names())
        ):
            yield Finding(first.line, "krl-first-motion", "The first motion leaves axes or coordinates out")
    cartesian = next((s for s in steps if isinstance(s, Move) and _is_written_position(s)), None)
    if cartesian is not None and not any(_sets_base(s) for s in steps):
        yield Finding(init, "krl-base-unset", "Positions are driven to, but $BASE is not set after INI", "warning")


def _is_written_position(s: Move) -> bool:
    return any(set(CARTESIAN[:3]) & set(a.names()) for t in s.targets for a in aggregates(t))


def _sets_base(s: Statement) -> bool:
    if isinstance(s, Assign):
        return s.target.root == "$BASE"
    if isinstance(s, Move):
        return any(w.target.root == "$BASE" for w in s.with_)
    if isinstance(s, CallStatement) and s.name == "BAS" and s.arguments and isinstance(s.arguments[0], Enumeration):
        return s.arguments[0].name in ("BASE", "FRAMES", "PTP_PARAMS", "CP_PARAMS", "EX_BASE")
    return False


def _steps(library: Library, source: SourceFile, routine: Routine, above: frozenset[str]) -> Iterator[Statement]:
    for s in routine.body:
        if isinstance(s, Note):
            continue
        yield s
        if isinstance(s, CallStatement) and s.name not in above:
            found = library.find(s.name, source)
            if found is not None:
                yield from _steps(library, *found, above | {s.name})


def check_recursion(library: Library, source: SourceFile, routine: Routine) -> Iterator[Finding]:
    """Yield calls that come back to where they started."""

    def reaches(at: SourceFile, r: Routine, seen: set[str]) -> bool:
        for s in r.body:
            if not isinstance(s, CallStatement):
                continue
            if s.name == routine.name:
                return True
            found = None if s.name in seen else library.find(s.name, at)
            if found is not None:
                seen.add(s.name)
                if reaches(*found, seen):
                    return True
        return False

    if reaches(source, routine, set()):
        yield Finding(routine.line, "krl-recursion", f"{routine.name} calls itself", "warning")
