"""Tilt-loss curve of the probe from a tilt test on a flat target: the paper's Fig. 3 and 4."""

import numpy as np

from alignment.calibrate.result import Calibration, Estimate, Status, factor_95
from alignment.calibrate.tilt_curve import fitted_curves
from planner.errors import fail
from planner.frames import Array
from planner.issues import Issue

# Only readings within this of the best one follow the parabola; below lie noise floor and side lobes.
MAX_DROP_DB = 15.0
# An axis that was turned through less than this says nothing.
MIN_SPAN_DEG = 0.5
# Relative one-sigma error up to which a curvature counts as measured, and as weak.
MEASURED_SHARE, WEAK_SHARE = 0.1, 0.5
MIN_ANGLES = 6
# The full screen height: a top amplitude from here on that so many angles share exactly is where the receiver clips.
FULL_PCT, CLIPPED_ANGLES = 99.0, 3
# An echo that grows with tilt by more than so many standard deviations is no noise.
GROWS_SIGMAS = 3.0
OUTLIER_SIGMAS = 4.0


def calibrate_tilt(
    b_deg: Array, c_deg: Array, amplitude_pct: Array, saturation_pct: float | None = None
) -> Calibration:
    """Return k_b and k_c (dB/deg^2) and the zero of both angles from n readings (n,) each.

    Model: 20 log10 A = a - k_b (b - b0)^2 - k_c (c - c0)^2, linear in a, k b0, k. Readings at the same angles are averaged
    first, since they share the angle's own error; readings at or above `saturation_pct` (None: where the receiver is seen to
    clip) and more than 15 dB below the best are left out. Raises EchoBaseError `tilt-readings` when too few angles remain,
    or amplitudes are negative.
    """
    b, c, amplitude = (np.asarray(v, dtype=np.float64) for v in (b_deg, c_deg, amplitude_pct))
    if (amplitude < 0.0).any():
        row = int(np.argmax(amplitude < 0.0))
        raise fail(
            "tilt-readings",
            f"amplitude_pct of reading {row + 1} is {amplitude[row]:g}, below 0.",
            "Give amplitudes in % of full screen height; leave the cell empty where there was no echo.",
        )
    good = np.isfinite(b) & np.isfinite(c) & np.isfinite(amplitude) & (amplitude > 0.0)
    clipped = amplitude >= (_clips_at(b, c, amplitude) if saturation_pct is None else saturation_pct)
    said = [_clipped(amplitude[good & clipped])] if (good & clipped).any() else []
    good &= ~clipped
    b, c, level = _by_angle(b[good], c[good], 20.0 * np.log10(amplitude[good]))
    keep = level > level.max(initial=-np.inf) - MAX_DROP_DB
    spans = {"b": _span(b[keep]) >= MIN_SPAN_DEG, "c": _span(c[keep]) >= MIN_SPAN_DEG}
    terms = {"a": np.ones_like(b)}
    for axis, angle in (("b", b), ("c", c)):
        if spans[axis]:
            terms |= {f"p{axis}": angle, f"k{axis}": -(angle**2)}
    if keep.sum() >= MIN_ANGLES and not any(spans.values()):
        raise fail(
            "tilt-readings",
            f"The angles with an echo span {_span(b[keep]):.2g} deg in B and {_span(c[keep]):.2g} deg in C: too little for a "
            "tilt curve.",
            "Turn the probe through at least +-2 deg, and give b_deg and c_deg in degrees.",
        )
    if keep.sum() < max(MIN_ANGLES, len(terms) + 1):
        raise fail(
            "tilt-readings",
            f"{int(keep.sum())} different angles with an echo are too few for a tilt curve.",
            "Turn the probe over a flat target through at least +-2 deg in steps of 0.5 deg or less, in B and in C.",
        )
    solution, covariance, dof, keep, rms = _fit(np.column_stack(list(terms.values())), level, keep)
    at = {name: i for i, name in enumerate(terms)}
    estimates, patch, issues = {}, {}, said
    for axis in ("b", "c"):
        estimate, issue = _curvature(axis, spans[axis], at, solution, covariance, dof)
        estimates[f"k_{axis}"] = estimate
        if issue is not None:
            issues.append(issue)
        if estimate.status != "held":
            patch[axis] = round(estimate.value, 4)
            estimates[f"zero_{axis}"] = _zero(axis, at, solution, covariance, dof)
    curves = {"b_deg": b, "c_deg": c, "level_db": level - solution[0], "used": keep.astype(np.float64)}
    curves |= fitted_curves(curves, at, solution, covariance, factor_95(dof))
    full = {"probe": {"tilt_loss_db_per_deg2": patch}} if patch else {}
    return Calibration("tilt", estimates, full, int(good.sum()), rms, "dB", tuple(issues), curves)


