"""Follows a straight-line program through its calls: every motion with its base, tool, speed, block and switches."""

import math
import re
from contextlib import suppress

from kuka_export.language.followed import BaseState, Followed, Switch
from kuka_export.language.inline_forms import basis_call, with_clause
from kuka_export.language.lexer import KrlSyntaxError
from kuka_export.language.library import Library
from kuka_export.language.nodes import (
    Assign,
    CallStatement,
    Chain,
    Control,
    Declaration,
    Designator,
    Move,
    Note,
    Number,
    Pulse,
    Routine,
    SourceFile,
    SplineClose,
    SplineOpen,
    Statement,
    Trigger,
    Wait,
)
from kuka_export.language.values import (
    UnknownValueError,
    Value,
    compose,
    evaluate,
    frame_of,
    key_of,
    number,
    only_components,
)
from kuka_export.language.vocabulary import AXIS_NAMES, CARTESIAN, MOTION_CIRCLE, MOTION_RELATIVE
from planner.errors import EchoBaseError, fail
from planner.issues import Issue

_PASS = re.compile(r"^\s*FOLD\s+PASS\s+(\d+)", re.IGNORECASE)
_IGNORED = frozenset(
    {
        "INTERRUPT DECL",
        "INTERRUPT ON",
        "INTERRUPT OFF",
        "INTERRUPT ENABLE",
        "INTERRUPT DISABLE",
        "CONTINUE",
        "LABEL",
        "HALT",
        "CONST_VEL START",
        "CONST_VEL END",
        "STRUC",
        "ENUM",
        "STOP WHEN",
    }
)
MAX_CALL_DEPTH = 30


