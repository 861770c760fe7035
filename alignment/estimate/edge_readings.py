"""What each pose and law heard of the part: how loud, whether it stands over the part, and what is no echo of it.

A splash is told by its distance, which is not that of the part; a lost echo only by its neighbours.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, median_filter, minimum_filter, uniform_filter

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import PoseLine
from planner.frames import Array

# Around a reading, how far its plateau is looked for along the pass and across the laws (mm).
PLATEAU_ALONG_MM, PLATEAU_ACROSS_MM = 12.0, 6.0
# An echo whose distance is off by more than this (mm), and by so many times what is usual, is none of the part.
FALSE_MM, FALSE_SCATTERS = 0.5, 8.0
# Where the part itself is, is asked of echoes not farther off than this (mm), or than usual, over so much of a pass (mm).
NEAR_MM, LEVEL_MM = 3.0, 15.0
# What a reading says of itself, and how much of it a neighbour believes: logarithms of odds to be on the part.
LOUD, FALSE, NEIGHBOUR = 2.5, -0.25, 0.4
# How often an echo is lost in the midst of the part: never taken to be rarer or more frequent than this.
DROPOUT_LIMITS = (1e-3, 0.5)
FEW_DROPOUTS = 0.02
# Readings so many poses and laws from the next one off the part are in its midst.
MIDST = 5


@dataclass(frozen=True, eq=False)
class EdgeReadings:
    """share (m, laws): amplitude over its plateau, 0 where no echo came back, NaN where another was heard or none is known.

    on (m, laws): which are on the part. scatter: of the shares on the plateau, one sigma. dropout: how often an echo is lost.
    """

    share: Array
    on: NDArray[np.bool_]
    scatter: float
    dropout: float


def edge_readings(
    cloud: PointCloud, line: PoseLine, pitch_mm: float, laws: int, gain: Array, expected_mm: Array
) -> EdgeReadings | None:
    """Return the readings of a cloud; None where nothing is loud. gain (m, laws): what is lost to tilt, as a factor.

    expected_mm (m, laws): distance of the placed surface. What a file has no row for is silence.
    """
    shape = (len(line.present), laws)
    amplitude, distance = np.zeros(shape), np.full(shape, np.nan)
    at = (cloud.pose_index, cloud.law - 1)
    amplitude[at], distance[at] = cloud.amplitude_pct, cloud.distance_mm
    heard = np.isfinite(distance)
    unknown = ~np.isfinite(amplitude)
    amplitude = np.where(unknown, 0.0, amplitude) * gain
    false = heard & _false(distance - expected_mm, line)
    loud = amplitude[heard & ~false & ~unknown & (amplitude > 0.0)]
    if not len(loud):
        return None
    own = np.where(false | unknown, 0.0, amplitude)
    plateau = _plateau(own, line, pitch_mm, float(np.median(loud)))
    share = np.minimum(own / plateau, 1.5)
    measured = np.where(false | unknown, np.nan, share)
    dropout = FEW_DROPOUTS
    for _ in range(2):
        on = _on(measured, heard, line, dropout)
        midst = minimum_filter(on, size=(MIDST, min(MIDST, laws)), mode="constant", cval=0)
        silent = midst & (measured <= 0.0) & line.present[:, None]
        dropout = float(np.clip((silent.sum() + 0.5) / (midst.sum() + 1.0), *DROPOUT_LIMITS))
    flat = measured[midst & (measured > 0.5)]
    scatter = 1.4826 * float(np.median(np.abs(flat - 1.0))) if len(flat) else 0.0
    return EdgeReadings(measured, on, scatter, dropout)


def _false(off_mm: Array, line: PoseLine) -> NDArray[np.bool_]:
    """Return which readings, off_mm (m, laws) beyond the placed surface, NaN: none, stand out from those around them."""
    known = np.isfinite(off_mm)
    if not known.any():
        return known
    # Half an array may see the table: it is not asked where the part is.
    near = known & (np.abs(off_mm) < max(NEAR_MM, FALSE_SCATTERS * float(np.median(np.abs(off_mm[known])))))
    ranked = np.sort(np.where(near, off_mm, np.inf), axis=1)
    middle = np.take_along_axis(ranked, np.maximum(near.sum(axis=1) - 1, 0)[:, None] // 2, axis=1)[:, 0]
    middle = np.where(np.isfinite(middle), middle, 0.0)
    size = 2 * max(1, round(0.5 * LEVEL_MM / max(line.spacing_mm, 1e-3))) + 1
    level = np.concatenate([median_filter(middle[a:b], size=size, mode="nearest") for a, b in runs(line)])
    off = np.abs(np.where(known, off_mm - level[:, None], 0.0))
    return known & (off > max(FALSE_MM, FALSE_SCATTERS * float(np.median(off[near]))))


def runs(line: PoseLine) -> list[tuple[int, int]]:
    """Return first and last row (exclusive) of each pass."""
    cut = np.flatnonzero(np.diff(line.pass_id) != 0) + 1
    return list(zip(np.r_[0, cut], np.r_[cut, len(line.pass_id)], strict=True))


def _plateau(amplitude: Array, line: PoseLine, pitch_mm: float, usual: float) -> Array:
    """Return how loud the part is around each reading (m, laws): the mean of what is nearly as loud as that mean."""
    laws = amplitude.shape[1]
    along = 2 * max(1, round(PLATEAU_ALONG_MM / max(line.spacing_mm, 1e-3))) + 1
    across = 2 * max(1, round(PLATEAU_ACROSS_MM / pitch_mm)) + 1 if laws > 1 else 1
    out = np.full(amplitude.shape, usual)
    for first, last in runs(line):
        a, plateau = amplitude[first:last], out[first:last]
        for level in (0.5, 0.85, 0.95):
            loud = a > level * plateau
            weight = uniform_filter(loud.astype(np.float64), (along, across), mode="constant")
            total = uniform_filter(np.where(loud, a, 0.0), (along, across), mode="constant")
            plateau = np.where(weight > 1e-9, total / np.maximum(weight, 1e-9), plateau)
        out[first:last] = plateau
    return out


def _on(share: Array, heard: NDArray[np.bool_], line: PoseLine, dropout: float) -> NDArray[np.bool_]:
    """Return which readings (m, laws) are on the part, by what they and their neighbours heard.

    Silence speaks against it as far as echoes are not lost anyway. Twice, so that neighbours lost together do not outvote
    the rest.
    """
    silence = max(np.log(dropout), -LOUD)
    own = np.where(np.isnan(share), np.where(heard, FALSE, 0.0), np.where(share > 0.5, LOUD, -LOUD))
    own = np.where(share <= 0.0, silence, own)
    kernel = np.full((3, 3), NEIGHBOUR) if share.shape[1] > 1 else NEIGHBOUR * np.array([[1.0], [2], [0], [2], [1]])
    kernel[kernel.shape[0] // 2, kernel.shape[1] // 2] = 0.0
    out = np.zeros(share.shape, dtype=bool)
    for first, last in runs(line):
        said = own[first:last]
        score = said + convolve(said, kernel, mode="nearest")
        score = said + convolve(np.clip(score, -LOUD, LOUD), kernel, mode="nearest")
        out[first:last] = score > 0.0
    return out
