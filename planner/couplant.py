"""Speed of sound in water and the conversion between time of flight and distance."""

import numpy as np
from numpy.typing import ArrayLike

from planner.frames import Array
from planner.setup import Couplant

# W. Marczak, "Water as a standard in the measurements of speed of sound in liquids", J. Acoust. Soc. Am. 102 (1997)
# 2776, doi:10.1121/1.420332. Valid 0 to 95 deg C, pure water at atmospheric pressure. Lowest order first, m/s.
MARCZAK_1997 = (1402.385, 5.038813, -5.799136e-2, 3.287156e-4, -1.398845e-6, 2.787860e-9)


def water_speed_m_s(temperature_c: float) -> float:
    """Return the speed of sound in pure water (m/s) at a temperature in deg C (Marczak 1997)."""
    return float(np.polynomial.polynomial.polyval(temperature_c, MARCZAK_1997))


def sound_speed_m_s(couplant: Couplant) -> float:
    """Return the couplant's speed of sound (m/s): as given, else that of water at its temperature."""
    given = couplant.sound_speed_m_s
    return water_speed_m_s(couplant.temperature_c) if given is None else given


def distance_mm(tof_us: ArrayLike, couplant: Couplant) -> Array:
    """Return the one-way distance (mm) of two-way times of flight (us): d = c (tof - delay) / 2."""
    tof = np.asarray(tof_us, dtype=np.float64)
    return sound_speed_m_s(couplant) * 1e-3 * (tof - couplant.delay_us) / 2.0


def tof_us(distance: ArrayLike, couplant: Couplant) -> Array:
    """Return the two-way time of flight (us) of one-way distances (mm); the inverse of `distance_mm`."""
    d = np.asarray(distance, dtype=np.float64)
    return 2.0 * d / (sound_speed_m_s(couplant) * 1e-3) + couplant.delay_us
