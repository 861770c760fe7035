"""A program whose text was touched does not pass its proof."""

import itertools
import re

import numpy as np
import pytest

from kuka_export.build import build_program
from kuka_export.options import ProgramOptions
from kuka_export.program import KrlProgram
from kuka_export.proof import prove
from kuka_export.writer import write_program
from tests.krl.paths import correction, raster, setup

OPTIONS = ProgramOptions(home=True)
SIGNALS = {"signals": {"data_output": 7, "wait_input": 4}}


def made(controller: str, taught: bool = True) -> tuple[KrlProgram, dict[str, bytes]]:
    s = setup(controller, taught, **SIGNALS)
    program = build_program(
        raster("alignment", 6, 2, 9.0, 4.0, 2), s, "EB_MUT", T_base_basecorr=correction(), options=OPTIONS
    )
    return program, write_program(program)


def is_motion_matter(line: str) -> bool:
    """Lines that mean something to the robot; comments and headers do not, and INI is the controller's own."""
    return bool(line) and not line.lstrip().startswith((";", "&")) and line not in INI


INI = {
    "    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )", "    INTERRUPT ON 3",
    "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )", "DECL INT SUCCESS",
}  # fmt: skip


def lines_of(files: dict[str, bytes]) -> list[tuple[str, int, str]]:
    return [
        (n, i, t)
        for n, d in files.items()
        for i, t in enumerate(d.decode("ascii").split("\r\n"))
        if is_motion_matter(t)
    ]


def with_line(files: dict[str, bytes], name: str, row: int, new: list[str]) -> dict[str, bytes]:
    lines = files[name].decode("ascii").split("\r\n")
    lines[row : row + 1] = new
    return {**files, name: "\r\n".join(lines).encode("ascii")}


CASES = [("krc2", True), ("krc4", True), ("krc4", False)]


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_the_untouched_program_is_proven(controller: str, taught: bool):
    assert prove(*made(controller, taught)).ok


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_every_deleted_line_is_noticed(controller: str, taught: bool):
    program, files = made(controller, taught)
    # EXT lines only tell an old linker what it will find; calls without them still read the same.
    unnoticed = [
        t for n, i, t in lines_of(files) if not t.startswith("EXT ") and prove(program, with_line(files, n, i, [])).ok
    ]
    # The speed of a motion is set again where the next pass begins: one such line may be the same as before.
    assert [t for t in unnoticed if not t.startswith("$VEL.CP = ")] == []
    assert len(unnoticed) <= 3


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_every_doubled_motion_trigger_and_call_is_noticed(controller: str, taught: bool):
    program, files = made(controller, taught)
    matter = [(n, i, t) for n, i, t in lines_of(files) if re.match(r"(S?LIN|SPL|SPLINE|S?PTP|WAIT|EB_|DEF|END)\b", t)]
    assert len(matter) > 30
    assert [t for n, i, t in matter if prove(program, with_line(files, n, i, [t, t])).ok] == []


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_every_swap_of_neighbouring_motions_is_noticed(controller: str, taught: bool):
    program, files = made(controller, taught)
    rows = [(n, i, t) for n, i, t in lines_of(files) if re.match(r"(S?LIN|SPL) ", t)]
    pairs = [(n, i, t, u) for (n, i, t), (m, j, u) in itertools.pairwise(rows) if n == m and j == i + 1 and t != u]
    assert len(pairs) > 10
    for n, i, t, u in pairs:
        swapped = with_line(with_line(files, n, i, [u]), n, i + 1, [t])
        assert not prove(program, swapped).ok


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_every_changed_digit_is_noticed(controller: str, taught: bool):
    program, files = made(controller, taught)
    rng = np.random.default_rng(11)
    spots = [(n, i, t, m.start()) for n, i, t in lines_of(files) for m in re.finditer(r"(?<![A-Z0-9_])\d|(?<=[0-9.])\d", t)
             if not t.startswith(("EXT ", "DEF ", "DEFDAT"))]  # fmt: skip
    picked = rng.choice(len(spots), 250, replace=False)
    missed = []
    for k in picked:
        n, i, t, at = spots[k]
        digit = str((int(t[at]) + int(rng.integers(1, 10))) % 10)
        changed = t[:at] + digit + t[at + 1 :]
        same_number = re.sub(r"\b0+(?=\d)", "", changed) == t
        if not same_number and prove(program, with_line(files, n, i, [changed])).ok:
            missed.append((t, changed))
    assert missed == []


@pytest.mark.parametrize(("controller", "taught"), CASES)
def test_random_bytes_in_meaningful_places_are_noticed(controller: str, taught: bool):
    program, files = made(controller, taught)
    rng = np.random.default_rng(12)
    rows = [r for r in lines_of(files) if not r[2].startswith(("EXT ", "DEF "))]
    missed = []
    for k in rng.integers(0, len(rows), 200):
        n, i, t = rows[int(k)]
        at = int(rng.integers(0, len(t)))
        byte = chr(int(rng.integers(33, 127)))
        changed = t[:at] + byte + t[at + 1 :]
        harmless = (
            re.sub(r"\s+", "", changed.upper()) == re.sub(r"\s+", "", t.upper())
            or t[at] == " "
            or t[:at].endswith(" ( ")
        )
        # A semicolon turns the rest into a comment; it must be noticed unless nothing but blanks follows.
        if not harmless and prove(program, with_line(files, n, i, [changed])).ok:
            missed.append((t, changed))
    assert missed == []


def test_a_missing_an_added_and_a_renamed_file_are_noticed():
    program, files = made("krc4")
    assert not prove(program, {k: v for k, v in files.items() if k != "EB_MUT_001.src"}).ok
    assert not prove(program, {**files, "EB_X.src": b"DEF EB_X ( )\r\nEND\r\n"}).ok
    assert not prove(program, {("EB_Y.src" if k == "EB_MUT_001.src" else k): v for k, v in files.items()}).ok


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: d.replace(b"\r\n", b"\n"),
        lambda d: d[:-2],
        lambda d: d.replace(b";PART", b";P\xc4RT"),
        lambda d: d + b"\x1a",
    ],
)
def test_bytes_no_reader_of_meaning_would_see_are_noticed(damage):
    program, files = made("krc4")
    assert not prove(program, {**files, "EB_MUT_C.src": damage(files["EB_MUT_C.src"])}).ok
