"""Where the passes go: levels of the pass coordinate such that no strip is left out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from planner.errors import fail
from planner.frames import Array

_BINS = 256
# A step, or a slope, that few places ask for must not set the raster for the whole pass.
_LOW_SHARE = 0.03
_MOST_PASSES = 20000


@dataclass(frozen=True, eq=False)
class StepField:
    """Allowed distance between passes over the pass coordinate, in its own measure.

    v (b,) ascending; step, half_swath (b,); end_slope: length of the coordinate per mm of surface at both ends.
    """

    v: Array
    step: Array
    half_swath: Array
    end_slope: tuple[float, float]


def step_field(v: Array, step_mm: Array, half_mm: Array, slope: Array, v_range: tuple[float, float]) -> StepField:
    """Condense samples (n,) of equal area into the step allowed at each place of the pass coordinate `v`.

    step_mm, half_mm (n,): allowed step and effective half swath on the surface; slope (n,): dv per mm of surface.
    """
    lo, hi = v_range
    edges = np.linspace(lo, hi, _BINS + 1)
    bin_of = np.clip(np.searchsorted(edges, v, side="right") - 1, 0, _BINS - 1)
    centre = (edges[1:] + edges[:-1]) / 2.0
    low_step, low_half, low_slope = (_low(bin_of, x) for x in (step_mm * slope, half_mm * slope, slope))
    has = np.isfinite(low_step)
    if not has.any():
        raise fail("surface-empty", "The inspection surface has no area.", "Choose another surface.")
    low_step = np.interp(centre, centre[has], low_step[has])
    low_half = np.interp(centre, centre[has], low_half[has])
    ends = low_slope[has]
    width = max((hi - lo) / _BINS, 1e-12)
    reach = int(np.clip(np.ceil(float(np.median(low_step)) / 2.0 / width), 0, _BINS // 8))
    return StepField(
        centre, minimum_filter1d(low_step, 2 * reach + 1, mode="nearest"), low_half, (float(ends[0]), float(ends[-1]))
    )


def _low(bin_of: NDArray[np.intp], x: Array) -> Array:
    """Return a low quantile of x in every bin, NaN where a bin is empty."""
    order = np.lexsort((x, bin_of))
    b = bin_of[order]
    start = np.searchsorted(b, np.arange(_BINS))
    count = np.bincount(b, minlength=_BINS)
    pick = np.minimum(start + (_LOW_SHARE * count).astype(np.int64), len(x) - 1)
    return np.where(count > 0, x[order][pick], np.nan)


def levels(
    field: StepField, v_range: tuple[float, float], ends: tuple[float | None, float | None], exact: bool
) -> Array:
    """Return the levels of the passes (k,), ascending.

    ends: margin kept at the low and the high end, in v: the outermost swath reaches it; None where the surface goes on
    to its own mirror image (passes there stand half a step from the end). exact: the step was given, keep it between
    the inner passes and let the two outermost gaps take what is left (unless sharing it changes the step by less than
    one percent).
    """
    lo, hi = v_range
    n_of_v = np.concatenate([[0.0], np.cumsum(np.full(len(field.v), (hi - lo) / len(field.v)) / field.step)])
    edges = np.linspace(lo, hi, len(field.v) + 1)
    first = _inset(field, lo, +1.0, ends[0])
    last = _inset(field, hi, -1.0, ends[1])
    if last <= first:
        return np.array([(lo + hi) / 2.0 if last < first else first])
    a, b = np.interp([first, last], edges, n_of_v)
    gaps = int(np.ceil(b - a - 1e-6))
    if gaps > _MOST_PASSES:
        raise fail(
            "raster-too-dense",
            f"The raster would need {gaps} passes.",
            "Give a larger inspection.step_mm, or a smaller surface.",
            "setup.json: inspection",
        )
    gaps = max(gaps, 1)
    if exact and (b - a) / gaps < 0.99 and gaps > 1:
        outer = (b - a - (gaps - 2)) / 2.0
        n = np.concatenate([[a], a + outer + np.arange(gaps - 1), [b]])
    else:
        n = np.linspace(a, b, gaps + 1)
    return np.asarray(np.interp(n, n_of_v, edges))


def _inset(field: StepField, end: float, sign: float, margin: float | None) -> float:
    at = int(np.argmin(np.abs(field.v - end)))
    inset = field.step[at] / 2.0 if margin is None else margin + field.half_swath[at]
    return end + sign * float(inset)
