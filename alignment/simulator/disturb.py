"""What the cell adds: wandering of the robot, and readings that are wrong or missing. All random numbers are seeded."""

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from alignment.simulator.truth import Noise
from planner.frames import Array, Transform


def streams(seed: int) -> dict[str, np.random.Generator]:
    """Return one generator a cause, so that switching one on leaves the others as they were."""
    names = ("pose", "tof", "amplitude", "dropouts", "outliers")
    children = np.random.SeedSequence(seed).spawn(len(names))
    return {name: np.random.default_rng(child) for name, child in zip(names, children, strict=True)}


def wander(s_mm: Array, stretches: list[slice], correlation_mm: float, columns: int, rng: np.random.Generator) -> Array:
    """Return unit-variance noise (m, columns) whose correlation over path length d is exp(-d / correlation_mm).

    An Ornstein-Uhlenbeck process, exact for the even spacing inside each stretch and across the gaps between them.
    """
    out = np.zeros((len(s_mm), columns))
    state = rng.standard_normal(columns)
    last = None
    for part in stretches:
        s = s_mm[part]
        n = len(s)
        fresh = rng.standard_normal((n, columns))
        gap = np.inf if last is None else s[0] - last
        keep = np.exp(-gap / correlation_mm)
        start = keep * state + np.sqrt(1.0 - keep**2) * fresh[0]
        rho = np.exp(-(s[1] - s[0]) / correlation_mm) if n > 1 else 0.0
        drive = np.sqrt(1.0 - rho**2) * fresh
        drive[0] = start
        out[part] = lfilter([1.0], [1.0, -rho], drive, axis=0)
        state, last = out[part][-1], s[-1]
    return out


def actual_poses(Ts_base_tcp: Transform, unit_noise: Array, noise: Noise) -> Transform:
    """Return where the TCP really is: commanded poses (m), shifted along and turned about the axes of base."""
    turn = Rotation.from_rotvec(np.radians(noise.pose_deg) * unit_noise[:, 3:])
    return Transform.from_parts(
        "base", "tcp", turn * Ts_base_tcp.rotation, Ts_base_tcp.xyz_mm + noise.pose_mm * unit_noise[:, :3]
    )


def bubbles(
    distance_mm: Array, amplitude_pct: Array, noise: Noise, rng: np.random.Generator, reference_pct: float
) -> tuple[Array, Array]:
    """Return distances and amplitudes with a share of the readings replaced by a wrong echo.

    A wrong echo comes from anywhere between a fifth of the typical distance and twice it, at any amplitude.
    """
    hit = rng.random(len(distance_mm)) < noise.outliers
    where, strength = rng.random(len(distance_mm)), rng.random(len(distance_mm))
    heard = distance_mm[np.isfinite(distance_mm)]
    if not hit.any() or len(heard) == 0:
        return distance_mm, amplitude_pct
    typical = float(np.median(heard))
    wrong = typical * (0.2 + 1.8 * where)
    loud = reference_pct * (0.1 + 0.9 * strength)
    return np.where(hit, wrong, distance_mm), np.where(hit, loud, amplitude_pct)
