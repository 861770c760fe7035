"""Curves and report of a calibration: drawn from what was found, self-contained, and true to the readings."""

import hashlib
import json
import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from alignment.calibrate import calibrate_couplant, calibrate_tcp, calibrate_tilt
from app.report.calibration import calibration_report, changes
from planner.setup import Couplant, Setup
from tests.calibrate.test_calibrate_tcp import SHIFT, TURN, record, tool_setup
from tests.calibrate.test_calibrate_tilt_couplant import tilt_test
from tests.loop.chain import echobase

SVG = "{http://www.w3.org/2000/svg}"


def test_the_tilt_curve_is_the_truth_where_nothing_disturbs_it() -> None:
    # A raster of both angles, not a cross: the other axis has to be taken out of every reading.
    b, c = (v.ravel() for v in np.meshgrid(np.linspace(-1.5, 1.5, 9), np.linspace(-1.2, 1.8, 9)))
    amplitude = 50.0 * 10 ** (-(2.0 * (b - 0.3) ** 2 + 0.9 * (c - 0.4) ** 2) / 20.0)
    curves = calibrate_tilt(b, c, amplitude).curves
    for axis, k, zero in (("b", 2.0, 0.3), ("c", 0.9, 0.4)):
        assert np.allclose(curves[f"{axis}_seen_db"], -k * (curves[f"{axis}_deg"] - zero) ** 2, atol=1e-9)
        assert np.allclose(curves[f"{axis}_fit_db"], -k * (curves[f"{axis}_fit_deg"] - zero) ** 2, atol=1e-9)


def test_the_band_holds_the_true_level_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    runs, inside = 400, []
    for _ in range(runs):
        b, c, amplitude = tilt_test(rng, 2.0, 1.0, (0.2, -0.1), repeats=2, floor=0.0)
        found = calibrate_tilt(b, c, amplitude)
        curves, at = found.curves, found.curves["b_fit_deg"]
        # The curve is over its own peak; the first used reading tells where that lies.
        i = int(np.flatnonzero(curves["used"])[0])
        row = (np.round(b, 4) == curves["b_deg"][i]) & (np.round(c, 4) == curves["c_deg"][i])
        level = np.mean(20.0 * np.log10(amplitude[row]))
        peak = level - curves["level_db"][i] + found.estimates["k_b"].value * found.estimates["zero_b"].value ** 2
        truth = 20.0 * np.log10(50.0) - 1.0 * 0.1**2 - 2.0 * (at - 0.2) ** 2
        inside.append(np.abs(curves["b_fit_db"] + peak - truth) <= curves["b_fit_half_db"])
    share = np.mean(inside, axis=0)
    # Three sigma of a share of 0.95 in 400 is 0.033.
    assert share.min() > 0.917
    assert share.mean() < 0.975


def test_couplant_curves_are_the_readings() -> None:
    gap, echo = np.repeat([5.0, 12.0, 20.0], 2), np.tile([1.0, 2.0], 3)
    tof = 0.4 + 2e3 * echo * gap / 1480.0 + np.array([1, -1, 2, -2, 1, -1]) * 1e-3
    curves = calibrate_couplant(tof, Couplant(), gap, None, echo).curves
    assert np.allclose(curves["expected_us"] + curves["residual_us"], tof, atol=1e-12)
    assert np.array_equal(curves["gap_mm"], gap)
    # One gap: the delay of the setup stays, and the drawing still shows what was recorded.
    one = calibrate_couplant(tof[:1], Couplant(delay_us=0.4), gap[:1]).curves
    assert np.allclose(one["expected_us"] + one["residual_us"], tof[:1], atol=1e-12)
    steps = calibrate_couplant(tof, Couplant(), None, gap, echo).curves
    assert "gap_mm" not in steps
    assert np.array_equal(steps["step_mm"], gap)


