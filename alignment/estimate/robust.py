"""Robust weights: what does not belong to the surface must not move it."""

import numpy as np

from planner.frames import Array

# Median absolute deviation of a normal distribution, inverted.
MAD_TO_SIGMA = 1.482602218505602
# Tukey's biweight at 95 % efficiency for normal residuals (J. W. Tukey 1977; P. J. Huber 1981).
TUKEY_C = 4.685


def mad_sigma(residual: Array, floor: float, about_zero: bool = False) -> float:
    """Return the normal-equivalent scale of residuals from their median absolute deviation, at least `floor`."""
    if len(residual) == 0:
        return floor
    centre = 0.0 if about_zero else float(np.median(residual))
    return max(floor, MAD_TO_SIGMA * float(np.median(np.abs(residual - centre))))


def tukey_weights(residual: Array, sigma: float, c: float = TUKEY_C) -> Array:
    """Return Tukey's biweights (n,), 0 beyond c sigma."""
    u2 = (residual / (c * sigma)) ** 2
    return np.where(u2 < 1.0, (1.0 - np.minimum(u2, 1.0)) ** 2, 0.0)


def huber_weights(residual: Array, sigma: float, c: float = 1.345) -> Array:
    """Return Huber's weights (n,), convex and so blind to where it starts."""
    a = np.abs(residual)
    return np.minimum(1.0, c * sigma / np.maximum(a, 1e-300))
