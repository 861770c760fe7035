"""A setting that is no number is refused, not read as one; a name that stands twice, too."""

import pytest

from app.inputs import read_setup, setup_from
from planner.errors import EchoBaseError
from planner.setup import Setup


@pytest.mark.parametrize(
    ("data", "word"),
    [
        ({"standoff_mm": True}, "standoff_mm (it is true): a number"),
        ({"standoff_mm": "15"}, 'standoff_mm (it is "15")'),
        ({"probe": {"elements": "64"}}, 'probe.elements (it is "64")'),
        ({"inspection": {"step_mm": False}}, "inspection.step_mm (it is false)"),
        ({"base": None}, "an object with its fields"),
        ([15], "an object with its fields"),
    ],
)
def test_what_is_no_number_is_refused_by_name(data, word):
    with pytest.raises(EchoBaseError) as error:
        setup_from(data)
    assert word in error.value.issues[0].message


def test_switches_and_words_stay_what_they_are():
    setup = setup_from({"probe": {"reversed": True}, "controller": "krc5", "inspection": {"step_mm": None}})
    assert setup.probe.reversed is True
    assert setup.controller == "krc5"
    assert setup_from(setup.model_dump(mode="json")) == setup
    assert Setup.model_validate_json(setup.model_dump_json()) == setup


def test_a_name_that_stands_twice_is_named(tmp_path):
    path = tmp_path / "setup.json"
    path.write_text('{"standoff_mm": 15, "probe": {"pitch_mm": 1, "elements": 8, "pitch_mm": 2}}')
    with pytest.raises(EchoBaseError, match="'pitch_mm' stands twice"):
        read_setup(path)