def test_tcp_residuals_belong_to_their_poses_and_passes() -> None:
    setup = tool_setup()
    scan = record(setup, TURN, SHIFT, np.random.default_rng(2), pose_mm=0.0, law_mm=0.0)
    tof = scan.tof_us.copy()
    pose = 37
    tof[scan.pose_index == pose] += 1.0  # 0.74 mm: a pose that saw something else
    tof[scan.pose_index == 5] = np.nan
    passes = (scan.pose_index // 25).astype(np.int32)
    found = calibrate_tcp(replace(scan, tof_us=tof, pass_id=passes), setup)
    curves = found.curves
    assert 5 not in curves["pose"]
    assert curves["pass_start"].tolist() == [25.0, 50.0, 75.0]
    worst = curves["pose"][np.nanargmax(np.abs(curves["residual_mm"]))]
    assert worst == pose
    used = curves["used_mm"] > 0.5
    assert curves["pose"][~used].tolist() == [pose]
    assert found.residual_rms == pytest.approx(float(np.sqrt(np.mean(curves["residual_mm"][used] ** 2))), rel=1e-9)


@pytest.mark.parametrize("kind", ["tilt", "tilt, one axis", "couplant", "tcp"])
def test_a_report_holds_its_numbers_and_its_drawing(kind) -> None:
    rng = np.random.default_rng(3)
    setup = tool_setup() if kind == "tcp" else Setup()
    if kind.startswith("tilt"):
        b, c, a = tilt_test(rng)
        keep = slice(0, len(b) // 2 if "one" in kind else None)
        found = calibrate_tilt(b[keep], c[keep], a[keep])
    elif kind == "couplant":
        gap = np.arange(5.0, 31.0, 5.0)
        found = calibrate_couplant(0.4 + 2e3 * gap / 1480.0 + rng.normal(0, 0.005, 6), setup.couplant, gap)
    else:
        found = calibrate_tcp(record(setup, TURN, SHIFT, rng, amplitude=False), setup)
    report = calibration_report(found, setup, [("readings.csv", "ab" * 32)])
    page = report.html().decode()
    for field, before, after in changes(found.patch, setup):
        assert field in page
        assert f"{after:.10g}" in page
        assert before != after
    for estimate in found.estimates.values():
        assert estimate.status in page
    assert all(issue.message in page for issue in found.issues)
    assert "ab" * 32 in page
    assert "SIMULATED" not in page
    # Nothing is fetched and nothing runs.
    assert not re.search(r"<script|\b(?:src|href)=[\"'](?!data:|#)", page)
    drawn = ET.fromstring(report.figures[found.kind])
    assert drawn.tag == f"{SVG}svg"
    words = " ".join("".join(t.itertext()) for t in drawn.iter(f"{SVG}text"))
    said = {"tilt": "tilt about B (deg)", "couplant": "gap (mm)", "tcp": "pose, in the order recorded"}[found.kind]
    assert said in words
    assert ("not turned" in words) == ("one" in kind)
    assert report.figures[found.kind] == calibration_report(found, setup, []).figures[found.kind]
    assert report.pdf().startswith(b"%PDF")


def test_many_readings_do_not_swell_the_page() -> None:
    setup = tool_setup()
    found = calibrate_tcp(record(setup, TURN, SHIFT, np.random.default_rng(1)), setup)
    n = 60_000
    rng = np.random.default_rng(0)
    off = rng.normal(0, 0.02, n)
    off[::1000] = 5.0
    curves = {
        "pose": np.repeat(np.arange(n / 50), 50),
        "pass_start": np.zeros(0),
        "residual_mm": off,
        "used_mm": (off < 1.0).astype(float),
    }
    page = calibration_report(replace(found, curves=curves), setup, []).html()
    assert len(page) < 1_500_000


def test_simulated_readings_are_marked() -> None:
    setup = tool_setup()
    found = calibrate_tcp(record(setup, TURN, SHIFT, np.random.default_rng(1)), setup)
    assert b"SIMULATED" in calibration_report(replace(found, simulated=True), setup, []).html()


def test_the_command_writes_the_report(tmp_path, capsys) -> None:
    b, c, a = tilt_test(np.random.default_rng(3))
    file = tmp_path / "tilt <b>.csv"
    rows = np.column_stack([b, c, a])
    np.savetxt(file, rows, delimiter=",", header="b_deg,c_deg,amplitude_pct", comments="")
    assert echobase("calibrate", "tilt", file, "--report", tmp_path / "out" / "calibration.html", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert "figure_svg" not in said
    page = (tmp_path / "out" / "calibration.html").read_text()
    assert hashlib.sha256(file.read_bytes()).hexdigest() in page
    assert "tilt &lt;b&gt;.csv" in page
    assert f"{said['estimates']['k_b']['value']:.2f}" in page


def test_a_sphere_is_for_the_tcp_only(tmp_path, capsys) -> None:
    file = tmp_path / "couplant.csv"
    file.write_text("tof_us,gap_mm\n20,15\n")
    for more in (("--target", "sphere"), ("--radius-mm", "20")):
        assert echobase("calibrate", "couplant", file, *more) == 1
        assert "calibrates the TCP only" in capsys.readouterr().err


def test_before_and_after_name_the_fields() -> None:
    setup = Setup(tool={"tcp": {"z_mm": 150.0}})
    patch = {"tool": {"tcp": {"z_mm": 151.5, "a_deg": 1.0}}, "couplant": {"sound_speed_m_s": 1480.0}}
    assert changes(patch, setup) == [
        ("tool.tcp.z_mm", 150.0, 151.5),
        ("tool.tcp.a_deg", 0.0, 1.0),
        ("couplant.sound_speed_m_s", None, 1480.0),
    ]
