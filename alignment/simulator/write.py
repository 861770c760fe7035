"""Readings CSV, as docs/scan-formats.md states it."""

from pathlib import Path

import numpy as np
import polars as pl

from alignment.readers.columns import BASE, POSE, SIMULATED
from alignment.scan import Scan

SLICE = 500_000


def write_readings_csv(scan: Scan, path: Path) -> None:
    """Write the readings of a scan, one row a firing; lost echoes have empty cells; the base only if the scan names one.

    The column `simulated` says what it is, wherever the file goes. Positions to 0.01 um, angles to 1e-7 deg, times of
    flight to 1 ps, amplitudes to 1e-3 %FSH: below any noise.
    """
    six = scan.Ts_scan_tcp.xyzabc
    six[:, :3], six[:, 3:] = np.round(six[:, :3], 5), np.round(six[:, 3:], 7)
    base = None if scan.T_world_scan is None else scan.T_world_scan.xyzabc
    with path.open("wb") as out:
        for begin in range(0, max(len(scan), 1), SLICE):
            rows = slice(begin, begin + SLICE)
            pose = six[scan.pose_index[rows]]
            columns: dict[str, object] = {} if scan.t_s is None else {"t_s": np.round(scan.t_s[rows], 6)}
            columns |= {key: pose[:, i] for i, key in enumerate(POSE)}
            columns["law"] = scan.law[rows]
            columns["tof_us"] = np.round(scan.tof_us[rows], 6)
            columns["amplitude_pct"] = np.round(scan.amplitude_pct[rows], 3)
            if scan.pass_id is not None:
                columns["pass"] = scan.pass_id[rows]
            columns[SIMULATED] = np.ones(len(pose), dtype=np.uint8)
            if base is not None:
                columns |= {key: np.full(len(pose), value) for key, value in zip(BASE, base, strict=True)}
            frame = pl.DataFrame(columns).with_columns(pl.col("tof_us", "amplitude_pct").fill_nan(None))
            frame.write_csv(out, include_header=begin == 0)
