"""`KrlProgram`: statements, not text. Modules, folds, motions, triggers; the writer knows one line form for each."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.issues import Issue
from planner.toolpath import PathKind


@dataclass(frozen=True)
class Comment:
    """A comment line; the text is already harmless (`comments.comment_text`)."""

    text: str


@dataclass(frozen=True)
class Init:
    """The INI fold: a main module only, since it sets $BASE to WORLD."""


@dataclass(frozen=True)
class External:
    """`EXT NAME ( )`: old controllers want called modules declared."""

    module: str


@dataclass(frozen=True)
class Setting:
    """`$VEL.CP = 0.1`: a system variable set to a number (as text) or an enumeration value."""

    variable: str
    value: str


@dataclass(frozen=True, eq=False)
class DefineBase:
    """`BASE_DATA[n] = {...}`, frame (6,) mm and deg in world."""

    number: int
    frame: Array


@dataclass(frozen=True, eq=False)
class UseBase:
    """`$BASE = BASE_DATA[n]`, or `$BASE = BASE_DATA[n] : {offset}` with offset (6,) mm and deg."""

    number: int
    offset: Array | None = None


@dataclass(frozen=True)
class UseTool:
    """`$TOOL = TOOL_DATA[n]`."""

    number: int


@dataclass(frozen=True)
class Call:
    """A call of another module without arguments."""

    module: str


@dataclass(frozen=True)
class WaitInput:
    """`WAIT FOR $IN[n]==TRUE`."""

    number: int


@dataclass(frozen=True, eq=False)
class AxisMove:
    """A motion to axis values (6,), deg."""

    word: str
    axes_deg: Array


@dataclass(frozen=True)
class HomeMove:
    """A motion to the controller's own XHOME."""

    word: str


@dataclass(frozen=True, eq=False)
class Moves:
    """Consecutive motions of one kind to poses (n, 6), mm and deg, each followed by `blend` unless that is empty."""

    word: str
    poses: Array
    blend: str = ""


@dataclass(frozen=True)
class Trigger:
    """A switching point at the start or the end of the next motion; `pulse_s` 0 switches, else a pulse of that length."""

    measure: Literal["DISTANCE", "PATH"]
    at: Literal["start", "end"]
    output: int
    value: bool
    pulse_s: float = 0.0


@dataclass(frozen=True, eq=False)
class SplineBlock:
    """`SPLINE WITH $VEL.CP=v` ... `ENDSPLINE`, v in m/s."""

    speed_m_s: float
    body: tuple["Statement", ...]


@dataclass(frozen=True, eq=False)
class Fold:
    """`;FOLD title` ... `;ENDFOLD (title)`."""

    title: str
    body: tuple["Statement", ...]


Statement = (
    Comment | Init | External | Setting | DefineBase | UseBase | UseTool | Call | WaitInput | AxisMove | HomeMove | Moves
    | Trigger | SplineBlock | Fold
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Module:
    """One `.src` file (and a `.dat` if `data` is set); file name and DEF name are `name`."""

    name: str
    body: tuple[Statement, ...]
    data: bool = False


@dataclass(frozen=True)
class Load:
    """What is in the controller's memory at once: a main module and the modules it calls, in order of the calls."""

    main: str
    modules: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class KrlProgram:
    """A program for one controller.

    poses (n, 6): every Cartesian target in order, unrounded, X Y Z mm A B C deg of the tool as taught in the active base;
    data_on, pass_id, block, speed_mm_s (n,): of the motion to it (`block` -1 outside splines). first_axes_deg: of every
    load, (6,) or None for an untaught base.
    `base_frame` (6,): what BASE_DATA[base_number] is set to, None for an untaught base; `base_offset` (6,): the frame
    composed onto it, None without. `issues`: warnings of the preflight; errors never get this far.
    """

    name: str
    stem: str
    kind: PathKind
    profile: str
    label: str
    modules: tuple[Module, ...]
    loads: tuple[Load, ...]
    poses: Array
    data_on: NDArray[np.bool_]
    pass_id: NDArray[np.int32]
    block: NDArray[np.int32]
    speed_mm_s: Array
    first_axes_deg: tuple[Array | None, ...]
    base_number: int
    tool_number: int
    base_frame: Array | None
    base_offset: Array | None
    data_output: int | None
    signal: str
    wait_input: int | None
    limits: dict[str, int]
    issues: tuple[Issue, ...] = ()

    def module(self, name: str) -> Module:
        """Return the module of this name."""
        return next(m for m in self.modules if m.name == name)
