"""Noise, latency and sweep skew as stated: measured from the readings."""

import numpy as np
import pytest

from alignment.simulator import Noise, Truth, simulate
from alignment.simulator.disturb import wander
from planner.couplant import water_speed_m_s
from planner.setup import Setup
from tests.simulator.cells import NO_OFFSET, looking_down, one_pass, plate, program, sheet

SETUP = Setup()
C = water_speed_m_s(20.0) * 1e-3
LONG = plate(4000.0, 100.0, 10.0)
PASS = one_pass([-1950, 0, 20], [1950, 0, 20])


def heights(noise: Noise, seed: int = 3, setup: Setup = SETUP) -> np.ndarray:
    part, surface = LONG
    scan = simulate(part, surface, PASS, setup, Truth(NO_OFFSET), noise, seed)
    return scan.tof_us.reshape(-1, setup.probe.laws) * C / 2


def test_pose_noise_has_its_deviation_and_its_correlation_length() -> None:
    s = np.arange(200_000) * 2.0
    noise = wander(s, [slice(0, 120_000), slice(120_000, 200_000)], 10.0, 6, np.random.default_rng(0))
    np.testing.assert_allclose(noise.std(axis=0), 1.0, atol=0.02)
    for lag in (1, 5, 10):
        found = np.mean(noise[lag:] * noise[:-lag], axis=0)
        np.testing.assert_allclose(found, np.exp(-lag * 2.0 / 10.0), atol=0.03)
    assert np.abs(np.corrcoef(noise.T) - np.eye(6)).max() < 0.03


def test_pose_noise_shows_in_the_height_and_the_tilt_of_a_sweep() -> None:
    d = heights(Noise(pose_mm=0.03, pose_deg=0.005, tof_mm=0.0, amplitude=0.0))
    assert d.mean(axis=1).std() == pytest.approx(0.03, rel=0.12)
    # Slope along the array = turn of the TCP about its y.
    slope = (d[:, -1] - d[:, 0]) / (49 * 0.6)
    assert np.degrees(slope.std()) == pytest.approx(0.005, rel=0.12)


def test_the_recorded_pose_is_the_commanded_one() -> None:
    part, surface = LONG
    scan = simulate(part, surface, PASS, SETUP, Truth(NO_OFFSET), Noise(pose_mm=1.0), 0)
    np.testing.assert_allclose(scan.Ts_scan_tcp.xyz_mm[:, 1:], np.tile([0.0, 20.0], (len(scan.Ts_scan_tcp), 1)))


def test_time_and_amplitude_noise() -> None:
    part, surface = LONG
    noise = Noise(pose_mm=0.0, pose_deg=0.0, tof_mm=0.01, amplitude=0.02)
    scan = simulate(part, surface, PASS, SETUP, Truth(NO_OFFSET), noise, 1)
    d = scan.tof_us * C / 2
    assert d.std() == pytest.approx(0.01, rel=0.02)
    assert d.mean() == pytest.approx(15.0, abs=2e-4)
    assert scan.amplitude_pct.std() / 50.0 == pytest.approx(0.02, rel=0.02)


def test_dropouts_and_outliers_come_in_their_share() -> None:
    part, surface = LONG
    noise = Noise(dropouts=0.2, outliers=0.1)
    scan = simulate(part, surface, PASS, SETUP, Truth(NO_OFFSET), noise, 1)
    d = scan.tof_us * C / 2
    wrong = np.isfinite(d) & (np.abs(d - 15.0) > 0.5)
    # 9 % of 0.2 to 2 times the distance lies within 0.5 mm of it by chance, less 1 mm / 27 mm.
    assert wrong.mean() == pytest.approx(0.1 * (1 - 1.0 / 27.0), abs=0.004)
    assert np.isnan(d).mean() == pytest.approx(0.2 * 0.9, abs=0.004)
    assert np.nanmin(d) > 2.9
    assert np.nanmax(d) < 30.1


def test_switching_one_cause_on_leaves_the_others_as_they_were() -> None:
    plain = heights(Noise())
    dropped = heights(Noise(dropouts=0.2))
    heard = np.isfinite(dropped)
    np.testing.assert_array_equal(dropped[heard], plain[heard])


def test_same_seed_same_bits_other_seed_other_bits() -> None:
    np.testing.assert_array_equal(heights(Noise(outliers=0.05), seed=7), heights(Noise(outliers=0.05), seed=7))
    assert not np.array_equal(heights(Noise(), seed=7), heights(Noise(), seed=8))


def ramp():
    """A plane that rises 1 mm in 10 along x."""
    return sheet(lambda u, v: np.stack([u, v, 0.1 * u], axis=1), 3, 3, (-300.0, 300.0), (-100.0, 100.0))


def level_pass(setup: Setup, noise: Noise, backwards: bool = False):
    part, surface = ramp()
    xyz = np.array([[-40.0, 0, 20], [40.0, 0, 20]])[:: -1 if backwards else 1]
    path = program(looking_down(xyz, np.array([1.0, 0, 0])), [False, True], speed_mm_s=100.0)
    scan = simulate(part, surface, path, setup, Truth(NO_OFFSET), noise)
    laws = setup.probe.laws
    return scan.Ts_scan_tcp.xyz_mm[:, 0], scan.tof_us.reshape(-1, laws) * C / 2


def test_latency_shifts_the_echo_along_the_travel() -> None:
    noise = Noise(pose_mm=0, pose_deg=0, tof_mm=0, amplitude=0, latency_ms=12.0, lost_deg=30.0)
    for backwards in (False, True):
        x, d = level_pass(SETUP, noise, backwards)
        inner = np.abs(x) < 35
        # Fired 12 ms after the pose, at 100 mm/s: 1.2 mm further along the travel.
        true_x = x[inner] + (-1.2 if backwards else 1.2)
        expected = (20.0 - 0.1 * true_x) / np.sqrt(1.01)
        np.testing.assert_allclose(d[inner].mean(axis=1), expected, atol=1e-7)


def test_a_sweep_fires_its_laws_one_after_the_other() -> None:
    noise = Noise(pose_mm=0, pose_deg=0, tof_mm=0, amplitude=0, prf_hz=5000.0, lost_deg=30.0)
    x, d = level_pass(SETUP, noise)
    inner = np.abs(x) < 35
    true_x = x[inner, None] + 100.0 * np.arange(50) / 5000.0
    np.testing.assert_allclose(d[inner], (20.0 - 0.1 * true_x) / np.sqrt(1.01), atol=1e-7)
