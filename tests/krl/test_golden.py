"""Whole programs, byte for byte. A change here is a change a robot will feel: read the diff, then `make golden`."""

import pytest

from kuka_export.check import check_files
from kuka_export.reader import read_program
from tests.krl.update_golden import FOLDER, programs

PROGRAMS = dict(programs())


@pytest.mark.parametrize("folder", PROGRAMS)
def test_programs_are_what_they_were(folder: str):
    kept = {p.name: p.read_bytes() for p in (FOLDER / folder).iterdir()}
    assert kept.keys() == PROGRAMS[folder].keys()
    for name, data in kept.items():
        assert PROGRAMS[folder][name].decode("ascii") == data.decode("ascii"), f"{folder}/{name}"


def test_every_kept_program_has_a_maker():
    assert {str(p.parent.relative_to(FOLDER)) for p in FOLDER.rglob("*.src")} == set(PROGRAMS)


@pytest.mark.parametrize("folder", PROGRAMS)
def test_kept_programs_are_without_a_finding(folder: str):
    kept = {p.name: p.read_bytes() for p in (FOLDER / folder).iterdir()}
    assert check_files(kept, folder.split("/", maxsplit=1)[0]) == []
    assert len(read_program(kept).path) > 10


@pytest.mark.parametrize("controller", ["krc2", "krc4", "krc5"])
def test_a_correction_leaves_the_motion_modules_as_they_are(controller: str):
    nominal = {p.name: p.read_bytes() for p in (FOLDER / controller / "inspection").iterdir()}
    corrected = {p.name: p.read_bytes() for p in (FOLDER / controller / "corrected").iterdir()}
    motion = {n for n, data in nominal.items() if b"LIN {" in data or b"SPL {" in data}
    assert motion
    assert {n: nominal[n] for n in motion} == {n: corrected[n] for n in motion}
    assert not (nominal.keys() & corrected.keys()) - motion
