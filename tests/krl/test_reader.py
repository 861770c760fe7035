"""Programs of other people, read as a path."""

# ruff: noqa: E501 (KRL text stays in one piece)

import numpy as np
import pytest

from kuka_export.reader import read_program
from planner.errors import EchoBaseError
from planner.program_path import Motion
from tests.krl.positive import POSITIVE


def src(body: str, name: str = "JOB", **other: str) -> dict[str, bytes]:
    files = {
        f"{name}.src": f"DEF {name} ( )\n{body}END\n",
        **{k.replace("_dat", ".dat").replace("_src", ".src"): v for k, v in other.items()},
    }
    return {k: v.encode() for k, v in files.items()}


def pose(x: float) -> str:
    return f"{{X {x},Y 0,Z 0,A 0,B 0,C 0}}"


def test_lower_case_and_speed_and_frames():
    r = read_program({k: v.encode() for k, v in POSITIVE["lower-case-of-the-nineties"].items()})
    assert (r.base_number, r.tool_number, r.main) == (2, 1, "WELD7")
    np.testing.assert_array_equal(r.poses, [[500.5, 0, 812.25, -90, 0, 180], [500.5, 40, 812.25, -90, 0, 180]])
    assert set(r.path.speed_mm_s) == {300.0}
    assert r.homes == 2
    assert r.starts_at_home


def test_inline_forms_take_points_frames_and_speeds_from_the_data_list():
    r = read_program(
        {k: v.encode() for k, v in POSITIVE["inline-form-classic"].items() if True}
        | {"HOMES.dat": b"DEFDAT HOMES\nDECL FDAT FHOME={TOOL_NO 1,BASE_NO 1}\nENDDAT\n"}
    )
    np.testing.assert_array_equal(r.poses, [[701.5, -20.25, 333.0, 90.0, 0.5, 179.5]])
    assert r.path.speed_mm_s[0] == 250.0


def test_components_left_out_keep_their_value():
    r = read_program(src(f"BAS (#BASE,1)\nLIN {pose(1)}\nLIN {{Z 5}}\nLIN {{X 2,A 90}}\n"))
    np.testing.assert_array_equal(r.poses, [[1, 0, 0, 0, 0, 0], [1, 0, 5, 0, 0, 0], [2, 0, 5, 90, 0, 0]])


def test_components_in_any_order_with_any_blanks():
    r = read_program(src("LIN {c 3 , B 2,A 1,  z 30,Y 20,X -10.5}  ; note\n"))
    np.testing.assert_array_equal(r.poses, [[-10.5, 20, 30, 1, 2, 3]])


