"""How smooth the field is, and whether there is one: marginal likelihood with and without it, noise refitted in both."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from alignment.estimate.noise_prior import noise_prior
from alignment.non_rigid.covariance import ACROSS, ALONG, FIELD, NOISE, NodeCovariance, surface_axes
from alignment.non_rigid.nodes import Nodes
from planner.frames import Array

STEPS = 60
# The field's size before a reading was seen: a tenth of a millimetre, or a tenth or ten times of that.
FIELD_MM, FIELD_SPREAD = 0.1, 2.3
LENGTH_SHARE, LENGTH_SPREAD = 0.4, 1.0
# Lengths searched: from twice the distance of nodes to this many sizes of the part.
LONGEST = 1.5
# What stays the same over a longer path than this (mm) will be there again on the next one, part or robot, and is worth
# following; only what is forgotten sooner is noise.
FORGOTTEN_MM = 300.0
STARTS = ((0.2, 0.2), (0.2, 1.0), (1.0, 0.3), (1.0, 1.0))


@dataclass(frozen=True, eq=False)
class Evidence:
    """theta (8,): mode with a field; without (8,): mode of the noise alone, whose last three mean nothing.

    axes (3, 3): along which the lengths count.

    gain: how much larger the logarithm of the posterior density is with the field than without.
    """

    theta: Array
    without: Array
    axes: Array
    gain: float


def weigh(nodes: Nodes, size_mm: float, swath_mm: float) -> Evidence:
    """Return what the nodes say of field and noise."""
    axes = surface_axes(nodes.points_part)
    covariance = NodeCovariance(nodes, axes)
    extent = np.ptp(nodes.points_part @ axes[:, :2], axis=0)
    prior = noise_prior(nodes.scatter_mm, size_mm, swath_mm)
    centre = np.r_[prior.centre[list(NOISE)], np.log(FIELD_MM), np.log(LENGTH_SHARE * extent)]
    below = np.r_[prior.below[list(NOISE)], FIELD_SPREAD, LENGTH_SPREAD, LENGTH_SPREAD]
    above = np.r_[prior.above[list(NOISE)], FIELD_SPREAD, LENGTH_SPREAD, LENGTH_SPREAD]
    spread = float(np.clip(np.std(nodes.deviation_mm), 1e-3, 1e2))
    noise = [0, 1, 2, 3, 4] if nodes.track.known else [0]
    low, high = centre - 6.0 * below, centre + 6.0 * above
    high[2:4] = np.log(FORGOTTEN_MM)
    shortest = min(2.0 * nodes.size_mm, 0.3 * size_mm)
    low[ALONG:], high[ALONG:] = np.log(shortest), np.log(LONGEST * size_mm)

    def climb(start: Array, active: list[int]) -> tuple[Array, float]:
        def cost(u: Array) -> tuple[float, Array]:
            theta = start.copy()
            theta[active] = u
            value, slope = _log_likelihood(covariance, theta, active)
            width = np.asarray(np.where(theta < centre, below, above))[active]
            off = (u - centre[active]) / width
            return -value + 0.5 * float(off @ off), -slope + off / width

        begin = np.clip(start, low, high)[active]
        best = minimize(
            cost, begin, jac=True, method="L-BFGS-B", bounds=list(zip(low[active], high[active], strict=True)),
            options={"maxiter": STEPS, "ftol": 1e-6},
        )  # fmt: skip
        theta = start.copy()
        theta[active] = best.x
        return theta, -float(best.fun)

    without, alone = climb(centre, noise)
    best, top = without, -np.inf
    for shares in STARTS:
        start = centre.copy()
        start[FIELD], start[ALONG:] = np.log(spread), np.log(np.array(shares) * extent)
        theta, value = climb(start, [*noise, FIELD, ALONG, ACROSS])
        if value > top:
            best, top = theta, value
    return Evidence(best, without, axes, top - alone)


def _log_likelihood(covariance: NodeCovariance, theta: Array, active: list[int]) -> tuple[float, Array]:
    """Return the logarithm of the marginal likelihood, but for a constant, and its slope by the active logarithms."""
    k, by = covariance.noise(theta)
    if FIELD in active:
        field, more = covariance.field(theta)
        k, by = k + field, [*by, *more]
    k = k + covariance.rigid
    try:
        factor = cho_factor(k, lower=True, check_finite=False)
    except np.linalg.LinAlgError:
        return -1e12, np.zeros(len(active))
    y = covariance.nodes.deviation_mm
    alpha = cho_solve(factor, y, check_finite=False)
    inverse = cho_solve(factor, np.eye(len(y)), check_finite=False)
    value = -np.log(np.diag(factor[0])).sum() - 0.5 * float(y @ alpha)
    slope = np.array([0.5 * (alpha @ d @ alpha - np.vdot(inverse, d)) for d in by])
    return float(value), slope
