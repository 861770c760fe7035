"""Small scans as text and arrays, for reader tests."""

from pathlib import Path

import numpy as np
import polars as pl

POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
LAWS = 4


def columns(poses: int = 6) -> dict[str, np.ndarray]:
    """Readings of `poses` poses, four laws each, one echo lost."""
    k = np.arange(poses, dtype=float)
    six = {
        "x_mm": 100 + 2 * k,
        "y_mm": 0 * k - 5,
        "z_mm": 20 + 0.1 * k,
        "a_deg": 90 + 0 * k,
        "b_deg": 0.1 * k,
        "c_deg": 180 + 0 * k,
    }
    rows = {key: np.repeat(v, LAWS) for key, v in six.items()}
    rows["law"] = np.tile(np.arange(1, LAWS + 1), poses)
    rows["tof_us"] = 20.0 + 0.01 * np.arange(poses * LAWS)
    rows["amplitude_pct"] = 50.0 - 0.5 * np.arange(poses * LAWS)
    rows["tof_us"][5] = np.nan
    return rows


def write_csv(path: Path, rows: dict[str, np.ndarray]) -> Path:
    pl.DataFrame(rows).fill_nan(None).write_csv(path)
    return path
