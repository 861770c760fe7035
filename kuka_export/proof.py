"""The proof of a program: its text, read back, says what was meant."""

import hashlib
from dataclasses import dataclass, field

import numpy as np

from kuka_export.expected import AxisRow, expected
from kuka_export.language.library import Library, load
from kuka_export.numbers import DEG_ROUNDING, MM_ROUNDING
from kuka_export.program import KrlProgram
from kuka_export.reader import KrlReading, read_library
from planner.errors import EchoBaseError
from planner.frames import Array
from planner.issues import Issue
from planner.program_path import Motion

# Half a unit of the last decimal, and what binary arithmetic adds to it.
MM_ALLOWED = MM_ROUNDING + 1e-9
DEG_ALLOWED = DEG_ROUNDING + 1e-9


@dataclass(frozen=True)
class Proof:
    """What reading back found. `issues` is empty if the text says what the program means; `ok` is that.

    largest_mm, largest_deg: largest difference of a component of a pose, base or first axis value.
    """

    poses: int
    passes: int
    modules: int
    bytes: int
    largest_mm: float
    largest_deg: float
    sha256: dict[str, str]
    issues: tuple[Issue, ...] = field(default=())

    @property
    def ok(self) -> bool:
        """True if nothing differs by more than rounding."""
        return not self.issues


def prove(program: KrlProgram, files: dict[str, bytes], library: Library | None = None) -> Proof:
    """Return the proof of a program's files, read by a reader that does not know the writer.

    Compared: every pose in order (0.0005 mm and 0.00005 deg per component), kind of motion, spline blocks, blending, data
    signal, passes, speeds, base and tool and their numbers, settings, first axis values, waits, calls. `library`: the same
    files, parsed already.
    """
    sha = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    size = sum(len(data) for data in files.values())
    library = load(files) if library is None else library
    try:
        reading = read_library(library, program.data_output)
    except EchoBaseError as error:
        return Proof(0, 0, len(program.modules), size, np.inf, np.inf, sha, error.issues)
    faults, mm, deg = _compare(program, reading)
    faults += [i.message for i in reading.issues]
    faults += _surface(program, files)
    faults += [
        f"{source.name} does not hold the routine of its name"
        for source in library.files.values()
        if [r.name for r in source.routines] != [source.name.rsplit(".", 1)[0]]
    ]
    issues = tuple(_fault(text) for text in faults)
    passes = len(np.unique(reading.path.pass_id))
    return Proof(len(reading.path), passes, len(program.modules), size, mm, deg, sha, issues)


