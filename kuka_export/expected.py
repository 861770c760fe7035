"""What a program means to do, taken from its statements: the other side of the proof."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from kuka_export.program import (
    AxisMove,
    Call,
    DefineBase,
    Fold,
    HomeMove,
    KrlProgram,
    Moves,
    Setting,
    SplineBlock,
    Statement,
    WaitInput,
)  # fmt: skip

AxisRow = tuple[int, str, tuple[float, ...]]


@dataclass(frozen=True)
class Expected:
    """Words and blending of every motion; settings, waits and axis motions with the number of motions before them."""

    words: tuple[str, ...]
    blends: tuple[str, ...]
    settings: tuple[tuple[int, str, object], ...]
    waits: tuple[tuple[int, int | None], ...]
    axis_moves: tuple[AxisRow, ...]
    homes: int
    base_writes: int


def expected(program: KrlProgram) -> Expected:
    """Return what a reader of the program should find, in order of the loads and their calls."""
    words: list[str] = []
    blends: list[str] = []
    settings: list[tuple[int, str, object]] = []
    waits: list[tuple[int, int | None]] = []
    axis_moves: list[AxisRow] = []
    homes = base_writes = 0
    for s in _in_order(program):
        row = len(words)
        if isinstance(s, Moves):
            words += [s.word] * len(s.poses)
            blends += [s.blend] * len(s.poses)
        elif isinstance(s, Setting):
            settings.append((row, s.variable, _value(s.value)))
        elif isinstance(s, WaitInput):
            waits.append((row, s.number))
        elif isinstance(s, AxisMove):
            axis_moves.append((row, s.word, tuple(s.axes_deg.tolist())))
        homes += isinstance(s, HomeMove)
        base_writes += isinstance(s, DefineBase)
    return Expected(tuple(words), tuple(blends), tuple(settings), tuple(waits), tuple(axis_moves), homes, base_writes)


def _value(text: str) -> object:
    if text in ("TRUE", "FALSE"):
        return text == "TRUE"
    try:
        return float(text)
    except ValueError:
        return text


def _in_order(program: KrlProgram) -> Iterator[Statement]:
    """Follow the loads: what stands in a main module before its calls, the modules it calls, what stands behind."""
    for load in program.loads:
        called = set(load.modules)
        for s in _walk(program.module(load.main).body):
            if isinstance(s, Call) and s.module in called:
                yield from _walk(program.module(s.module).body)
            else:
                yield s


def _walk(body: Iterable[Statement]) -> Iterator[Statement]:
    for s in body:
        yield s
        if isinstance(s, Fold | SplineBlock):
            yield from _walk(s.body)
