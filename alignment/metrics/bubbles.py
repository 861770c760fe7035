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
    place = np.arange(n)
    left, right = place - half, place + half
    whole = (left >= 0) & (right < n)
    whole &= (track[np.maximum(left, 0)] == track) & (track[np.minimum(right, n - 1)] == track)
    smooth[~whole] = _end_median(d, track, np.flatnonzero(~whole), half)
    off = np.abs(d - smooth)
    scale = MAD * float(np.median(off))
    out[order] = off > max(LEAST_MM, SIGMAS * scale)
    return out


def _end_median(d: Array, track: NDArray[Any], rows: NDArray[np.intp], half: int) -> Array:
    """Median at `rows` over the part of the window that lies on the same track."""
    index = rows[:, None] + np.arange(-half, half + 1)
    inside = (index >= 0) & (index < len(d))
    index = np.clip(index, 0, len(d) - 1)
    same = inside & (track[index] == track[rows][:, None])
    return np.asarray(np.nanmedian(np.where(same, d[index], np.nan), axis=1))
