"""The few numbers that sum up many readings, and the laws they are taken from."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.setup import Probe

WITHIN_DB = 2.0
"""The variation a procedure tolerates in the front-wall echo (dB): `within_2db`."""


def centre_laws(probe: Probe) -> NDArray[np.int32]:
    """Return the law on the TCP axis, or the two on either side of it where the number of laws is even."""
    n = probe.laws
    return np.unique(np.array([(n + 1) // 2, n // 2 + 1], dtype=np.int32))


def tilts_deg(beams: Array, arrays: Array, normals: Array) -> tuple[Array, Array]:
    """Return B and C (deg, (n,)), the turns about TCP y and TCP x that would bring the beam onto the inward normal.

    beams, arrays (n, 3): TCP z and x; normals (n, 3): outward; all unit, in one frame.
    """
    y = np.cross(beams, arrays)
    along = -(normals * beams).sum(axis=1)
    return (
        np.degrees(np.arctan2(-(normals * arrays).sum(axis=1), along)),
        np.degrees(np.arctan2(-(normals * y).sum(axis=1), along)),
    )


def loss_db(b_deg: Array, c_deg: Array, probe: Probe) -> Array:
    """Return the amplitude change (dB, not positive) that tilts B and C cost: -k alpha^2 per axis."""
    k = probe.tilt_loss_db_per_deg2
    return -(k.b * b_deg**2 + k.c * c_deg**2)


@dataclass(frozen=True)
class Prediction:
    """What a path will see, in the words of `correction.json`. ToF figures are one-way mm of the centre law."""

    tof_std_mm: float
    tof_range_mm: float
    tilt_max_deg: float
    within_2db: float
    mean_abs_db: float

    def to_json(self) -> dict[str, float]:
        """Return the fields of `prediction.before` and `prediction.after`."""
        return asdict(self)


def spread(values: Array) -> tuple[float, float]:
    """Return standard deviation and range of the finite values; NaN of none."""
    finite = values[np.isfinite(values)]
    if len(finite) == 0:
        return float("nan"), float("nan")
    return float(finite.std()), float(np.ptp(finite))