class Follower:
    """Runs routines of a library. `known` holds the values of variables by name."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.out = Followed()
        self.known: dict[str, Value] = {}
        self.base: BaseState | None = None
        self.tool: int | None = None
        self.speed_mm_s = math.nan
        self.block_speed: float | None = None
        self.blocks = 0
        self.in_block = False
        self.pending: list[Trigger] = []
        self.at_block_end: list[Trigger] = []
        self.fold_stack: list[int] = []
        self.last_pose: tuple[float, ...] | None = None
        self.source = SourceFile("")
        self.depth = 0
        for source in library.files.values():
            for routine in source.routines:
                self.source = source
                self._values(routine, data_list=routine.word == "DEFDAT")

    def _values(self, routine: Routine, data_list: bool) -> None:
        for s in routine.body:
            if isinstance(s, Declaration) and s.value is not None and s.type != "SIGNAL":
                self._declare(s)
            elif data_list and isinstance(s, Assign):
                with suppress(UnknownValueError, KrlSyntaxError):
                    self._assign(s)

    def _declare(self, s: Declaration) -> None:
        # A value that cannot be had may be one nobody needs; a motion that needs it says so.
        with suppress(UnknownValueError, KrlSyntaxError):
            if s.value is not None:
                self.known[key_of(s.names[0], self.known)] = evaluate(s.value, self.known)

    def run(self, source: SourceFile, routine: Routine) -> None:
        """Follow one routine to its end; raises EchoBaseError with file and line if it cannot be followed."""
        if self.depth > MAX_CALL_DEPTH:
            raise self._stop(routine.line, "krl-recursion", "Calls go in a circle.", "Break the circle.")
        outer, self.source = self.source, source
        self.depth += 1
        try:
            for s in routine.body:
                try:
                    if isinstance(s, Control) and s.word == "RETURN":
                        break
                    self._step(s, routine)
                except UnknownValueError as error:
                    raise self._stop(
                        s.line,
                        "krl-unknown-value",
                        f"The value of {error.name} stands in none of the files.",
                        "Add the data list that holds it.",
                    ) from error
                except KrlSyntaxError as error:
                    raise self._stop(s.line, error.code, error.message, "Correct the line.") from error
        finally:
            self.source = outer
            self.depth -= 1

    def _stop(self, line: int, code: str, message: str, remedy: str) -> EchoBaseError:
        return fail(code, message, remedy, f"{self.source.name}:{line}")

    def _step(self, s: Statement | Note, routine: Routine) -> None:
        if isinstance(s, Move):
            self._move(s, routine)
        elif isinstance(s, Note):
            self._note(s)
        elif isinstance(s, Trigger):
            self.pending.append(s)
        elif isinstance(s, Assign):
            self._assign(s)
        elif isinstance(s, CallStatement):
            self._call(s, routine)
        elif isinstance(s, SplineOpen):
            self._open(s)
        elif isinstance(s, SplineClose):
            self._close()
        elif isinstance(s, Pulse):
            self._switch(s.output, None, False, True, s.line)
        elif isinstance(s, Wait):
            self.out.waits.append((len(self.out.poses), _input(s)))
        elif isinstance(s, Control) and s.word not in _IGNORED:
            raise self._stop(
                s.line,
                "krl-not-straight",
                f"{s.word} makes the path depend on what happens at run time.",
                "Only straight-line programs can be read as a path.",
            )

    def _note(self, s: Note) -> None:
        upper = s.text.strip().upper()
        if upper.startswith("FOLD"):
            match = _PASS.match(s.text)
            here = self.fold_stack[-1] if self.fold_stack else -1
            self.fold_stack.append(int(match.group(1)) - 1 if match else here)
        elif upper.startswith("ENDFOLD") and self.fold_stack:
            self.fold_stack.pop()
        elif upper.startswith("DATA O"):
            self.out.comments.append((len(self.out.poses), upper))

    def _assign(self, s: Assign) -> None:
        target = s.target
        name = target.dotted
        if name == "$BASE":
            self.base = self._base_state(s)
        elif name == "$TOOL":
            self.tool = self._tool_number(s)
        elif name == "$VEL.CP":
            speed = number(evaluate(s.value, self.known))
            self.speed_mm_s = 1000.0 * speed
            self.out.settings.append((len(self.out.poses), name, speed))
        elif name == "$OUT" and target.index:
            value = bool(evaluate(s.value, self.known))
            self._switch(target.index[0], value, False, True, s.line)
            self.out.settings.append((len(self.out.poses), key_of(target, self.known), value))
        elif name == "BASE_DATA" and target.index:
            n = int(number(evaluate(target.index[0], self.known)))
            self.out.base_data[n] = frame_of(evaluate(s.value, self.known))
            self.out.base_writes.append(
                (n, self.source.name, len(self.out.poses) + len(self.out.axis_moves) + len(self.out.homes))
            )
            self.known[f"BASE_DATA[{n}]"] = dict(zip(CARTESIAN, self.out.base_data[n], strict=True))
        else:
            self._store(s)

    def _store(self, s: Assign) -> None:
        key = key_of(s.target, self.known)
        system = s.target.dotted if s.target.root.startswith("$") else ""
        try:
            value = evaluate(s.value, self.known)
        except UnknownValueError as error:
            self.known.pop(key, None)
            if system:
                self.out.settings.append((len(self.out.poses), system, error.name))
            return
        if system:
            self.out.settings.append((len(self.out.poses), system, value))
        if len(s.target.names) == 1:
            self.known[key] = value
            return
        if len(s.target.names) == 2 and isinstance(self.known.get(key), dict):
            self.known[key] = {**self.known[key], s.target.names[1]: value}
        else:
            self.known[s.target.dotted] = value

    def _base_state(self, s: Assign) -> BaseState:
        e = s.value
        if isinstance(e, Designator) and e.dotted == "$WORLD":
            return BaseState(0)
        if isinstance(e, Designator) and e.root == "BASE_DATA" and e.index:
            return BaseState(int(number(evaluate(e.index[0], self.known))))
        if isinstance(e, Chain) and set(e.operators) == {":"} and isinstance(e.operands[0], Designator):
            head = e.operands[0]
            rest = [frame_of(evaluate(o, self.known)) for o in e.operands[1:]]
            offset = rest[0]
            for more in rest[1:]:
                offset = compose(offset, more)
            if head.root == "BASE_DATA" and head.index:
                return BaseState(int(number(evaluate(head.index[0], self.known))), offset)
            if head.dotted == "$BASE" and self.base is not None:
                before = self.base.offset
                return BaseState(
                    self.base.number, offset if before is None else compose(before, offset), self.base.frame
                )
            if head.dotted == "$WORLD":
                return BaseState(0, offset)
        return BaseState(None, None, frame_of(evaluate(e, self.known)))

    def _tool_number(self, s: Assign) -> int | None:
        e = s.value
        if isinstance(e, Designator) and e.root == "TOOL_DATA" and e.index:
            return int(number(evaluate(e.index[0], self.known)))
        return None

    def _call(self, s: CallStatement, routine: Routine) -> None:
        if s.name == "BAS":
            basis_call(self, s)
            return
        found = self.library.find(s.name, self.source)
        if found is None:
            self.out.notes.append(
                Issue(
                    "warning",
                    "krl-undeclared",
                    f"{s.name} is called but not among the files; what it does is not known.",
                    "Add its file.",
                    f"{self.source.name}:{s.line}",
                )
            )
            return
        self.out.calls.append((routine.name, s.name))
        self.run(*found)

    def _open(self, s: SplineOpen) -> None:
        if self.in_block:
            raise KrlSyntaxError("krl-spline-statement", "A spline block opens inside another.")
        self.in_block, self.block_speed = True, with_clause(self, s.with_)
        # A trigger in front of a block counts from the start or to the end of the whole block.
        for t in self.pending:
            if _at_start(t):
                self._fire(t)
            else:
                self.at_block_end.append(t)
        self.pending = []

    def _close(self) -> None:
        if not self.in_block:
            raise KrlSyntaxError("krl-spline-statement", "ENDSPLINE without SPLINE.")
        self.in_block, self.block_speed = False, None
        self.blocks += 1
        for t in self.at_block_end:
            self._fire(t)
        self.at_block_end = []

    def _move(self, s: Move, routine: Routine) -> None:
        if s.word in MOTION_CIRCLE or s.word in MOTION_RELATIVE:
            raise KrlSyntaxError(
                "krl-unsupported-motion", f"{s.word} cannot be read as a path of straight lines and splines."
            )
        pose = s.pose
        if pose is None:
            pose = self._target(s)
        if pose is not None:
            self._to_pose(s, pose, routine)

    def _target(self, s: Move) -> tuple[float, ...] | None:
        """Return the pose of a target that is not six plain numbers; None for axis values and motions that go nowhere."""
        target = s.targets[0]
        if isinstance(target, Designator) and target.root in ("$AXIS_ACT", "$POS_ACT"):
            return None
        if isinstance(target, Designator) and target.root.startswith("XHOME") and target.root not in self.known:
            self.out.homes.append(len(self.out.poses))
            self._after_motion(self._before_motion())
            return None
        value = evaluate(target, self.known)
        if not isinstance(value, dict):
            raise KrlSyntaxError("krl-type", "A motion needs a point.")
        if set(value) & set(AXIS_NAMES[:6]):
            only_components(value, "E6AXIS")
            self._axes(s, value)
            return None
        only_components(value, "E6POS")
        return self._filled(value)

    def _to_pose(self, s: Move, pose: tuple[float, ...], routine: Routine) -> None:
        own_speed = with_clause(self, s.with_) if s.with_ else None
        ends = self._before_motion()
        out = self.out
        state = (self.base or BaseState(0), self.tool)
        if not out.bases or out.bases[-1][1:] != state:
            out.bases.append((len(out.poses), *state))
        out.poses.append(pose)
        out.words.append(s.word)
        out.block.append(self.blocks if self.in_block else -1)
        speed = own_speed if own_speed is not None else self.block_speed if self.in_block else None
        out.speed_mm_s.append(self.speed_mm_s if speed is None else speed)
        out.fold_pass.append(self.fold_stack[-1] if self.fold_stack else -1)
        out.module.append(routine.name)
        out.lines.append(s.line)
        out.approximation.append(s.approximation[0] if s.approximation else "")
        self.last_pose = pose
        self._after_motion(ends)

    def _filled(self, value: dict[str, Value]) -> tuple[float, ...]:
        """Components left out keep their last value, as on the controller."""
        if not all(k in value for k in CARTESIAN) and self.last_pose is None:
            raise KrlSyntaxError(
                "krl-incomplete-pose",
                "The first pose leaves components out, and nothing stands before it to take them from.",
            )
        last = self.last_pose or (0.0,) * 6
        return tuple(number(value.get(k, last[i])) for i, k in enumerate(CARTESIAN))

    def _axes(self, s: Move, value: dict[str, Value]) -> None:
        if s.word not in ("PTP", "SPTP"):
            raise KrlSyntaxError("krl-target", f"{s.word} cannot go to axis values; PTP and SPTP can.")
        ends = self._before_motion()
        self.out.axis_moves.append(
            (len(self.out.poses), s.word, tuple(number(value.get(k, math.nan)) for k in AXIS_NAMES[:6]))
        )
        self._after_motion(ends)

    def _before_motion(self) -> list[Trigger]:
        ends = [t for t in self.pending if not _at_start(t)]
        for t in self.pending:
            if _at_start(t):
                self._fire(t)
        self.pending = []
        return ends

    def _after_motion(self, ends: list[Trigger]) -> None:
        for t in ends:
            self._fire(t)

    def _fire(self, t: Trigger) -> None:
        exact = number(evaluate(t.delay, self.known)) == 0.0
        amount = number(evaluate(t.amount, self.known))
        exact &= amount in (0.0, 1.0) if t.measure == "DISTANCE" else amount == 0.0
        if isinstance(t.action, Pulse):
            self._switch(t.action.output, None, True, exact, t.line)
        elif isinstance(t.action, Assign) and t.action.target.root == "$OUT" and t.action.target.index:
            value = bool(evaluate(t.action.value, self.known))
            self._switch(t.action.target.index[0], value, True, exact, t.line)

    def _switch(self, output: object, value: bool | None, by_trigger: bool, exact: bool, line: int) -> None:
        where = output.index[0] if isinstance(output, Designator) and output.root == "$OUT" and output.index else output
        n = int(number(evaluate(where, self.known)))  # type: ignore[arg-type]
        self.out.switches.append(Switch(len(self.out.poses), n, value, by_trigger, exact, line))


def _at_start(t: Trigger) -> bool:
    if t.measure == "PATH":
        return t.on_start
    return isinstance(t.amount, Number) and t.amount.value == 0.0


def _input(s: Wait) -> int | None:
    """Return n of `WAIT FOR $IN[n]` and `WAIT FOR $IN[n]==TRUE`, None for any other wait."""
    e = s.value
    if isinstance(e, Chain) and e.operators == ("==",) and e.operands[1] == Designator(("TRUE",), (None,)):
        e = e.operands[0]
    if (
        s.what == "FOR"
        and isinstance(e, Designator)
        and e.dotted == "$IN"
        and e.index
        and isinstance(e.index[0], Number)
    ):
        return int(e.index[0].value)
    return None
