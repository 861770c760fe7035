"""What following a program yields: every motion, switch and frame, in order."""

from dataclasses import dataclass, field

from kuka_export.language.values import Value
from planner.issues import Issue


@dataclass(frozen=True)
class BaseState:
    """$BASE: BASE_DATA index (None: a frame of its own, 0: WORLD), frame composed onto it, or the frame itself."""

    number: int | None
    offset: tuple[float, ...] | None = None
    frame: tuple[float, ...] | None = None


@dataclass
class Switch:
    """An output that changes from motion number `motion` on; `value` None is a pulse. `exact`: at a programmed point."""

    motion: int
    output: int
    value: bool | None
    by_trigger: bool
    exact: bool
    line: int


@dataclass
class Followed:
    """What a program did, motion by motion (lists of equal length), and what it set."""

    poses: list[tuple[float, ...]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    block: list[int] = field(default_factory=list)
    speed_mm_s: list[float] = field(default_factory=list)
    fold_pass: list[int] = field(default_factory=list)
    module: list[str] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    approximation: list[str] = field(default_factory=list)
    switches: list[Switch] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)
    axis_moves: list[tuple[int, str, tuple[float, ...]]] = field(default_factory=list)
    homes: list[int] = field(default_factory=list)
    waits: list[tuple[int, int | None]] = field(default_factory=list)
    basis: list[str] = field(default_factory=list)
    calls: list[tuple[str, str]] = field(default_factory=list)
    bases: list[tuple[int, BaseState, int | None]] = field(default_factory=list)
    base_data: dict[int, tuple[float, ...]] = field(default_factory=dict)
    base_writes: list[tuple[int, str, int]] = field(default_factory=list)
    settings: list[tuple[int, str, Value]] = field(default_factory=list)
    notes: list[Issue] = field(default_factory=list)
