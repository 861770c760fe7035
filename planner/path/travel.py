"""The direction in which a track travels, smooth enough for an array to turn with it."""

import numpy as np
from scipy.signal import savgol_filter

from planner.frames import Array
from planner.path.tracks import Tracks

_SMOOTHING_MM = 20.0
_LINE_MM = 30.0
_MOST_MM = 0.3
# Ends stay where the margin put them; the line is smooth from here on.
_ENDS_MM = 6.0


def along_track(track: Tracks, points: Array, spacing: float) -> Array:
    """Return derivatives (n, 3) of the tracks: local parabolas over `_SMOOTHING_MM` either side, one-sided at ends."""
    return _filtered(track, points, max(int(np.ceil(_SMOOTHING_MM / spacing)), 2), 2, 1)


def smoothed(track: Tracks, points: Array, across: Array, spacing: float) -> Array:
    """Return how far (n,), mm, points of the tracks lie from smooth lines through them, along unit directions across (n, 3).

    Lines cut through uneven triangles waver by some hundredths of a millimetre, which a robot would follow. Local cubics
    over `_LINE_MM` either side do not; they keep bends of that size, never move a point by more than `_MOST_MM`, and leave
    the ends of open tracks where they are.
    """
    fitted = _filtered(track, points, max(int(np.ceil(_LINE_MM / spacing)), 3), 3, 0)
    aside = np.einsum("ij,ij->i", fitted - points, across)
    first, last = track.bounds()
    row = np.arange(len(points))
    inset = np.minimum(row - first[track.run], last[track.run] - row) * spacing
    t = np.where(track.closed[track.run], 1.0, np.minimum(inset / _ENDS_MM, 1.0))
    return np.asarray(aside * t * t * (3.0 - 2.0 * t) / np.maximum(np.abs(aside) / _MOST_MM, 1.0))


def _filtered(track: Tracks, points: Array, half: int, order: int, derivative: int) -> Array:
    """Return values or derivatives (n, 3) of local polynomials over `half` points either side."""
    out = np.zeros_like(points)
    first, last = track.bounds()
    for a, b, closed in zip(first, last, track.closed, strict=True):
        run = points[a : b + 1]
        n = len(run)
        if closed and n > 2 * half:
            around = np.concatenate([run[-half - 1 : -1], run, run[1 : half + 1]])
            out[a : b + 1] = savgol_filter(around, 2 * half + 1, order, deriv=derivative, axis=0)[half:-half]
        elif n < order + 3:
            out[a : b + 1] = np.gradient(run, axis=0) if derivative else run
        else:
            window = min(2 * half + 1, n if n % 2 else n - 1)
            out[a : b + 1] = savgol_filter(run, window, order, deriv=derivative, axis=0)
    return out
