"""Speed of sound and delay of the couplant from known gaps, known steps, or repeat echoes."""

import numpy as np
from scipy.optimize import brentq

from alignment.calibrate.result import Calibration, Estimate, Status, factor_95
from planner.couplant import sound_speed_m_s, water_speed_m_s
from planner.errors import fail
from planner.frames import Array
from planner.issues import Issue
from planner.setup import Couplant

# One reading cannot show its own scatter; then this stands for it: 0.01 mm of water, there and back (us).
TOF_SIGMA_US = 0.0135
# One-sigma errors up to which a value counts as measured, and as weak: 0.1 % of a 15 mm standoff is 0.015 mm.
SPEED_MEASURED, SPEED_WEAK = 1e-3, 1e-2
DELAY_MEASURED_US, DELAY_WEAK_US = 0.02, 0.2
PLAUSIBLE_M_S = (300.0, 7000.0)
# Half or twice the speed of the setup, to this share, is a mistake in the file and no couplant.
FACTOR_SHARE = 0.06


def calibrate_couplant(
    tof_us: Array,
    couplant: Couplant,
    gap_mm: Array | None = None,
    step_mm: Array | None = None,
    echo: Array | None = None,
) -> Calibration:
    """Return the speed (m/s) and the delay (us) that explain n two-way times of flight (n,).

    Echo number k (1, 2, ... for repeats between probe and target) arrives at delay + 2 k d / c. The distance d is known
    (`gap_mm`), or known up to a constant (`step_mm`, moved by the robot). One gap and one echo fix the speed for the delay
    of the setup; several gaps, or a repeat echo, fix both; steps fix the speed, and with a repeat echo the delay too.
    Raises EchoBaseError `couplant-readings`.
    """
    tof = np.asarray(tof_us, dtype=np.float64)
    number = np.ones_like(tof) if echo is None else np.asarray(echo, dtype=np.float64)
    if (gap_mm is None) == (step_mm is None):
        raise fail("couplant-readings", "State either gap_mm or step_mm.", "One column of distances is needed.")
    distance = np.asarray(gap_mm if gap_mm is not None else step_mm, dtype=np.float64)
    _refuse_odd(number)
    good = np.isfinite(tof) & np.isfinite(distance) & np.isfinite(number)
    tof, number, distance = tof[good], number[good], distance[good]
    recorded = tof
    if len(tof) == 0:
        raise fail("couplant-readings", "There is no usable reading.", "Record times of flight over known gaps.")
    # Unknowns: slowness (us/mm), then delay, then (for steps) the unknown gap times the slowness.
    design = np.column_stack([2.0 * number * distance, np.ones_like(tof)])
    if step_mm is not None:
        design = np.column_stack([design, 2.0 * number])
    known_delay = False
    if np.linalg.matrix_rank(_scaled(design)) < design.shape[1]:
        # Without repeats the gap of a step test and the delay are one number; with one gap the setup states the delay.
        known_delay = True
        design = design[:, [0]] if gap_mm is not None else design[:, [0, 1]]
        tof = tof - couplant.delay_us if gap_mm is not None else tof
    if np.linalg.matrix_rank(_scaled(design)) < design.shape[1]:
        raise fail(
            "couplant-readings",
            "The distances do not differ, so nothing shows the speed.",
            "Take readings at two or more distances that are at least 5 mm apart, or state the gap itself (gap_mm).",
        )
    solution = np.linalg.lstsq(design, tof, rcond=None)[0]
    off = tof - design @ solution
    dof = len(tof) - design.shape[1]
    variance = float(off @ off) / dof if dof > 0 else TOF_SIGMA_US**2
    if gap_mm is not None and known_delay and dof > 0:
        variance = max(variance, TOF_SIGMA_US**2)
    covariance = variance * np.linalg.inv(design.T @ design)
    speed = 1e3 / solution[0]
    if not PLAUSIBLE_M_S[0] < speed < PLAUSIBLE_M_S[1]:
        raise fail(
            "couplant-readings",
            f"The readings ask for a speed of sound of {speed:.0f} m/s, which no couplant has.",
            "Check units (mm, us, two-way) and the echo numbers.",
        )
    _refuse_factor(speed, sound_speed_m_s(couplant))
    factor = factor_95(dof) if dof > 0 else 1.96
    sigma = float(speed * np.sqrt(covariance[0, 0]) / solution[0])
    status = _status(sigma / speed, SPEED_MEASURED, SPEED_WEAK)
    estimates = {"sound_speed": Estimate(float(speed), sigma, sigma * factor, "m/s", status)}
    patch: dict[str, float] = {} if status == "held" else {"sound_speed_m_s": round(float(speed), 3)}
    if known_delay:
        estimates["delay"] = Estimate(couplant.delay_us, np.inf, np.inf, "us", "held")
    else:
        error = float(np.sqrt(covariance[1, 1]))
        delay_status = _status(error, DELAY_MEASURED_US, DELAY_WEAK_US)
        estimates["delay"] = Estimate(float(solution[1]), error, error * factor, "us", delay_status)
        if delay_status != "held":
            patch["delay_us"] = round(float(solution[1]), 5)
    rms = float(np.sqrt(np.mean(off**2)))
    moved = "gap_mm" if gap_mm is not None else "step_mm"
    curves = {moved: distance, "echo": number, "expected_us": recorded - off, "residual_us": off}
    issues = tuple(_say(estimates, float(speed), known_delay, moved))
    return Calibration("couplant", estimates, {"couplant": patch} if patch else {}, len(tof), rms, "us", issues, curves)


