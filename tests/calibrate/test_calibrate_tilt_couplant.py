"""Tilt-loss and couplant calibrations recover a hidden truth within what they claim."""

import numpy as np
import pytest

from alignment.calibrate import calibrate, calibrate_couplant, calibrate_tilt
from planner.couplant import water_speed_m_s
from planner.errors import EchoBaseError
from planner.setup import Couplant, Setup


def tilt_test(rng, k_b=2.0, k_c=1.0, zero=(0.3, -0.2), repeats=1, noise=0.02, floor=0.5):
    angle = np.arange(-4.0, 4.01, 0.5)
    b = np.r_[angle, 0 * angle].repeat(repeats)
    c = np.r_[0 * angle, angle].repeat(repeats)
    level = 50.0 * 10 ** (-(k_b * (b - zero[0]) ** 2 + k_c * (c - zero[1]) ** 2) / 20.0)
    return b, c, np.hypot(level, floor) * (1 + rng.normal(0, noise, b.shape))


def test_tilt_without_noise_is_exact() -> None:
    b, c, a = tilt_test(np.random.default_rng(0), 2.3, 0.7, noise=0.0, floor=0.0)
    found = calibrate_tilt(b, c, a)
    assert found.estimates["k_b"].value == pytest.approx(2.3, rel=1e-9)
    assert found.estimates["k_c"].value == pytest.approx(0.7, rel=1e-9)
    assert found.estimates["zero_b"].value == pytest.approx(0.3, abs=1e-9)
    assert found.estimates["zero_c"].value == pytest.approx(-0.2, abs=1e-9)
    assert found.patch == {"probe": {"tilt_loss_db_per_deg2": {"b": 2.3, "c": 0.7}}}
    Setup.model_validate(found.patch)


def test_tilt_claims_hold_over_simulated_truths() -> None:
    rng = np.random.default_rng(1)
    inside, runs = np.zeros(4), 400
    for _ in range(runs):
        k = rng.uniform(0.5, 3.0, 2)
        zero = rng.uniform(-0.5, 0.5, 2)
        b, c, a = tilt_test(rng, *k, zero, repeats=3, floor=0.0)
        found = calibrate_tilt(b, c, a).estimates
        names = ("k_b", "k_c", "zero_b", "zero_c")
        for i, (name, truth) in enumerate(zip(names, (*k, *zero), strict=True)):
            inside[i] += abs(found[name].value - truth) <= found[name].half_95
    # Three sigma of a share of 0.95 in 400 is 0.033.
    assert (inside / runs > 0.917).all(), inside / runs
    assert (inside / runs).mean() < 0.975, inside / runs


def test_the_noise_floor_and_outliers_are_left_out() -> None:
    rng = np.random.default_rng(2)
    b, c, a = tilt_test(rng, repeats=5)
    a[rng.random(len(a)) < 0.03] *= 0.6
    found = calibrate_tilt(b, c, a)
    assert found.estimates["k_b"].value == pytest.approx(2.0, abs=0.1)
    assert found.estimates["k_c"].value == pytest.approx(1.0, abs=0.05)
    assert found.curves["used"].sum() < len(found.curves["used"])


def test_an_axis_that_was_not_turned_is_held() -> None:
    b, c, a = tilt_test(np.random.default_rng(3))
    only_b = c == 0.0
    found = calibrate_tilt(b[only_b], c[only_b], a[only_b])
    assert found.estimates["k_b"].status == "measured"
    assert found.estimates["k_c"].status == "held"
    assert "c" not in found.patch["probe"]["tilt_loss_db_per_deg2"]
    assert [i.code for i in found.issues] == ["tilt-held"]


def test_no_tilt_loss_in_the_data_is_not_made_up() -> None:
    rng = np.random.default_rng(4)
    b, c, _ = tilt_test(rng)
    found = calibrate_tilt(b, c, 50.0 * (1 + rng.normal(0, 0.3, b.shape)))
    assert not found.observable or found.estimates["k_b"].status != "measured"
    with pytest.raises(EchoBaseError, match="too few"):
        calibrate_tilt(b[:4], c[:4], np.full(4, 50.0))


def echoes(rng, speed=1463.0, delay=0.8, noise=0.01, gaps=(10.0, 15.0, 20.0, 30.0), numbers=(1,), repeats=10):
    gap, number = (v.ravel() for v in np.meshgrid(gaps, numbers, indexing="ij"))
    gap, number = np.repeat(gap, repeats), np.repeat(number, repeats).astype(float)
    return gap, number, delay + number * 2e3 * gap / speed + rng.normal(0, noise, gap.shape)


