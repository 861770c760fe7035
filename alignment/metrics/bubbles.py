"""Echoes that cannot be the front wall: far from their neighbours along the pass. They would make any range infinite."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from planner.frames import Array

WINDOW = 9
LEAST_MM = 0.5
SIGMAS = 8.0
# Median absolute deviation to standard deviation, of a normal distribution.
MAD = 1.4826


def bubbles(distance_mm: Array, order: NDArray[np.intp], group: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which readings (n,) stand more than `LEAST_MM`, and `SIGMAS` robust deviations, off a running median.

    order: the readings in order along each track (one law of one pass); group (n,): the track of each reading.
    """
    out = np.zeros(len(distance_mm), dtype=bool)
    if len(distance_mm) < WINDOW:
        return out
    d, track = distance_mm[order], group[order]
    # A median that reaches over the end of a track is not its own: such readings are compared within their track only.
    smooth = median_filter(d, size=WINDOW, mode="nearest")
    half = WINDOW // 2
    n = len(d)
    left, right = np.clip(np.arange(n) - half, 0, n - 1), np.clip(np.arange(n) + half, 0, n - 1)
    whole = (track[left] == track) & (track[right] == track)
    smooth = np.where(whole, smooth, _end_median(d, track, half))
    off = np.abs(d - smooth)
    scale = MAD * float(np.median(off))
    out[order] = off > max(LEAST_MM, SIGMAS * scale)
    return out


def _end_median(d: Array, track: NDArray[Any], half: int) -> Array:
    """Median over the part of the window that lies on the same track."""
    n = len(d)
    index = np.clip(np.arange(n)[:, None] + np.arange(-half, half + 1), 0, n - 1)
    same = track[index] == track[:, None]
    return np.asarray(np.nanmedian(np.where(same, d[index], np.nan), axis=1))