def _compare(program: KrlProgram, reading: KrlReading) -> tuple[list[str], float, float]:
    faults: list[str] = []
    if len(reading.poses) != len(program.poses):
        return [f"{len(program.poses)} poses were written, {len(reading.poses)} are read"], np.inf, np.inf
    mm, deg = _differences(program.poses, reading.poses)
    largest_mm, largest_deg = float(mm.max(initial=0.0)), float(deg.max(initial=0.0))
    off = np.flatnonzero((mm > MM_ALLOWED).any(axis=1) | (deg > DEG_ALLOWED).any(axis=1))
    if len(off):
        faults.append(
            f"{len(off)} poses differ by up to {mm.max():.4f} mm and {deg.max():.5f} deg,"
            f" the first at {reading.module[off[0]]}:{reading.line[off[0]]}"
        )
    meant = expected(program)
    path = reading.path
    rows = (
        ("the motion words", meant.words == reading.words),
        ("the blending", meant.blends == reading.approximation),
        ("the spline blocks", np.array_equal(path.block, program.block)),
        ("the kinds of motion", np.array_equal(path.motion == Motion.SPL, program.block >= 0)),
        ("the data signal", np.array_equal(path.data_on, program.data_on) and reading.exact_switching),
        ("the form of the data signal", reading.data_source == {"none": "comment"}.get(program.signal, program.signal)),
        ("the data output", reading.data_output == program.data_output),
        ("the passes", np.array_equal(path.pass_id, program.pass_id)),
        ("the speeds", np.allclose(path.speed_mm_s, program.speed_mm_s, rtol=0.0, atol=0.0051)),
        ("the base number", reading.base_number == program.base_number and reading.base_frame is None),
        ("the tool number", reading.tool_number == program.tool_number),
        ("the settings", meant.settings == reading.settings),
        ("the waits", meant.waits == reading.waits),
        ("the main modules", reading.mains == tuple(load.main for load in program.loads)),
        ("the calls", list(reading.calls) == [(load.main, m) for load in program.loads for m in load.modules]),
        (
            "the home motions",
            meant.homes == reading.homes and (reading.starts_at_home or program.base_frame is not None),
        ),
        ("the initialisation", reading.basis == ("INITMOV,0",) * len(program.loads)),
        ("the places where the base is set", len(reading.base_writes) == meant.base_writes),
    )
    faults += [f"{what} differ from what was meant" for what, same in rows if not same]
    pairs: list[tuple[str, Array | None, object]] = [
        ("the frame composed onto the base", program.base_offset, reading.base_offset)
    ]
    pairs.append(("the numbers of the base", program.base_frame, reading.base_data.get(program.base_number)))
    faults += [f"{what} differs" for what, meant, got in pairs if not _same_frame(meant, got)]
    if set(reading.base_data) - ({program.base_number} if program.base_frame is not None else set()):
        faults.append("a base is written that was not meant to be")
    if any(before for _, _, before in reading.base_writes[:1]):
        faults.append("the base is written after the first motion")
    if not _same_axes(meant.axis_moves, reading.axis_moves):
        faults.append("the axis motions differ")
    return faults, largest_mm, largest_deg


def _differences(meant: Array, got: Array) -> tuple[Array, Array]:
    """Component differences: mm (n, 3) and deg (n, 3), angles modulo a whole turn."""
    turn = (got[:, 3:] - meant[:, 3:] + 180.0) % 360.0 - 180.0
    return np.abs(got[:, :3] - meant[:, :3]), np.abs(turn)


def _same_frame(meant: Array | None, got: object) -> bool:
    if meant is None or got is None:
        return meant is None and got is None
    mm, deg = _differences(np.asarray(meant)[None], np.asarray(got, dtype=np.float64)[None])
    return bool((mm <= MM_ALLOWED).all() and (deg <= DEG_ALLOWED).all())


def _same_axes(meant: tuple[AxisRow, ...], got: tuple[AxisRow, ...]) -> bool:
    if [(row, word) for row, word, _ in meant] != [(row, word) for row, word, _ in got]:
        return False
    return all(
        np.abs(np.array(a) - np.array(b)).max() <= DEG_ALLOWED for (_, _, a), (_, _, b) in zip(meant, got, strict=True)
    )


def _surface(program: KrlProgram, files: dict[str, bytes]) -> list[str]:
    """Bytes no reader of meaning would see: character set, line ends, the set of files."""
    faults: list[str] = []
    names = {f"{m.name}.src" for m in program.modules} | {f"{m.name}.dat" for m in program.modules if m.data}
    if set(files) != names:
        faults.append("the set of files differs from the program's modules")
    for name, data in files.items():
        if not data.isascii() or any(b < 32 and b not in (10, 13) for b in set(data)):
            faults.append(f"{name} holds bytes that are not plain ASCII")
        if (
            data.count(b"\n") != data.count(b"\r\n")
            or data.count(b"\r") != data.count(b"\n")
            or not data.endswith(b"\r\n")
        ):
            faults.append(f"{name} has a line that does not end in CR LF")
    return faults


def _fault(text: str) -> Issue:
    return Issue(
        "error",
        "krl-proof",
        f"The program does not read back as meant: {text}.",
        "Do not use it; report this as a fault of EchoBase.",
        "proof",
    )
