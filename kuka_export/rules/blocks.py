"""Rules of structure: control blocks, labels, spline blocks, triggers, families."""

from collections.abc import Iterator

from kuka_export.language.nodes import (
    CallStatement,
    Control,
    Move,
    Note,
    Routine,
    SplineClose,
    SplineOpen,
    Statement,
    Trigger,
)  # fmt: skip
from kuka_export.language.parse import constant
from kuka_export.language.vocabulary import CLASSIC_FAMILY, SPLINE_FAMILY
from kuka_export.rules.finding import Finding

_OPEN = {
    "IF": "ENDIF",
    "FOR": "ENDFOR",
    "WHILE": "ENDWHILE",
    "REPEAT": "UNTIL",
    "LOOP": "ENDLOOP",
    "SWITCH": "ENDSWITCH",
}
_CLOSE = {v: k for k, v in _OPEN.items()}
_INSIDE = {"ELSE": ("IF",), "CASE": ("SWITCH",), "DEFAULT": ("SWITCH",), "EXIT": ("FOR", "WHILE", "REPEAT", "LOOP")}
_IN_SPLINE = frozenset({"SPL", "SLIN", "SCIRC", "SPL_REL", "SLIN_REL", "SCIRC_REL"})
_IN_PTP_SPLINE = frozenset({"SPTP", "SPTP_REL"})
_SECTIONS = ("CONST_VEL", "TIME_BLOCK", "STOP WHEN")


def check_control(routine: Routine) -> Iterator[Finding]:  # noqa: PLR0912 (one branch a kind)
    """Yield control blocks that do not close in order, words outside their block, jumps without a label."""
    stack: list[tuple[str, int]] = []
    labels: dict[str, int] = {}
    jumps: list[tuple[str, int]] = []
    for s in routine.body:
        if not isinstance(s, Control):
            continue
        if s.word in _OPEN:
            stack.append((s.word, s.line))
        elif s.word in _CLOSE:
            if stack and stack[-1][0] == _CLOSE[s.word]:
                stack.pop()
            else:
                inner = (
                    f"{stack[-1][0]} in line {stack[-1][1]} is still open" if stack else f"no {_CLOSE[s.word]} is open"
                )
                yield Finding(s.line, "krl-nesting", f"{s.word} closes nothing: {inner}")
        elif s.word in _INSIDE and not any(word in _INSIDE[s.word] for word, _ in stack):
            yield Finding(s.line, "krl-nesting", f"{s.word} stands outside of {' or '.join(_INSIDE[s.word])}")
        elif s.word == "LABEL":
            if s.names[0] in labels:
                yield Finding(s.line, "krl-jump", f"The label {s.names[0]} stands also in line {labels[s.names[0]]}")
            labels[s.names[0]] = s.line
        elif s.word == "GOTO":
            jumps.append((s.names[0], s.line))
    for word, line in stack:
        yield Finding(line, "krl-nesting", f"{word} is not closed by {_OPEN[word]}")
    for name, line in jumps:
        if name not in labels:
            yield Finding(line, "krl-jump", f"There is no label {name} in the routine")


def check_splines(routine: Routine, most: int) -> Iterator[Finding]:
    """Yield what may not stand in, or outside of, a spline block."""
    opened: SplineOpen | None = None
    segments = 0
    for s in routine.body:
        if isinstance(s, SplineOpen):
            if opened is not None:
                yield Finding(s.line, "krl-spline-open", f"{s.word} opens inside the block of line {opened.line}")
            opened, segments = s, 0
        elif isinstance(s, SplineClose):
            if opened is None:
                yield Finding(s.line, "krl-spline-open", "ENDSPLINE closes nothing")
            elif segments == 0:
                yield Finding(opened.line, "krl-spline-empty", "The spline block has no segments")
            elif segments > most:
                yield Finding(
                    opened.line,
                    "krl-spline-long",
                    f"The block has {segments} segments; {most} are known to be safe",
                    "warning",
                )
            opened = None
        elif opened is None:
            if isinstance(s, Move) and s.word.startswith("SPL"):
                yield Finding(s.line, "krl-spl-outside", f"{s.word} stands outside of a spline block")
        elif not isinstance(s, Note):
            segments += isinstance(s, Move)
            yield from _inside(s, opened)
    if opened is not None:
        yield Finding(opened.line, "krl-spline-open", "The spline block is not closed by ENDSPLINE")