def test_several_gaps_give_speed_and_delay() -> None:
    gap, number, tof = echoes(np.random.default_rng(5), noise=0.0)
    found = calibrate_couplant(tof, Couplant(), gap_mm=gap, echo=number)
    assert found.estimates["sound_speed"].value == pytest.approx(1463.0, rel=1e-9)
    assert found.estimates["delay"].value == pytest.approx(0.8, abs=1e-9)
    assert found.patch["couplant"] == {"sound_speed_m_s": 1463.0, "delay_us": 0.8}
    Setup.model_validate(found.patch)


def test_one_gap_needs_the_delay_and_a_repeat_echo_does_not() -> None:
    rng = np.random.default_rng(6)
    gap, number, tof = echoes(rng, gaps=(20.0,), noise=0.0)
    found = calibrate_couplant(tof, Couplant(delay_us=0.8), gap_mm=gap)
    assert found.estimates["sound_speed"].value == pytest.approx(1463.0, rel=1e-9)
    assert found.estimates["delay"].status == "held"
    assert "delay_us" not in found.patch["couplant"]
    gap, number, tof = echoes(rng, gaps=(20.0,), numbers=(1, 2), noise=0.0)
    found = calibrate_couplant(tof, Couplant(), gap_mm=gap, echo=number)
    assert found.estimates["sound_speed"].value == pytest.approx(1463.0, rel=1e-9)
    assert found.estimates["delay"].value == pytest.approx(0.8, abs=1e-9)


def test_steps_of_the_robot_give_the_speed_whatever_the_gap() -> None:
    gap, number, tof = echoes(np.random.default_rng(7), noise=0.0)
    found = calibrate_couplant(tof, Couplant(), step_mm=gap - 13.7)
    assert found.estimates["sound_speed"].value == pytest.approx(1463.0, rel=1e-9)
    assert found.estimates["delay"].status == "held"
    gap, number, tof = echoes(np.random.default_rng(7), numbers=(1, 2), noise=0.0)
    found = calibrate_couplant(tof, Couplant(), step_mm=gap - 13.7, echo=number)
    assert found.estimates["delay"].value == pytest.approx(0.8, abs=1e-8)


@pytest.mark.parametrize("numbers, gaps", [((1,), (10.0, 15.0, 25.0)), ((1, 2), (15.0,)), ((1, 2, 3), (12.0, 22.0))])
def test_couplant_claims_hold_over_simulated_truths(numbers, gaps) -> None:
    rng = np.random.default_rng(8)
    inside, runs = np.zeros(2), 400
    for _ in range(runs):
        speed, delay = rng.uniform(1400, 1560), rng.uniform(-1, 3)
        gap, number, tof = echoes(rng, speed, delay, gaps=gaps, numbers=numbers, repeats=5)
        found = calibrate_couplant(tof, Couplant(), gap_mm=gap, echo=number).estimates
        inside += [
            abs(found["sound_speed"].value - speed) <= found["sound_speed"].half_95,
            abs(found["delay"].value - delay) <= found["delay"].half_95,
        ]
    assert (inside / runs > 0.917).all(), inside / runs
    assert (inside / runs < 0.983).all(), inside / runs


def test_the_temperature_of_pure_water_is_told() -> None:
    speed = water_speed_m_s(23.5)
    gap, _number, tof = echoes(np.random.default_rng(9), speed=speed, noise=0.0)
    found = calibrate_couplant(tof, Couplant(), gap_mm=gap)
    assert any("23.5 deg C" in issue.message for issue in found.issues)


def test_what_shows_no_speed_is_said() -> None:
    tof = np.full(10, 20.0)
    with pytest.raises(EchoBaseError, match="do not differ"):
        calibrate_couplant(tof, Couplant(), step_mm=np.zeros(10))
    with pytest.raises(EchoBaseError, match="no couplant has"):
        calibrate_couplant(tof, Couplant(), gap_mm=np.full(10, 500.0))
    with pytest.raises(EchoBaseError, match="either"):
        calibrate_couplant(tof, Couplant())
    with pytest.raises(EchoBaseError, match="no usable"):
        calibrate_couplant(np.full(3, np.nan), Couplant(), gap_mm=np.ones(3))


