"""The fitted tilt-loss curve of each axis beside its readings, as drawn in the paper's Fig. 3 and 4."""

from collections.abc import Mapping

import numpy as np

from planner.frames import Array

STEPS = 81


def fitted_curves(
    readings: Mapping[str, Array], at: Mapping[str, int], solution: Array, covariance: Array, factor: float
) -> dict[str, Array]:
    """Return, per axis that was turned, `<axis>_seen_db` (n,) and the curve `<axis>_fit_deg`, `_fit_db`, `_fit_half_db` (k,).

    readings: b_deg, c_deg, level_db (over the level at zero), used, of n angles. at: column of each term (a, pb, kb, pc, kc)
    in solution and covariance. factor: half width of a 95 % region in standard deviations. Seen is the level less what the
    fit says of the other axis, so that readings tilted about both fall on one curve; NaN for a reading that was left out for
    its tilt about the other axis. Everything is over the curve's own
    peak; the band is that of the fitted level, a + p x - k x^2, by propagation of its covariance.
    """
    used = readings["used"] > 0.5
    effect = {axis: _loss(readings[f"{axis}_deg"], axis, at, solution) for axis in ("b", "c") if f"k{axis}" in at}
    out = {}
    for axis, other in (("b", "c"), ("c", "b")):
        if axis not in effect:
            continue
        p, k = solution[at[f"p{axis}"]], solution[at[f"k{axis}"]]
        peak = p**2 / (4.0 * k) if k > 0.0 else 0.0
        angle = readings[f"{axis}_deg"][used]
        x = np.linspace(angle.min(), angle.max(), STEPS)
        rows = [at["a"], at[f"p{axis}"], at[f"k{axis}"]]
        gradient = np.column_stack([np.ones_like(x), x, -(x**2)])
        variance = np.einsum("ni,ij,nj->n", gradient, covariance[np.ix_(rows, rows)], gradient)
        of_other = effect.get(other, np.zeros_like(used, dtype=np.float64))
        mine = used | (effect[axis] <= of_other)
        out[f"{axis}_seen_db"] = np.where(mine, readings["level_db"] - of_other - peak, np.nan)
        out[f"{axis}_fit_deg"] = x
        out[f"{axis}_fit_db"] = p * x - k * x**2 - peak
        out[f"{axis}_fit_half_db"] = factor * np.sqrt(np.maximum(variance, 0.0))
    return out


def _loss(angle_deg: Array, axis: str, at: Mapping[str, int], solution: Array) -> Array:
    return np.asarray(solution[at[f"p{axis}"]] * angle_deg - solution[at[f"k{axis}"]] * angle_deg**2)
