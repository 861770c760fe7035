"""Numbers and names as a controller takes them."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robodk.robomath import KUKA_2_Pose
from scipy.spatial.transform import Rotation

from kuka_export.comments import MAX_COMMENT, comment_text
from kuka_export.language.lexer import tokens
from kuka_export.language.vocabulary import KEYWORDS
from kuka_export.names import MAX_STEM, duplicates, legal_name, name_problem
from kuka_export.numbers import axes_text, frame_text, real_text, written_frames
from planner.frames import Transform

FRAME = re.compile(r"\{X -?\d+\.\d{3},Y -?\d+\.\d{3},Z -?\d+\.\d{3},A -?\d+\.\d{4},B -?\d+\.\d{4},C -?\d+\.\d{4}\}")
wide = st.floats(-1e4, 1e4)
angle = st.floats(-720.0, 720.0)


def numbers_of(text: str) -> np.ndarray:
    return np.array([float(v) for v in re.findall(r"-?\d+\.\d+", text)])


@given(st.tuples(wide, wide, wide, angle, st.floats(-90.0, 90.0), angle))
def test_a_frame_is_text_of_fixed_form_and_the_same_frame(values: tuple[float, ...]):
    text = frame_text(np.array(values))
    assert FRAME.fullmatch(text)
    assert "-0.000," not in text
    assert "-0.0000" not in text
    got = numbers_of(text)
    assert np.abs(got[:3] - values[:3]).max() <= 0.0005 + 1e-9
    turn = (got[3:] - values[3:] + 180.0) % 360.0 - 180.0
    assert np.abs(turn).max() <= 0.00005 + 1e-9
    assert (got[[3, 5]] > -180.0).all()
    assert (got[[3, 5]] <= 180.0).all()


def test_the_seam_at_180_and_negative_zero():
    assert (
        frame_text([-0.0004, 0.0, -0.0, -180.0, -0.00004, -179.99996])
        == "{X 0.000,Y 0.000,Z 0.000,A 180.0000,B 0.0000,C 180.0000}"
    )
    assert frame_text([0, 0, 0, 179.99996, 0, 540.0]) == "{X 0.000,Y 0.000,Z 0.000,A 180.0000,B 0.0000,C 180.0000}"
    assert (
        axes_text([-0.00001, 1, 2, 3, 4, -360.5]) == "{A1 0.0000,A2 1.0000,A3 2.0000,A4 3.0000,A5 4.0000,A6 -360.5000}"
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_refused(bad: float):
    with pytest.raises(ValueError, match="not a number"):
        frame_text([bad, 0, 0, 0, 0, 0])
    with pytest.raises(ValueError, match="not a number"):
        axes_text([0, 0, 0, 0, 0, bad])
    with pytest.raises(ValueError, match="not a number"):
        real_text(bad)


@given(st.floats(1e-5, 1e6))
def test_settings_never_carry_an_exponent(value: float):
    text = real_text(value)
    assert re.fullmatch(r"\d+\.\d{1,5}", text)
    assert float(text) == pytest.approx(value, abs=5.1e-6)


def test_abc_agree_with_another_library_on_ten_thousand_frames():
    rng = np.random.default_rng(5)
    rotations = Rotation.random(10_000, rng=rng)
    frames = Transform.from_parts("base", "tcp", rotations, rng.uniform(-2000, 2000, (10_000, 3)))
    written = written_frames(frames.xyzabc)
    theirs = np.array([np.array(KUKA_2_Pose(list(row)).Rows()) for row in written.tolist()])
    np.testing.assert_allclose(theirs[:, :3, 3], frames.xyz_mm, atol=5.01e-4)
    # Three angles rounded to 5e-5 deg turn a frame by at most their sum.
    off = (Rotation.from_matrix(theirs[:, :3, :3]) * rotations.inv()).magnitude()
    assert np.degrees(off).max() <= 1.5e-4


@given(st.text(max_size=60))
def test_any_text_becomes_a_legal_name(text: str):
    assert name_problem(legal_name(text), MAX_STEM) == ""


@pytest.mark.parametrize("word", sorted(KEYWORDS)[:40])
def test_words_of_the_language_are_no_names(word: str):
    assert name_problem(word) != ""


def test_names_are_compared_without_case():
    assert duplicates(["A", "B", "a"]) == ["A"]


@given(st.text(max_size=300))
def test_no_text_can_leave_its_comment(text: str):
    line = comment_text(text)
    assert line.isascii()
    assert line.isprintable() or line == ""
    assert not set(line) & set("\r\n;&%")
    assert len(line) <= MAX_COMMENT
    assert [t.kind for t in tokens(";" + line)] == ["end"]
    assert not re.search(r"(?i)\b(end)?fold", line)
    assert comment_text(line) == line


def test_text_is_spelled_in_ascii():
    assert comment_text("Flügel Nº 7 – 20 °C ± 1 µm; Prüfer: Žižka") == "Fluegel No 7 - 20 degC +- 1 um, Pruefer: Zizka"
