"""A program read back from its text: what the robot will really do. Written from the language, not from the writer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kuka_export.language.follow import Followed, Follower
from kuka_export.language.library import Library, load, uncollected
from planner.errors import EchoBaseError, fail
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.program_path import Motion, ProgramPath


@dataclass(frozen=True, eq=False)
class KrlReading:
    """A program as read.

    path: its Cartesian motions; poses (n, 6): their numbers as written, X Y Z A B C. base_number, tool_number: the
    indices it moves with (None: a frame of its own, 0: WORLD).
    base_data: index -> X Y Z A B C of every base the files define. base_offset (6,): frame composed onto the base, or
    None. first_axes (6,): axis values of the first axis motion, or None; `first_axes_all`, of every main module. `main`,
    `mains`: modules a person selects; `modules`: all files' first routines; `calls`: (caller, called) in order.
    data_output: the $OUT that is taken as the data signal; `data_source`: trigger, pulse, assignment, comment or none.
    words, module, line: of every motion, as the file has them. settings: (motions before it, system variable, value) of
    every assignment in order; a value the files do not say is the name it was taken from. waits: (motions before it, input).
    `issues`: what could not be followed, as warnings.
    """

    path: ProgramPath
    poses: Array
    base_number: int | None
    tool_number: int | None
    base_data: dict[int, tuple[float, ...]]
    base_offset: tuple[float, ...] | None
    base_frame: tuple[float, ...] | None
    first_axes: Array | None
    first_axes_all: tuple[tuple[float, ...], ...]
    main: str
    mains: tuple[str, ...]
    modules: tuple[str, ...]
    calls: tuple[tuple[str, str], ...]
    data_output: int | None
    data_source: str
    exact_switching: bool
    homes: int
    starts_at_home: bool
    waits: tuple[tuple[int, int | None], ...]
    axis_moves: tuple[tuple[int, str, tuple[float, ...]], ...]
    basis: tuple[str, ...]
    base_writes: tuple[tuple[int, str, int], ...]
    words: tuple[str, ...]
    approximation: tuple[str, ...]
    module: tuple[str, ...]
    line: NDArray[np.int64]
    settings: tuple[tuple[int, str, object], ...]
    issues: tuple[Issue, ...] = ()

    @property
    def T_world_base(self) -> Transform | None:
        """The base the program moves in, in world, if the files say it (`base` whatever its numbers are)."""
        frame = self.base_frame
        if frame is None and self.base_number == 0:
            frame = (0.0,) * 6
        if frame is None and self.base_number is not None:
            frame = self.base_data.get(self.base_number)
        if frame is None:
            return None
        known = Transform.from_xyzabc("world", "base", np.array(frame))
        if self.base_offset is None:
            return known
        return known @ Transform.from_xyzabc("base", "base", np.array(self.base_offset))


def read_program(files: dict[str, bytes], data_output: int | None = None) -> KrlReading:
    """Return the reading of file name -> bytes (.src, .dat); other files are ignored.

    `data_output`: the $OUT that means "taking data"; None: the one output that the program switches while it moves.

    Raises EchoBaseError with every line that is not KRL, or with the first statement that cannot be followed: branches,
    circles, points whose values stand nowhere, a base or tool that changes on the way.
    """
    return read_library(load(files), data_output)


def read_library(library: Library, data_output: int | None = None) -> KrlReading:
    """Return the reading of files parsed already; as `read_program`."""
    problems = [
        Issue("error", code, message, "Correct the line.", f"{source.name}:{line}")
        for source in library.files.values()
        for line, code, message in source.problems
    ]
    if problems:
        raise EchoBaseError(*problems)
    roots = library.roots()
    if not roots:
        raise fail(
            "krl-no-motion", "No module among the files moves the robot.", "Give the main module and all it calls."
        )
    follower = Follower(library)
    first_rows: list[int] = []
    home_first = False
    for k, (source, routine) in enumerate(roots):
        first_rows.append(len(follower.out.axis_moves))
        with uncollected():
            follower.run(source, routine)
        if k == 0:
            out = follower.out
            home_first = bool(out.homes) and out.homes[0] == 0
    return _reading(library, follower.out, [r.name for _, r in roots], first_rows, home_first, data_output)


def _reading(
    library: Library, out: Followed, mains: list[str], first_rows: list[int], home_first: bool, data_output: int | None
) -> KrlReading:
    if not out.poses:
        raise fail("krl-no-motion", "The program has no Cartesian motion.", "Give the modules that hold the path.")
    states = {state[1:] for state in out.bases}
    if len(states) > 1:
        row = out.bases[1][0]
        raise fail(
            "krl-frames-change",
            "Base or tool change in the middle of the program.",
            "Use one base and one tool per program.",
            f"{out.module[row]}:{out.lines[row]}",
        )
    base, tool = next(iter(states))
    on, chosen, how, exact, notes = data_signal(out, data_output)
    words = np.array(out.words)
    axes = [a for _, _, a in out.axis_moves]
    ptp = np.isin(words, ("PTP", "SPTP"))
    if ptp.any():
        notes = [
            *notes,
            Issue(
                "warning",
                "krl-ptp-pose",
                f"{int(ptp.sum())} PTP motions go to poses; they are read as straight.",
                "",
                mains[0],
            ),
        ]
    path = ProgramPath(
        Ts_base_tcp=Transform.from_xyzabc("base", "tcp", np.array(out.poses)),
        motion=np.where(words == "SPL", Motion.SPL, Motion.LIN).astype(np.uint8),
        block=np.array(out.block, dtype=np.int32),
        data_on=on,
        speed_mm_s=np.array(out.speed_mm_s),
        pass_id=_passes(out),
    )
    return KrlReading(
        path=path,
        poses=np.array(out.poses),
        base_number=base.number,
        tool_number=tool,
        base_data=dict(out.base_data),
        base_offset=base.offset,
        base_frame=base.frame,
        first_axes=np.array(axes[0]) if axes else None,
        first_axes_all=tuple(axes[i] for i in first_rows if i < len(axes)),
        main=mains[0],
        mains=tuple(mains),
        modules=tuple(s.routines[0].name for s in library.sources() if s.routines),
        calls=tuple(out.calls),
        data_output=chosen,
        data_source=how,
        exact_switching=exact,
        homes=len(out.homes),
        starts_at_home=home_first,
        waits=tuple(out.waits),
        axis_moves=tuple(out.axis_moves),
        basis=tuple(out.basis),
        base_writes=tuple(out.base_writes),
        words=tuple(out.words),
        approximation=tuple(out.approximation),
        module=tuple(out.module),
        line=np.array(out.lines),
        settings=tuple(out.settings),
        issues=(*out.notes, *notes),
    )


def data_signal(out: Followed, wanted: int | None) -> tuple[NDArray[np.bool_], int | None, str, bool, list[Issue]]:
    """Return for each motion whether data are taken on it, the output, how it is switched, whether at programmed points."""
    n = len(out.poses)
    outputs = sorted({s.output for s in out.switches if s.by_trigger}) or sorted(
        {s.output for s in out.switches if s.value}
    )
    chosen = wanted if wanted is not None else outputs[0] if len(outputs) == 1 else None
    notes: list[Issue] = []
    if wanted is None and len(outputs) > 1:
        names = ", ".join(f"$OUT[{o}]" for o in outputs)
        notes.append(
            Issue(
                "warning",
                "krl-data-signal",
                f"The program switches {names}; none is taken as the data signal.",
                "Say which one it is.",
            )
        )
    mine = [s for s in out.switches if s.output == chosen]
    change = np.full(n + 1, -1, dtype=np.int8)
    if mine:
        pulses = [s for s in mine if s.value is None]
        state = False
        for s in mine:
            # A pulse marks each end of a run, so it turns the state over.
            state = (not state) if s.value is None else s.value
            change[s.motion] = state
        how = "pulse" if pulses else "trigger" if any(s.by_trigger for s in mine) else "assignment"
        return _held(change[:n]), chosen, how, all(s.exact for s in mine), notes
    for row, text in out.comments:
        # "at the next pose": the motion to it is still the old state.
        change[min(row + 1, n)] = text.startswith("DATA ON")
    return _held(change[:n]), None, "comment" if out.comments else "none", True, notes


def _held(change: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return the state at every row: the last change at or before it, off before the first."""
    rows = np.where(change >= 0, np.arange(len(change)), -1)
    last = np.maximum.accumulate(rows) if len(rows) else rows
    return np.where(last >= 0, change[last] == 1, False)


def _passes(out: Followed) -> NDArray[np.int32]:
    folds = np.array(out.fold_pass, dtype=np.int32)
    if (folds >= 0).any():
        return folds
    names = {name: k for k, name in enumerate(dict.fromkeys(out.module))}
    return np.array([names[m] for m in out.module], dtype=np.int32)
