"""Where between two readings an edge lies: by the beam's own S-curve, which the scan itself shows.

A beam that moves off the part loses its echo on an S-curve, from a Gaussian's to a sharp disc's. Place and curve are those
that explain the shares of the eight readings around each crossing best (least squares, weighted by how steep the curve is
and how noisy the reading), so that where a reading happens to stand does not matter.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtri

from alignment.estimate.edge_points import EdgePoints
from planner.frames import Array

# Full width at half maximum of a Gaussian, in standard deviations.
SIGMAS_PER_WIDTH = float(np.sqrt(8.0 * np.log(2.0)))
# Beams tried: from Gaussian (0) to a sharp disc (1), half to twice as wide as the set-up says; then finer.
BLENDS = np.linspace(0.0, 1.0, 5)
WIDTHS = np.geomspace(0.5, 2.0, 11)
MOST_TRIALS = 80
# So many crossings tell the shape of the beam well enough.
ENOUGH = 200
# With fewer readings the set-up is believed.
LEAST_READINGS = 20
# An error of a share beyond this is a splash, not a shape.
MOST_ERROR = 0.1
STEPS = 4
# Amplitude noise is a share of the amplitude, and there is always some (both as shares of the plateau).
NOISE_SHARE, NOISE_FLOOR = 0.02, 0.01
_REACH = np.arange(-3, 5)
_SHARES = np.clip(np.linspace(0.0, 1.0, 401), 1e-4, 1.0 - 1e-4)


def locate(points: EdgePoints, cosine: Array, beam_width_mm: float) -> EdgePoints:
    """Return the crossings with their places found anew; cosine (k,): of the angle between their step and the conormal."""
    if len(points) == 0:
        return points
    gap = np.maximum(points.gap_mm * np.clip(cosine, 0.2, 1.0), 1e-9)
    blend, width = fit_beam(points.window, gap, beam_width_mm)
    at, misfit = place(points.window, gap, blend, width)
    same = np.array_equal(points.window, points.window_other, equal_nan=True)
    return replace(
        points, misfit=misfit, at=at, at_other=at if same else place(points.window_other, gap, blend, width)[0]
    )


def fit_beam(window: Array, gap_mm: Array, beam_width_mm: float) -> tuple[float, float]:
    """Return the blend (0 Gaussian, 1 disc) and the -6 dB width, mm, of the beam whose S-curve explains the shares best.

    window (k, 8): shares around crossings; gap_mm (k,): distance of neighbouring readings across the edge.
    """
    if np.isfinite(window).sum() < LEAST_READINGS:
        return 0.0, beam_width_mm
    every = max(1, len(window) // ENOUGH)
    few, gap = window[::every], gap_mm[::every]
    start = min((_cost(few, gap, b, beam_width_mm * w), b, np.log(w)) for b in BLENDS for w in WIDTHS)[1:]
    found = minimize(
        lambda v: _cost(few, gap, v[0], beam_width_mm * np.exp(v[1])), start, method="Nelder-Mead",
        bounds=((0.0, 1.0), (np.log(WIDTHS[0]), np.log(WIDTHS[-1]))),
        options={"xatol": 2e-3, "fatol": 1e-9, "maxfev": MOST_TRIALS},
    )  # fmt: skip
    return float(found.x[0]), float(beam_width_mm * np.exp(found.x[1]))


def _cost(window: Array, gap: Array, blend: float, width: float) -> float:
    return float(place(window, gap, blend, width)[1].mean())


def place(window: Array, gap_mm: Array, blend: float, width_mm: float) -> tuple[Array, Array]:
    """Return where the edge lies between the two middle readings (k,), 0..1, and the mean squared error of the shares (k,).

    window (k, 8), gap_mm (k,) as in `fit_beam`; of a beam of this blend and -6 dB width, mm. Gauss-Newton, a splash weighing
    less the farther it is off the curve (Tukey's biweight).
    """
    depth, slope = _curve(blend)
    share = np.nan_to_num(window)
    known = np.isfinite(window)
    silent = known & (share <= 0.0)
    floor = _least_heard(window)
    scale = gap_mm / width_mm
    # The chord between the two readings is near enough to begin with.
    drop = share[:, 3] - share[:, 4]
    at = np.clip((share[:, 3] - 0.5) / np.maximum(drop, 1e-6), 0.0, 1.0)
    for step in range(STEPS + 1):
        inside = (at[:, None] - _REACH) * scale[:, None]
        expected = np.interp(inside, depth, _SHARES, left=0.0, right=1.0)
        error = np.where(known, expected - share, 0.0)
        # Silence says only that the echo was below what is heard at all.
        error[silent] = np.maximum(error[silent] - floor, 0.0)
        if step == STEPS:
            break
        rate = np.interp(inside, depth, slope, left=0.0, right=0.0) * scale[:, None]
        weight = (known & ~(silent & (error <= 0.0))) / ((NOISE_SHARE * expected) ** 2 + NOISE_FLOOR**2)
        weight = weight * (1.0 - np.minimum(np.abs(error) / (3.0 * MOST_ERROR), 1.0) ** 2) ** 2
        information = (weight * rate**2).sum(axis=1)
        pull = (weight * rate * error).sum(axis=1)
        move = np.divide(pull, information, out=np.zeros_like(pull), where=information > 1e-6)
        at = np.clip(at - np.clip(move, -0.3, 0.3), 0.0, 1.0)
    squared = np.minimum(error**2, MOST_ERROR**2)
    return at, squared.sum(axis=1) / np.maximum(known.sum(axis=1), 1)


def _least_heard(window: Array) -> float:
    """Return the smallest share at which echoes are heard at all, 0 where that is not seen."""
    heard = window[window > 0.0]
    return float(np.quantile(heard, 0.01)) if len(heard) else 0.0


_DISC_X = np.linspace(-1.0, 1.0, 401)
_DISC_SHARE = 0.5 + (np.arcsin(_DISC_X) + _DISC_X * np.sqrt(1.0 - _DISC_X**2)) / np.pi


@lru_cache(maxsize=256)
def _curve(blend: float) -> tuple[Array, Array]:
    """Return how deep inside the edge, in widths, a beam has each share of `_SHARES` (401,), and the curve's slope there."""
    gauss, disc = ndtri(_SHARES) / SIGMAS_PER_WIDTH, 0.5 * np.interp(_SHARES, _DISC_SHARE, _DISC_X)
    depth = (1.0 - blend) * gauss + blend * disc
    return depth, np.gradient(_SHARES, depth)