def _inside(s: Statement, block: SplineOpen) -> Iterator[Finding]:
    if isinstance(s, Move):
        allowed = _IN_PTP_SPLINE if block.word == "PTP_SPLINE" else _IN_SPLINE
        if s.word not in allowed:
            yield Finding(s.line, "krl-spline-statement", f"{s.word} may not stand in a {block.word} block")
        if s.approximation:
            yield Finding(s.line, "krl-spline-approximation", f"{s.approximation[0]} may not stand in a spline block")
    elif isinstance(s, Trigger):
        if s.measure == "DISTANCE":
            yield Finding(s.line, "krl-spline-distance", "A DISTANCE trigger may not stand in a spline block")
    elif not (isinstance(s, Control) and s.word.startswith(_SECTIONS)):
        yield Finding(
            s.line,
            "krl-spline-statement",
            "Only segments, PATH triggers and their sections may stand in a spline block",
        )


def check_triggers(routine: Routine) -> Iterator[Finding]:
    """Yield triggers with impossible values, calls without PRIO, and triggers no motion follows."""
    waiting: Trigger | None = None
    for s in routine.body:
        if isinstance(s, Trigger):
            waiting = s
            yield from _trigger(s)
        elif isinstance(s, Move | SplineOpen):
            if waiting is not None and waiting.measure == "PATH" and isinstance(s, Move) and s.word.startswith("PTP"):
                yield Finding(waiting.line, "krl-trigger", f"A PATH trigger stands before {s.word}")
            waiting = None
        elif isinstance(s, CallStatement):
            waiting = None
        elif isinstance(s, SplineClose) and waiting is not None:
            yield Finding(waiting.line, "krl-trigger-dangling", "No segment of the block follows the trigger")
            waiting = None
    if waiting is not None:
        yield Finding(waiting.line, "krl-trigger-dangling", "No motion follows the trigger in this routine", "warning")


def _trigger(s: Trigger) -> Iterator[Finding]:
    amount = constant(s.amount)
    if s.measure == "DISTANCE" and amount is not None and amount not in (0.0, 1.0):
        yield Finding(s.line, "krl-trigger", f"DISTANCE is {amount:g}; it is 0 (start) or 1 (end)")
    if isinstance(s.action, CallStatement):
        if s.priority is None:
            yield Finding(s.line, "krl-trigger-priority", f"{s.action.name} is called by a trigger without PRIO")
        else:
            p = constant(s.priority)
            if p is not None and not (p in (-1, 1, 2) or 4 <= p <= 39 or 81 <= p <= 128):
                yield Finding(s.line, "krl-trigger-priority", f"PRIO={p:g} is not free for triggers")


def check_families(routine: Routine, controller: str | None) -> Iterator[Finding]:
    """Yield mixed motion families, approximations of the other family, and words the controller does not have."""
    first: Move | None = None
    classic: Move | None = None
    spline: Move | SplineOpen | None = None
    for s in routine.body:
        if isinstance(s, SplineOpen):
            spline = spline or s
        if not isinstance(s, Move):
            continue
        of_spline = s.word in SPLINE_FAMILY
        if of_spline:
            spline = spline or s
        elif first is not None:
            classic = classic or s
        first = first or s
        wrong = [a for a in s.approximation if (a == "C_SPL") != of_spline]
        if wrong:
            yield Finding(s.line, "krl-approximation", f"{wrong[0]} does not belong to {s.word}")
        if controller == "krc2" and of_spline and s.word not in ("SPL", "SLIN", "SCIRC"):
            yield Finding(s.line, "krl-controller", f"{s.word} does not exist on {controller}")
        elif controller == "krc2" and s.word in ("SLIN", "SCIRC"):
            yield Finding(s.line, "krl-controller", f"{s.word} as a single motion does not exist on {controller}")
    if classic is not None and spline is not None:
        both = "PTP, LIN, CIRC and the spline family are mixed; the robot stops at every change"
        yield Finding(max(classic.line, spline.line), "krl-mixed-families", both, "warning")


__all__ = ["CLASSIC_FAMILY", "check_control", "check_families", "check_splines", "check_triggers"]
