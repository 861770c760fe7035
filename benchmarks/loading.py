"""How fast a scan loads: 1.6 million readings in nine columns, against the fastest CSV reader on the same file.

Run: python -m benchmarks.loading [readings]
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl

from alignment.point_cloud import point_cloud
from alignment.readers import read_scan
from planner.setup import Setup

LAWS = 50


def write_sample(path: Path, readings: int) -> None:
    """Write a scan of passes 100 mm long, every 2 mm, 50 laws."""
    poses = readings // LAWS
    random = np.random.default_rng(0)
    pose = np.arange(poses)
    x, y = 2.0 * (pose % 50), 22.5 * (pose // 50)
    columns = {"x_mm": x, "y_mm": y, "z_mm": 15.0 + 0.01 * random.standard_normal(poses)}
    columns |= {key: 0.1 * random.standard_normal(poses) for key in ("a_deg", "b_deg", "c_deg")}
    rows = {key: np.repeat(values, LAWS) for key, values in columns.items()}
    rows["law"] = np.tile(np.arange(1, LAWS + 1), poses)
    rows["tof_us"] = np.round(20.24 + 0.02 * random.standard_normal(poses * LAWS), 6)
    rows["amplitude_pct"] = np.round(50.0 + random.standard_normal(poses * LAWS), 3)
    pl.DataFrame(rows).write_csv(path)


def main(readings: int = 1_600_000) -> None:
    """Print times and ratio."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.csv"
        write_sample(path, readings)
        fastest, ours, cloud_s = [], [], []
        for _ in range(3):
            start = time.perf_counter()
            pl.read_csv(path)
            fastest.append(time.perf_counter() - start)
            start = time.perf_counter()
            scan = read_scan([path])
            ours.append(time.perf_counter() - start)
            start = time.perf_counter()
            point_cloud([scan], Setup())
            cloud_s.append(time.perf_counter() - start)
        print(f"{readings} readings, {path.stat().st_size / 1e6:.0f} MB")
        print(f"polars.read_csv            {min(fastest):6.2f} s")
        print(f"read_scan (sandboxed)      {min(ours):6.2f} s   ratio {min(ours) / min(fastest):.2f}")
        print(f"point_cloud                {min(cloud_s):6.2f} s")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:2]))