def test_arithmetic_variables_and_the_geometric_operator():
    body = f"DECL FRAME P\n$BASE = BASE_DATA[2] : {{X 1,Y 0,Z 0,A 90,B 0,C 0}} : {{X 10,Y 0,Z 0,A 0,B 0,C 0}}\nP = {pose(100)}\nP.Z = 2.0 * 3 - 1\nLIN P : {{X 0,Y 0,Z -7.5,A 0,B 0,C 0}}\n"
    r = read_program(src(body))
    np.testing.assert_allclose(r.poses, [[100, 0, -2.5, 0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(r.base_offset, [1, 10, 0, 90, 0, 0], atol=1e-12)
    assert r.T_world_base is None


def test_switching_points_of_every_kind():
    body = (
        f"LIN {pose(0)}\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[3]=TRUE\nLIN {pose(1)}\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[3]=FALSE\nLIN {pose(2)}\n"
        f"LIN {pose(3)}\nTRIGGER WHEN PATH=0 DELAY=0 DO $OUT[3]=TRUE\nLIN {pose(4)}\nLIN {pose(5)}\n"
        f"TRIGGER WHEN PATH=0 ONSTART DELAY=0 DO $OUT[3]=FALSE\nLIN {pose(6)}\n"
        f"TRIGGER WHEN PATH=0 ONSTART DELAY=0 DO $OUT[3]=TRUE\nSPLINE\nSPL {pose(7)}\nSPL {pose(8)}\nENDSPLINE\n"
        f"TRIGGER WHEN PATH=0 DELAY=0 DO $OUT[3]=FALSE\nSPLINE\nSPL {pose(9)}\nSPL {pose(10)}\nENDSPLINE\nLIN {pose(11)}\n"
    )
    r = read_program(src(body))
    assert r.path.data_on.astype(int).tolist() == [0, 1, 1, 0, 0, 1, 0, 1, 1, 1, 1, 0]
    assert r.exact_switching
    assert r.path.block.tolist() == [-1] * 7 + [0, 0, 1, 1, -1]
    assert (r.path.motion == Motion.SPL).tolist() == [False] * 7 + [True] * 4 + [False]


def test_plain_outputs_are_a_data_signal_too():
    r = read_program(
        src(f"LIN {pose(0)}\nCONTINUE\n$OUT[5]=TRUE\nLIN {pose(1)}\nLIN {pose(2)}\n$OUT[5]=FALSE\nLIN {pose(3)}\n")
    )
    assert r.path.data_on.tolist() == [False, True, True, False]
    assert (r.data_output, r.data_source) == (5, "assignment")


def test_a_delayed_trigger_is_read_but_not_called_exact():
    r = read_program(
        src(f"LIN {pose(0)}\nTRIGGER WHEN PATH=-3 DELAY=10 DO $OUT[3]=TRUE\nLIN {pose(1)}\nLIN {pose(2)}\n")
    )
    assert r.path.data_on.tolist() == [False, False, True]
    assert not r.exact_switching


def test_two_switched_outputs_are_not_guessed_between():
    body = f"TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[1]=TRUE\nTRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[2]=TRUE\nLIN {pose(0)}\nLIN {pose(1)}\n"
    r = read_program(src(body))
    assert not r.path.data_on.any()
    assert [i.code for i in r.issues] == ["krl-data-signal"]
    assert read_program(src(body), data_output=2).path.data_on.tolist() == [False, True]


def test_a_cascade_of_modules_and_passes_by_module():
    files = {k: v.encode() for k, v in POSITIVE["ext-lines-and-cascade"].items()}
    r = read_program(files)
    assert r.main == "TOP"
    assert r.calls == (("TOP", "TOP_1"),)
    assert r.path.pass_id.tolist() == [0, 0]


def test_the_base_in_world():
    r = read_program(
        src(
            f"BASE_DATA[4] = {{X 100,Y 0,Z 0,A 90,B 0,C 0}}\n$BASE = BASE_DATA[4] : {{X 10,Y 0,Z 0,A 0,B 0,C 0}}\nLIN {pose(1)}\n"
        )
    )
    np.testing.assert_allclose(r.T_world_base.xyzabc, [100, 10, 0, 90, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("body", "code"),
    [
        (f"IF $IN[1] THEN\nLIN {pose(0)}\nENDIF\n", "krl-not-straight"),
        (f"LOOP\nLIN {pose(0)}\nENDLOOP\n", "krl-not-straight"),
        (f"CIRC {pose(0)},{pose(1)}\n", "krl-unsupported-motion"),
        ("LIN XP9\n", "krl-unknown-value"),
        ("LIN {X 1}\n", "krl-incomplete-pose"),
        (f"$BASE=BASE_DATA[1]\nLIN {pose(0)}\n$BASE=BASE_DATA[2]\nLIN {pose(1)}\n", "krl-frames-change"),
        ("LIN {A1 0,A2 0,A3 0,A4 0,A5 0,A6 0}\n", "krl-target"),
        ("HALT\n", "krl-no-motion"),
        (f"LIN {pose(0)} C_DISS\n", "krl-approximation"),
        (f"AGAIN ( )\nEND\nDEF AGAIN ( )\nLIN {pose(0)}\nAGAIN ( )\n", "krl-recursion"),
    ],
)
def test_what_cannot_be_read_as_a_path_is_refused_with_its_line(body: str, code: str):
    with pytest.raises(EchoBaseError) as caught:
        read_program(src(body))
    assert caught.value.issues[0].code == code


def test_an_unknown_call_is_said():
    r = read_program(src(f"MYSTERY ( )\nLIN {pose(0)}\n"))
    assert [i.code for i in r.issues] == ["krl-undeclared"]
