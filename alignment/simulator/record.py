"""From perfect echoes to the scan that is recorded: noise of the time of flight and amplitude, lost and wrong echoes."""

import numpy as np
from numpy.typing import NDArray

from alignment.scan import Scan
from alignment.simulator.disturb import bubbles
from alignment.simulator.truth import Noise, Truth
from planner.couplant import sound_speed_m_s, water_speed_m_s
from planner.frames import Array, Transform
from planner.setup import Setup


def record(
    distance: Array,
    amplitude: Array,
    poses: Transform,
    pass_id: NDArray[np.int32],
    t_s: Array,
    setup: Setup,
    truth: Truth,
    noise: Noise,
    random: dict[str, np.random.Generator],
    T_world_active: Transform | None,
) -> Scan:
    """Return the scan. distance, amplitude, t_s (m, laws); poses: `Ts_base_tcp` as commanded, stack m; pass_id (m,)."""
    m, laws = distance.shape
    n = m * laws
    d, a = distance.ravel(), amplitude.ravel()
    d = d + noise.tof_mm * random["tof"].standard_normal(n)
    a = a * (1.0 + noise.amplitude * random["amplitude"].standard_normal(n))
    d = np.where(random["dropouts"].random(n) < noise.dropouts, np.nan, d)
    d, a = bubbles(d, a, noise, random["outliers"], setup.reference_amplitude_pct)
    speed = sound_speed_m_s(setup.couplant)
    if truth.temperature_error_c:
        # Relative, so that it also holds for a couplant whose speed was given.
        t = setup.couplant.temperature_c
        speed *= water_speed_m_s(t + truth.temperature_error_c) / water_speed_m_s(t)
    tof = 2.0 * d / (speed * 1e-3) + setup.couplant.delay_us
    return Scan(
        Ts_scan_tcp=Transform("scan", "tcp", poses.rigid),
        pose_index=np.repeat(np.arange(m, dtype=np.int32), laws),
        law=np.tile(np.arange(1, laws + 1, dtype=np.int32), m),
        tof_us=tof,
        amplitude_pct=np.where(np.isfinite(tof), np.maximum(a, 0.0), np.nan),
        T_world_scan=None if T_world_active is None else Transform("world", "scan", T_world_active.rigid),
        t_s=t_s.ravel(),
        pass_id=np.repeat(pass_id, laws),
        name="simulated",
    )
