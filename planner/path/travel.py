"""The direction in which a track travels, smooth enough for an array to turn with it."""

import numpy as np
from scipy.signal import savgol_filter

from planner.frames import Array
from planner.path.tracks import Tracks

_SMOOTHING_MM = 20.0


def along_track(track: Tracks, points: Array, spacing: float) -> Array:
    """Return derivatives (n, 3) of the tracks: local parabolas over `_SMOOTHING_MM` either side, one-sided at ends."""
    out = np.zeros_like(points)
    half = max(int(np.ceil(_SMOOTHING_MM / spacing)), 2)
    first, last = track.bounds()
    for a, b, closed in zip(first, last, track.closed, strict=True):
        run = points[a : b + 1]
        n = len(run)
        if closed and n > 2 * half:
            around = np.concatenate([run[-half - 1 : -1], run, run[1 : half + 1]])
            out[a : b + 1] = savgol_filter(around, 2 * half + 1, 2, deriv=1, axis=0)[half:-half]
        elif n < 5:
            out[a : b + 1] = np.gradient(run, axis=0)
        else:
            window = min(2 * half + 1, n if n % 2 else n - 1)
            out[a : b + 1] = savgol_filter(run, window, 2, deriv=1, axis=0)
    return out
