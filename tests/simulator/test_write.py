"""The readings CSV: the same format as a real scan."""

import numpy as np

from alignment.readers import read_scan
from alignment.simulator import Noise, Truth, simulate, write_readings_csv
from planner.frames import Transform
from planner.setup import Setup
from tests.simulator.cells import NO_OFFSET, one_pass, plate


def test_what_is_written_is_read_back(tmp_path) -> None:
    part, surface = plate()
    base = Transform.from_xyzabc("world", "base", [800, 20, 300, 12, 3, -4])
    setup = Setup(base={"x_mm": 800, "y_mm": 20, "z_mm": 300, "a_deg": 12, "b_deg": 3, "c_deg": -4})
    for active in (None, base @ Transform.from_xyzabc("base", "basecorr", [1, 2, 3, 0.1, 0.2, 0.3])):
        path = one_pass([-80, 3, 20], [80, 3, 20])
        scan = simulate(part, surface, path, setup, Truth(NO_OFFSET), Noise(dropouts=0.1), 5, T_world_active=active)
        write_readings_csv(scan, tmp_path / "scan.csv")
        back = read_scan([tmp_path / "scan.csv"])
        assert len(back) == len(scan)
        np.testing.assert_allclose(back.tof_us, scan.tof_us, atol=6e-7)
        np.testing.assert_allclose(back.amplitude_pct, scan.amplitude_pct, atol=6e-4)
        np.testing.assert_array_equal(back.law, scan.law)
        np.testing.assert_array_equal(back.pose_index, scan.pose_index)
        np.testing.assert_array_equal(back.pass_id, scan.pass_id)
        np.testing.assert_allclose(back.Ts_scan_tcp.matrix, scan.Ts_scan_tcp.matrix, atol=2e-5)
        assert (back.T_world_scan is None) == (active is None)
        if active is not None:
            np.testing.assert_allclose(back.T_world_scan.matrix, active.matrix, atol=1e-9)


def test_same_seed_same_bytes(tmp_path) -> None:
    part, surface = plate()
    texts = []
    for name in ("a.csv", "b.csv"):
        scan = simulate(part, surface, one_pass([-80, 3, 20], [80, 3, 20]), Setup(), Truth(NO_OFFSET), Noise(), 5)
        write_readings_csv(scan, tmp_path / name)
        texts.append((tmp_path / name).read_bytes())
    assert texts[0] == texts[1]
    header = texts[0].split(b"\n", 1)[0].decode().split(",")
    assert set(header) >= {"x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "law", "tof_us", "amplitude_pct"}