def _span(angle: Array) -> float:
    return float(np.ptp(angle)) if len(angle) else 0.0


def _clips_at(b: Array, c: Array, amplitude: Array) -> float:
    """Return the amplitude from which on the receiver clips, infinite if it does not."""
    top = float(np.max(amplitude, where=np.isfinite(amplitude), initial=0.0))
    at_top = np.column_stack([b, c])[amplitude == top]
    clips = top >= FULL_PCT and len(np.unique(at_top, axis=0)) >= CLIPPED_ANGLES
    return top if clips else np.inf


def _clipped(amplitude: Array) -> Issue:
    text = f"{len(amplitude)} readings of {amplitude.min():g} %FSH and more, where the receiver clips, were left out."
    return Issue(
        "warning", "tilt-clipped", text, "Lower the gain until the largest echo stays below 90 %, and record again."
    )


def _by_angle(b: Array, c: Array, level: Array) -> tuple[Array, Array, Array]:
    angles, group = np.unique(np.column_stack([b, c]).round(4), axis=0, return_inverse=True)
    count = np.bincount(group.ravel(), minlength=len(angles))
    return angles[:, 0], angles[:, 1], np.bincount(group.ravel(), level, len(angles)) / np.maximum(count, 1)


def _fit(design: Array, level: Array, keep: Array) -> tuple[Array, Array, int, Array, float]:
    """Least squares with outliers left out; returns solution, covariance, degrees of freedom, rows used, rms."""
    for _ in range(5):
        x, y = design[keep], level[keep]
        solution = np.linalg.lstsq(x, y, rcond=None)[0]
        dof = max(len(y) - x.shape[1], 1)
        off = level - design @ solution
        scale = max(1.4826 * float(np.median(np.abs(off[keep]))) * np.sqrt(len(y) / dof), 1e-12)
        again = (level > solution[0] - MAX_DROP_DB) & (np.abs(off) < OUTLIER_SIGMAS * scale)
        if again.sum() <= x.shape[1] or (again == keep).all():
            break
        keep = again
    x = design[keep]
    off = level[keep] - x @ solution
    variance = float(off @ off) / dof
    return solution, variance * np.linalg.pinv(x.T @ x), dof, keep, float(np.sqrt(np.mean(off**2)))


def _curvature(
    axis: str, turned: bool, at: dict[str, int], solution: Array, covariance: Array, dof: int
) -> tuple[Estimate, Issue | None]:
    unit = "dB/deg^2"
    if not turned:
        remedy = f"Add readings with {axis.upper()} turned through +-2 deg."
        issue = Issue(
            "info", "tilt-held", f"{axis.upper()} was not turned, so its tilt loss stays as it was.", remedy, axis
        )
        return Estimate(np.nan, np.inf, np.inf, unit, "held"), issue
    i = at[f"k{axis}"]
    k, sigma = float(solution[i]), float(np.sqrt(covariance[i, i]))
    status: Status = "measured" if sigma < MEASURED_SHARE * k else "weak" if sigma < WEAK_SHARE * k else "held"
    estimate = Estimate(k, sigma, sigma * factor_95(dof), unit, status)
    if status == "measured":
        return estimate, None
    if k < -GROWS_SIGMAS * sigma:
        text = f"The echo grows with the tilt in {axis.upper()}, by {-k:.2g} {unit}; the tilt loss stays as it was."
        return estimate, Issue("warning", "tilt-held", text, "Check the columns, and that the target is flat.", axis)
    what = "is not seen in these readings" if status == "held" else f"is known to {100 * sigma / k:.0f} % only"
    return estimate, Issue(
        "warning",
        f"tilt-{status}",
        f"The tilt loss in {axis.upper()} {what}.",
        "Turn farther, or average more readings.",
        axis,
    )


def _zero(axis: str, at: dict[str, int], solution: Array, covariance: Array, dof: int) -> Estimate:
    """The angle of the largest echo, p / 2 k, with first-order error propagation."""
    i, j = at[f"p{axis}"], at[f"k{axis}"]
    p, k = solution[i], solution[j]
    gradient = np.array([1.0 / (2.0 * k), -p / (2.0 * k**2)])
    sigma = float(np.sqrt(gradient @ covariance[np.ix_([i, j], [i, j])] @ gradient))
    return Estimate(float(p / (2.0 * k)), sigma, sigma * factor_95(dof), "deg", "measured")
