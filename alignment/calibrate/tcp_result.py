"""From an estimate of the TCP's error to statuses, sentences and the patch: the same for every target."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from alignment.calibrate.result import Estimate, Status, factor_95
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.probe import tool_axes
from planner.setup import Pose, Setup

AXES = ("c", "b", "a", "x", "y", "z")
# What may be wrong with a taught TCP before anything is measured, one sigma: turns (rad), shifts (mm).
PRIOR = np.r_[np.full(3, np.radians(1.5)), np.full(3, 2.0)]
HELD_SHARE, HELD_ROW = 0.5, 0.25
MEASURED = np.r_[np.full(3, np.radians(0.05)), np.full(3, 0.1)]


def split_held(covariance: Array) -> tuple[Array, Array]:
    """Return (kept, held): directions (6, k) and (6, 6 - k), orthonormal in prior standard deviations.

    covariance (6, 6): posterior of the TCP's error (rad, mm). Held is a direction whose sigma stays above half of the
    prior's.
    """
    values, vectors = np.linalg.eigh(covariance / np.outer(PRIOR, PRIOR))
    held = np.sqrt(np.maximum(values, 0.0)) > HELD_SHARE
    return vectors[:, ~held], vectors[:, held]


def tcp_estimates(
    error: Array, covariance: Array, held: Array, dof: float, advice: Mapping[str, str]
) -> tuple[dict[str, Estimate], list[Issue]]:
    """Return the estimate of each axis (c, b, a in deg; x, y, z in mm) and what to say of those not measured.

    error (6,), covariance (6, 6): rad and mm. held (6, h): from `split_held`. advice: a remedy per axis.
    """
    row = np.linalg.norm(held, axis=1)
    estimates, issues = {}, []
    for i, axis in enumerate(AXES):
        scale, unit = (180.0 / np.pi, "deg") if i < 3 else (1.0, "mm")
        sigma = float(np.sqrt(covariance[i, i]))
        status: Status = "held" if row[i] > HELD_ROW else "measured" if sigma <= MEASURED[i] else "weak"
        if status == "held":
            sigma = float(PRIOR[i])
        estimates[axis] = Estimate(float(error[i] * scale), sigma * scale, sigma * scale * factor_95(dof), unit, status)
        if status != "measured":
            issues.append(_say(axis, estimates[axis], advice[axis]))
    return estimates, issues


def tcp_patch(error: Array, setup: Setup) -> dict[str, dict[str, dict[str, float]]]:
    """Return the patch of `setup.json`: `tool.tcp` of the tool as taught with the error of EchoBase's TCP applied."""
    axes = tool_axes(setup.tool)
    turn = Transform.from_parts("tcp", "tcp", Rotation.from_rotvec(error[:3]), error[3:])
    tcp = Pose.of(setup.tool.tcp.transform("flange", "tcp") @ axes @ turn @ axes.inv())
    return {"tool": {"tcp": {k: round(v, 6) for k, v in tcp.model_dump().items()}}}


def _say(axis: str, estimate: Estimate, advice: str) -> Issue:
    if estimate.status == "held":
        return Issue(
            "info", "tcp-held", f"{axis.upper()} of the TCP stays as taught: these poses do not show it.", advice, axis
        )
    text = f"{axis.upper()} of the TCP is known to +-{estimate.half_95:.3g} {estimate.unit} (95 %) only."
    return Issue("warning", "tcp-weak", text, advice, axis)