def _scaled(design: Array) -> Array:
    """Columns of unit length, so that rank is judged apart from units."""
    length = np.linalg.norm(design, axis=0)
    return np.asarray(design / np.where(length > 0.0, length, 1.0))


def _status(error: float, measured: float, weak: float) -> Status:
    return "measured" if error <= measured else "weak" if error <= weak else "held"


def _refuse_odd(number: Array) -> None:
    odd = np.isfinite(number) & ((number < 1.0) | (number != np.rint(number)))
    if odd.any():
        row = int(np.argmax(odd))
        raise fail(
            "couplant-readings",
            f"Column echo, reading {row + 1}: {number[row]:g} is no number of an echo.",
            "Number the echoes 1 (the first), 2, 3 and so on.",
        )


def _refuse_factor(speed: float, believed: float) -> None:
    for factor, word, cause in (
        (0.5, "half", "the readings are second echoes, or echoes are numbered one too low"),
        (2.0, "twice", "the times are one-way, or echoes are numbered one too high"),
    ):
        if abs(speed / (factor * believed) - 1.0) < FACTOR_SHARE:
            raise fail(
                "couplant-readings",
                f"The readings ask for {speed:.0f} m/s, {word} the {believed:.0f} m/s of the setup: probably {cause}.",
                "Give two-way times and number the echoes from 1; if the couplant really has this speed, state "
                "couplant.sound_speed_m_s first.",
            )


def _say(estimates: dict[str, Estimate], speed: float, known_delay: bool, moved: str) -> list[Issue]:
    issues = []
    if known_delay:
        remedy = "Add a second gap, or a repeat echo."
        if moved == "step_mm":
            remedy = "Add a repeat echo, or state the gaps themselves (gap_mm)."
        issues.append(
            Issue(
                "info",
                "couplant-delay-held",
                "The delay stays as it was: these readings cannot tell it from the distance.",
                remedy,
            )
        )
    for name, estimate in estimates.items():
        if estimate.status != "measured" and np.isfinite(estimate.sigma):
            text = (
                f"The {name.replace('_', ' ')} is {estimate.status}: +-{estimate.half_95:.3g} {estimate.unit} (95 %)."
            )
            issues.append(
                Issue("warning", f"couplant-{estimate.status}", text, "Take gaps farther apart, or more readings.")
            )
    low, high = water_speed_m_s(0.0), water_speed_m_s(74.0)
    if low < speed < high:
        # Marczak's polynomial rises up to 74 deg C.
        temperature = brentq(lambda t: water_speed_m_s(t) - speed, 0.0, 74.0)
        text = f"Pure water has this speed at {temperature:.1f} deg C."
        issues.append(Issue("info", "couplant-temperature", text, "Compare it with the thermometer."))
    return issues
