"""A sphere recorded in many passes of many poses: no pass borrows another's error, and none is counted pose by pose."""

import numpy as np
import pytest

from alignment.calibrate import calibrate_tcp_sphere
from alignment.calibrate.pose_noise import Sums, correlation
from alignment.calibrate.stations import Stations, runs, stations, stretches
from tests.calibrate.sphere_cell import record
from tests.calibrate.test_calibrate_tcp import tool_setup


def test_no_station_holds_poses_of_two_passes() -> None:
    scan = record(
        tool_setup(), [0, 0, 0], [0, 0, 0], np.random.default_rng(1), standoffs=(12, 15, 18, 21), yaws=(0, 90, 180, 270),
        half_mm=4.0, step_mm=0.5,
    )  # fmt: skip
    passes = np.repeat(np.arange(5 * 4 * 4), 17)
    Ts = scan.Ts_scan_tcp
    few, many = stations(Ts.rotation_matrix, Ts.xyz_mm)
    for found in (few.of_pose, many.of_pose, stretches(Ts.rotation_matrix, Ts.xyz_mm)):
        for station in np.unique(found):
            assert len(np.unique(passes[found == station])) == 1
    assert len(few) <= 160 < len(many)
    assert (runs(Ts.rotation_matrix, Ts.xyz_mm)[0] == passes).all()


@pytest.mark.parametrize("metric", ["path", "passes", "space"])
def test_sums_are_those_of_the_whole_covariance(metric: str) -> None:
    rng = np.random.default_rng(2)
    s, n, p = 7, 40, 4
    at_mm = np.cumsum(rng.uniform(1.0, 6.0, s))
    way = np.abs(at_mm[:, None] - at_mm)
    run = np.array([0, 0, 0, 1, 1, 1, 1])
    apart = {"path": way, "passes": np.where(run[:, None] == run, way, 1e6), "space": way}
    next_mm = {k: np.diagonal(apart[k], 1) for k in ("path", "passes")}
    at = Stations(np.arange(s), apart, next_mm)
    pose, z, j = rng.integers(0, s, n), rng.normal(size=(n, 3)), rng.normal(size=(n, p + 1))
    k = correlation(at, metric, 9.0)
    normal, errors, log_det = Sums({"distance": (pose, z, j)}, at).solve({"distance": 0.02}, 0.05, k)
    mixing = np.zeros((n, 3 * s))
    for axis in range(3):
        mixing[np.arange(n), 3 * pose + axis] = z[:, axis]
    robot = 0.05**2 * np.kron(np.exp(-apart[metric] / 9.0), np.eye(3))
    whole = mixing @ robot @ mixing.T + 0.02**2 * np.eye(n)
    np.testing.assert_allclose(normal, j.T @ np.linalg.solve(whole, j), rtol=1e-6)
    np.testing.assert_allclose(errors, robot @ mixing.T @ np.linalg.solve(whole, j), rtol=1e-5, atol=1e-9)
    # 3 log |K| is what `log_det` leaves to the correlation.
    assert log_det + 3.0 * k.log_det == pytest.approx(np.linalg.slogdet(whole)[1], abs=1e-5)


@pytest.mark.slow
def test_claims_hold_over_many_passes() -> None:
    setup = tool_setup()
    rng = np.random.default_rng(8)
    off = []
    for _ in range(5):
        turn, shift = rng.normal(0, 0.7, 3), rng.normal(0, 1.0, 3)
        scan = record(
            setup, turn, shift, rng, cone_deg=30.0, yaws=(0, 90, 180, 270), standoffs=(12, 14, 16, 18, 20, 22),
            half_mm=4.0, step_mm=0.5,
        )  # fmt: skip
        found = calibrate_tcp_sphere(scan, setup, 20.0).estimates
        truth = zip("cbaxyz", [*turn, *shift], strict=True)
        off += [(found[axis].value - value) / found[axis].sigma for axis, value in truth]
    # Mean square of 30: 1 with a deviation of 0.26; where stations spanned passes it was 3.1.
    assert 0.3 < np.mean(np.square(off)) < 1.9
