"""The same readings from CSV, gzipped CSV, Parquet and HDF5."""

import gzip
import hashlib

import h5py
import numpy as np
import polars as pl
import pytest

from alignment.readers import read_scan
from alignment.scan import Scan
from planner.frames import Transform
from tests.scan.files import LAWS, POSE, columns, write_csv

BASE = {
    "base_x_mm": 800.0,
    "base_y_mm": 1.5,
    "base_z_mm": 300.0,
    "base_a_deg": 10.0,
    "base_b_deg": 0.0,
    "base_c_deg": -2.0,
}


def check(scan: Scan, poses: int = 6) -> None:
    rows = columns(poses)
    six = np.stack([rows[key] for key in POSE], axis=1)
    expected = Transform.from_xyzabc("scan", "tcp", six)
    np.testing.assert_allclose(scan.Ts_scan_tcp.matrix[scan.pose_index], expected.matrix, atol=1e-12)
    assert len(scan.Ts_scan_tcp) == poses
    np.testing.assert_array_equal(scan.law, rows["law"])
    np.testing.assert_array_equal(scan.tof_us, rows["tof_us"])
    np.testing.assert_array_equal(scan.amplitude_pct, rows["amplitude_pct"])


def test_csv_in_any_column_order_with_extra_columns(tmp_path) -> None:
    rows = columns()
    shuffled = {
        "operator": np.full(24, "Kim"),
        **{key: rows[key] for key in reversed(rows)},
        "gain_db": np.full(24, 12.0),
    }
    path = write_csv(tmp_path / "scan.csv", shuffled)
    scan = read_scan([path])
    check(scan)
    assert scan.T_world_scan is None
    assert scan.t_s is None
    assert scan.pass_id is None
    assert scan.name == "scan.csv"
    assert scan.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    (info,) = scan.issues
    assert info.severity == "info"
    assert "operator" in info.message
    assert "gain_db" in info.message


def test_compressed_csv_and_names_of_uploads(tmp_path) -> None:
    text = write_csv(tmp_path / "scan.csv", columns()).read_bytes()
    stored = tmp_path / "0f3a"
    stored.write_bytes(gzip.compress(text))
    check(read_scan([stored], names=["monday.csv.gz"]))
    check(read_scan([stored], names=["no suffix"]))


def test_header_with_blanks_byte_order_mark_comments_and_dos_lines(tmp_path) -> None:
    text = write_csv(tmp_path / "scan.csv", columns()).read_text()
    head, body = text.split("\n", 1)
    odd = "\ufeff# scanner 7\r\n" + " " + head.replace(",", ", ").upper() + "\r\n" + body.replace("\n", "\r\n")
    (tmp_path / "odd.csv").write_bytes(odd.encode())
    check(read_scan([tmp_path / "odd.csv"]))
    lines = text.splitlines()
    lines.insert(9, "# pause")
    (tmp_path / "pause.csv").write_text("\n".join(lines))
    check(read_scan([tmp_path / "pause.csv"]))


def test_nan_written_as_text_is_a_lost_echo(tmp_path) -> None:
    rows = {key: values.astype(str) for key, values in columns().items()}
    assert rows["tof_us"][5] == "nan"
    check(read_scan([write_csv(tmp_path / "scan.csv", rows)]))


def test_optional_time_pass_and_base(tmp_path) -> None:
    n = 6 * LAWS
    extra = {"t_s": 0.1 * np.arange(n), "pass": np.repeat([3, 4], n // 2)} | {k: np.full(n, v) for k, v in BASE.items()}
    scan = read_scan([write_csv(tmp_path / "scan.csv", columns() | extra)])
    check(scan)
    np.testing.assert_array_equal(scan.t_s, extra["t_s"])
    np.testing.assert_array_equal(scan.pass_id, extra["pass"])
    np.testing.assert_allclose(scan.T_world_scan.xyzabc, list(BASE.values()), atol=1e-12)
    assert (scan.T_world_scan.dst, scan.T_world_scan.src) == ("world", "scan")


def test_parquet(tmp_path) -> None:
    pl.DataFrame(columns() | {k: np.full(24, v) for k, v in BASE.items()}).write_parquet(tmp_path / "scan.parquet")
    scan = read_scan([tmp_path / "scan.parquet"])
    check(scan)
    np.testing.assert_allclose(scan.T_world_scan.xyzabc, list(BASE.values()), atol=1e-12)


@pytest.mark.parametrize("group", ["/", "scan 1"])
def test_hdf5(tmp_path, group) -> None:
    rows = columns()
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        place = file.require_group(group)
        place["poses"] = np.stack([rows[key] for key in POSE], axis=1)[::LAWS]
        place["tof_us"] = rows["tof_us"].reshape(-1, LAWS)
        place["amplitude_pct"] = rows["amplitude_pct"].reshape(-1, LAWS)
        place["pass"] = np.array([0, 0, 0, 1, 1, 1])
        place.attrs.update(BASE)
    scan = read_scan([tmp_path / "scan.h5"])
    check(scan)
    np.testing.assert_array_equal(scan.pass_id, np.repeat([0, 0, 0, 1, 1, 1], LAWS))
    np.testing.assert_allclose(scan.T_world_scan.xyzabc, list(BASE.values()), atol=1e-12)
