"""How wide a pass really sees: the laws whose own tilt and standoff stay inside the tolerance at the local curvature."""

import numpy as np

from planner.frames import Array
from planner.setup import Setup


def effective_half_mm(W: Array, across: Array, setup: Setup) -> Array:
    """Return half the effective swath (n,), mm, for an array along `across` at points of shape operator `W`.

    W (n, 3, 3): dn = W dp. across (n, 3): unit, tangent. The law at x sees the normal turned by atan(|W a| x) and the
    surface fall away by |a W a| x^2 / 2; both stay inside `tolerances`. Never less than half a law (of a single
    crystal: half its beam), since the centre law sees no tilt.
    """
    turn = np.einsum("nij,nj->ni", W, across)
    per_mm = np.linalg.norm(turn, axis=1)
    sag = np.abs(np.einsum("ni,ni->n", turn, across))
    tilt = np.tan(np.radians(setup.tolerances.tilt_deg))
    probe = setup.probe
    half = np.full(len(W), probe.swath_mm / 2.0)
    half = np.minimum(half, tilt / np.maximum(per_mm, 1e-12))
    half = np.minimum(half, np.sqrt(2.0 * setup.tolerances.standoff_mm / np.maximum(sag, 1e-12)))
    least = probe.beam_width_mm if probe.laws == 1 else probe.pitch_mm
    return np.asarray(np.maximum(half, least / 2.0))


def step_mm(half_mm: Array, setup: Setup) -> Array:
    """Return the index step allowed on the surface (n,), mm: as given, or the effective swath less the overlap."""
    inspection = setup.inspection
    if inspection.step_mm is not None:
        return np.full(len(half_mm), inspection.step_mm)
    return (1.0 - inspection.overlap) * 2.0 * half_mm
