"""Settings: the paper's cell by default, unknown fields and absurd values refused, law geometry as DESIGN defines it."""

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from planner.couplant import distance_mm, sound_speed_m_s, tof_us, water_speed_m_s
from planner.probe import law_offsets_mm, law_origins_tcp, tool_axes
from planner.setup import Couplant, Probe, Setup, Tool


def test_defaults_are_the_papers_cell():
    setup = Setup()
    assert setup.probe.laws == 50
    assert setup.probe.swath_mm == pytest.approx(30.0)
    assert setup.standoff_mm == 15.0
    assert setup.robot == "kuka-kr16-l6-2"
    assert not setup.base.is_taught


def test_setup_round_trips_through_json():
    setup = Setup.model_validate({"probe": {"elements": 128, "pitch_mm": 0.5}, "base": {"x_mm": 900.0}})
    assert Setup.model_validate_json(setup.model_dump_json()) == setup
    assert setup.base.is_taught


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('{"standof_mm": 12}', "standof_mm"),
        ('{"probe": {"pitch": 0.6}}', "probe.pitch"),
        ('{"standoff_mm": -1}', "standoff_mm"),
        ('{"standoff_mm": NaN}', "standoff_mm"),
        ('{"probe": {"elements": 10, "aperture_elements": 15}}', "probe"),
        ('{"probe": {"elements": 1}}', ""),
        ('{"tool": {"beam_axis": "x"}}', "tool"),
        ('{"alignment": {"coverage": 25}}', "alignment.coverage"),
        ('{"alignment": {"lock": ["q"]}}', "alignment.lock.0"),
        ('{"controller": "krc3"}', "controller"),
        ('{"base": {"number": 33}}', "base.number"),
    ],
)
def test_bad_settings_are_refused_and_the_field_is_named(text, place):
    with pytest.raises(ValidationError) as caught:
        Setup.model_validate(json.loads(text))
    assert ".".join(str(p) for p in caught.value.errors()[0]["loc"]) == place


def test_single_crystal_sweeps_its_beam_width():
    setup = Setup.model_validate({"probe": {"elements": 1, "beam_width_mm": 2.5}, "inspection": {"step_mm": 2.0}})
    assert setup.probe.laws == 1
    assert setup.probe.swath_mm == 2.5
    np.testing.assert_array_equal(law_offsets_mm(setup.probe), [0.0])


def test_laws_are_centred_and_reversal_mirrors_them():
    x = law_offsets_mm(Probe())
    assert x[0] == pytest.approx(-14.7)
    assert x[-1] == pytest.approx(14.7)
    np.testing.assert_allclose(law_offsets_mm(Probe(reversed=True)), -x)
    origins = law_origins_tcp(Probe(face_offset_mm=4.0))
    np.testing.assert_allclose(origins[:, 2], -4.0)


# Marczak 1997, check values of the polynomial as published.
@pytest.mark.parametrize(
    ("celsius", "m_s"), [(10, 1447.289), (15, 1465.960), (20, 1482.380), (25, 1496.728), (30, 1509.167)]
)
def test_water_speed_of_marczak(celsius, m_s):
    assert water_speed_m_s(celsius) == pytest.approx(m_s, abs=5e-4)


def test_distance_and_time_of_flight_are_inverse_and_two_way():
    couplant = Couplant(sound_speed_m_s=1500.0, delay_us=3.0)
    assert distance_mm(23.0, couplant) == pytest.approx(15.0)
    assert tof_us(15.0, couplant) == pytest.approx(23.0)
    assert sound_speed_m_s(couplant) == 1500.0


@pytest.mark.parametrize(("beam", "array"), [("z", "x"), ("x", "y"), ("-z", "y"), ("x", "-z")])
def test_tool_axes_put_beam_and_array_where_the_cell_says(beam, array):
    sign = {"-": -1.0}

    def axis(name):
        return sign.get(name[0], 1.0) * np.eye(3)["xyz".index(name[-1])]

    T = tool_axes(Tool(beam_axis=beam, array_axis=array))
    np.testing.assert_allclose(T.directions([0, 0, 1.0]), axis(beam), atol=1e-12)
    np.testing.assert_allclose(T.directions([1.0, 0, 0]), axis(array), atol=1e-12)


def test_every_field_of_the_setup_is_described_in_the_docs():
    text = (Path(__file__).parents[2] / "docs" / "setup.md").read_text(encoding="utf-8")

    def names(schema, defs, prefix=""):
        for name, field in schema.get("properties", {}).items():
            ref = field.get("$ref") or (field.get("allOf") or [{}])[0].get("$ref")
            if ref:
                yield from names(defs[ref.rsplit("/", 1)[1]], defs, f"{prefix}{name}.")
            else:
                yield f"{prefix}{name}"

    schema = Setup.model_json_schema()
    axes = {"x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"}
    fields = [n for n in names(schema, schema["$defs"]) if n.rsplit(".", 1)[-1] not in axes]
    missing = [n for n in fields if n.rsplit(".", 1)[-1] not in text]
    assert len(fields) > 50
    assert missing == []