def test_files_of_readings(tmp_path) -> None:
    b, c, a = tilt_test(np.random.default_rng(10), noise=0.0, floor=0.0)
    rows = [f"{x},{y},{z},note" for x, y, z in zip(b, c, a, strict=True)]
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    one.write_text("B_deg,c_deg,amplitude_pct,remark\n" + "\n".join(rows[:17]))
    two.write_text("b_deg,c_deg,amplitude_pct\n" + "\n".join(row.rsplit(",", 1)[0] for row in rows[17:]))
    found = calibrate("tilt", [one, two], Setup())
    assert found.estimates["k_b"].value == pytest.approx(2.0, rel=1e-9)
    assert found.to_json()["estimates"]["k_c"]["status"] == "measured"
    gap, _number, tof = echoes(np.random.default_rng(11), noise=0.0)
    three = tmp_path / "gap.csv"
    three.write_text("gap_mm,tof_us\n" + "\n".join(f"{g},{t:.9f}" for g, t in zip(gap, tof, strict=True)))
    assert calibrate("couplant", [three], Setup()).estimates["delay"].value == pytest.approx(0.8, abs=1e-6)


@pytest.mark.parametrize(
    "text, message",
    [
        ("b_deg,c_deg\n1,2\n", "amplitude_pct is missing"),
        ("b_deg,c_deg,amplitude_pct\n", "no readings"),
        ("", "file is empty"),
    ],
)
def test_wrong_files_name_what_is_wrong(tmp_path, text: str, message: str) -> None:
    path = tmp_path / "tilt.csv"
    path.write_text(text)
    with pytest.raises(EchoBaseError, match=message) as error:
        calibrate("tilt", [path], Setup())
    assert error.value.issues[0].where == "tilt.csv"
    path.write_text("b_deg,c_deg,amplitude_pct\n1,2,loud\n")
    with pytest.raises(EchoBaseError, match="row 2, column 'amplitude_pct': 'loud'"):
        calibrate("tilt", [path], Setup())


def test_a_table_cut_short_and_one_with_semicolons_are_named(tmp_path) -> None:
    path = tmp_path / "tilt.csv"
    for text, code in (
        ("b_deg,c_deg,amplitude_pct\n0,0,50\n1,0.", "csv-cut"),
        ("b_deg;c_deg;amplitude_pct\n0;0;50\n", "csv-separator"),
    ):
        path.write_text(text)
        with pytest.raises(EchoBaseError) as error:
            calibrate("tilt", [path], Setup())
        assert error.value.issues[0].code == code


def tilted(k_b=2.0, k_c=1.0, top=60.0):
    angle = np.linspace(-3.0, 3.0, 31)
    b, c = np.r_[angle, 0.0 * angle], np.r_[0.0 * angle, angle]
    return b, c, top * 10.0 ** (-(k_b * b**2 + k_c * c**2) / 20.0)


def test_a_receiver_that_clips_does_not_flatten_the_curve() -> None:
    b, c, amplitude = tilted(top=170.0)
    found = calibrate_tilt(b, c, np.minimum(amplitude, 100.0))
    assert found.estimates["k_b"].value == pytest.approx(2.0, abs=1e-3)
    assert found.estimates["k_c"].value == pytest.approx(1.0, abs=1e-3)
    assert [(i.severity, i.code) for i in found.issues] == [("warning", "tilt-clipped")]


def test_echoes_that_grow_with_tilt_and_angles_in_radians_are_named() -> None:
    b, c, amplitude = tilted(k_b=-0.3)
    found = calibrate_tilt(b, c, amplitude)
    assert found.estimates["k_b"].status == "held"
    assert "b" not in found.patch["probe"]["tilt_loss_db_per_deg2"]
    assert "grows" in found.issues[0].message
    b, c, amplitude = tilted()
    with pytest.raises(EchoBaseError, match="in degrees"):
        calibrate_tilt(np.radians(b), np.radians(c), amplitude)
    with pytest.raises(EchoBaseError, match="below 0"):
        calibrate_tilt(b, c, -amplitude)


@pytest.mark.parametrize(("factor", "word"), [(0.5, "one-way"), (2.0, "second echoes")])
def test_half_and_twice_the_speed_are_mistakes(factor, word) -> None:
    gap = np.arange(5.0, 40.0, 5.0)
    with pytest.raises(EchoBaseError, match=word):
        calibrate_couplant(factor * 2e3 * gap / 1482.0, Couplant(), gap_mm=gap)


def test_echo_numbers_are_whole() -> None:
    gap = np.arange(5.0, 40.0, 5.0)
    with pytest.raises(EchoBaseError, match=r"reading 1: 1\.5"):
        calibrate_couplant(2e3 * gap / 1482.0, Couplant(), gap_mm=gap, echo=np.full(7, 1.5))
