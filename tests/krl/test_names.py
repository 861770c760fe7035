"""Names of programs: legal whatever the file is called, and different for different parts and surfaces."""

import pytest
from pydantic import ValidationError

from kuka_export.names import MAX_CHOSEN, MAX_NAME, MAX_STEM, name_problem, program_stem
from planner.setup import Setup

LONGEST_ENDINGS = ("", "_001", "_999", "_A", "_A_BASE", "_C", "_C_BASE", "_A_001", "_C_L12")


@pytest.mark.parametrize(
    "part", ["flat-plate", "", "Fl\u00fcgel 7", "\u7ffc", "..", "if", "DEF", "a" * 300, "9_lives", "1.5x0.5"]
)
@pytest.mark.parametrize("ending", ["AL", "IN"])
def test_every_module_name_is_legal(part: str, ending: str) -> None:
    for chosen in (None, "X", "WING_LEFT_TOP"):
        stem = program_stem(part, ending, "any key", chosen)
        assert stem.endswith(f"_{ending}")
        assert name_problem(stem, MAX_STEM) == ""
        for more in LONGEST_ENDINGS:
            assert name_problem(stem + more, MAX_NAME) == ""


def test_the_key_tells_programs_apart_and_nothing_else_does() -> None:
    assert program_stem("wing", "IN", "k") == program_stem("wing", "IN", "k")
    names = {program_stem("wing panel left", "IN", f"sha {i}") for i in range(300)}
    assert len(names) == 300
    # Parts whose names begin alike were called alike.
    assert program_stem("bracket-left", "IN", "one") != program_stem("bracket-lefthand", "IN", "two")
    assert program_stem("flat-plate", "AL", "k")[:9] == "EB_FLATP_"
    assert program_stem("flat-plate", "AL", "k")[:-3] == program_stem("flat-plate", "IN", "k")[:-3]


def test_the_setup_takes_legal_names_only() -> None:
    assert Setup().program_name is None
    assert Setup(program_name="W" * MAX_CHOSEN).program_name == "W" * MAX_CHOSEN
    for bad in ("W" * (MAX_CHOSEN + 1), "", "wing", "2WING", "WING-1", "WING 1", "W\n"):
        with pytest.raises(ValidationError):
            Setup(program_name=bad)
