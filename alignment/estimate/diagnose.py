"""Wrong inputs, recognised and named; and what limits a result that is right."""

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.capture import Captured, capture
from alignment.estimate.contest import fits_better
from alignment.estimate.edge_diagnose import edge_issues, order_by_edges
from alignment.estimate.hypotheses import Hypothesis, array_hypotheses, place_hypotheses, thinned
from alignment.estimate.map import MapFit
from alignment.estimate.problem import Problem
from alignment.estimate.readings import model_readings, reading_weights
from alignment.estimate.robust import mad_sigma
from alignment.estimate.surface_rows import Rows, distance_rows
from planner.couplant import sound_speed_m_s, water_speed_m_s
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.setup import Setup

SAMPLE = 1200
# A reading of the scan fits if this share of it is on the surface, and agrees with it to this (mm, robust).
FITS_SHARE = 0.6
FITS_MM = 0.4
# Another explanation has to be this much better than the given one.
BETTER = 0.5
# Of a scan that fits far from nominal, one that fits nearly as well and near is the likelier.
NEARLY = 2.5
# Farther than this from nominal, in standard deviations of the fixture, is no explanation.
LIKELY = 4.0
# A fit with this robust scatter (mm) is suspicious, and so is one with so few readings on the surface.
SUSPICIOUS_MM = 0.3
SUSPICIOUS_SHARE = 0.5
# Change of the speed of sound that is worth a word: two degrees of water.
SPEED_SHARE = 0.004
# More than this is no couplant of ultrasound, and a speed that is wrong explains at least so much of the misfit.
MOST_SPEED_SHARE, EXPLAINED = 0.5, 0.6
# Standoffs that differ by less than this, beyond what a misplaced part makes of one, tell nothing about it (mm rms).
LEAST_STANDOFF_SPREAD_MM = 1.0
CHORD_MM, CHORD_DEG = 0.01, 0.1


def diagnose_lost(cloud: PointCloud, problem: Problem, captured: Captured) -> list[Issue]:
    """Return why nothing could be estimated."""
    found = _best(cloud, problem, np.inf, [*place_hypotheses(problem.setup), *array_hypotheses(problem.setup)])
    if found is not None:
        return [Issue("error", found.code, found.message, found.remedy, "scan")]
    share = captured.valid_share
    return [
        Issue(
            "error",
            "scan-not-on-part",
            f"the scan does not fit the inspection surface: {share:.0%} of its readings meet it, and no fit settles.",
            "Check that this is a scan of this part, in the BASE it was planned in, and with the same setup.",
            "scan",
        )
    ]


def diagnose_fit(cloud: PointCloud, problem: Problem, found: MapFit) -> list[Issue]:
    """Return what another reading of the scan would explain better, and what else is odd about a fit."""
    r = found.rows.r[found.used]
    sigma = mad_sigma(r, 1e-3, about_zero=True)
    share = found.captured.valid_share
    issues: list[Issue] = []
    hypotheses = list(array_hypotheses(problem.setup))
    lost = sigma > SUSPICIOUS_MM or share < SUSPICIOUS_SHARE
    if lost or _beyond_limits(found, problem):
        hypotheses += place_hypotheses(problem.setup)
    # Of a part that sprang back the careful fit may leave more than the quick one: what counts is what fits at all.
    scatter = found.captured.scatter_mm if found.captured.converged else sigma
    better = _best(cloud, problem, scatter, hypotheses, _beyond_limits(found, problem), found.T_base_part)
    if better is None:
        better = order_by_edges(cloud, problem, found, hypotheses)
    if better is not None:
        # A scan that fits as it stands, only far from nominal, may be just that: two readings of it are possible, and
        # the engineer who knows the fixture decides.
        doubt = _beyond_limits(found, problem) and not lost
        text = f"the part is far from its nominal place; or else {better.message}" if doubt else better.message
        issues.append(Issue("warning" if doubt else "error", better.code, text, better.remedy, "scan"))
    valid = int(found.rows.valid.sum())
    kept = int(found.used.sum())
    if valid and kept < 0.6 * valid:
        issues.append(
            Issue(
                "error",
                "scan-of-another-part",
                f"only {kept} of {valid} patches of the scan agree with the part's surface.",
                "Check that this is a scan of this part.",
                "scan",
            )
        )
    return issues + edge_issues(found, problem.setup) + speed_issues(found, problem)


def _beyond_limits(found: MapFit, problem: Problem) -> bool:
    total = np.abs(problem.total(found.T_base_part))
    return bool(total.max() > 3.0)


def _best(
    cloud: PointCloud,
    problem: Problem,
    scatter_mm: float,
    hypotheses: list[Hypothesis],
    far: bool = False,
    T_base_part: Transform | None = None,
) -> Hypothesis | None:
    """Return the hypothesis that fits best, if it fits well and clearly better than the scan as given.

    far: the scan as given fits, but far from nominal; then one that fits as well and near counts too. T_base_part: where the
    scan as given puts the part; then another order of laws that fits better all along the scan counts too.
    """
    small = thinned(cloud, SAMPLE)
    given = capture(small, problem) if T_base_part is not None else None
    best, chosen = np.inf, None
    for hypothesis in hypotheses:
        other = hypothesis.apply(small)
        found = capture(other, problem)
        if not found.converged or found.valid_share < FITS_SHARE or found.scatter_mm > FITS_MM:
            continue
        away = float(np.abs(problem.total(found.T_base_part)).max())
        # Poses that follow the part fit it wherever they are put along the normal: an explanation must be likely, too.
        if away > LIKELY:
            continue
        near = far and away < 2.0
        wanted = NEARLY * scatter_mm if near else BETTER * scatter_mm
        if given is not None and hypothesis.of_laws and found.scatter_mm >= wanted:
            as_given = _residuals(small, problem, given.T_base_part)
            if fits_better(as_given, _residuals(other, problem, found.T_base_part), found.scatter_mm):
                wanted = np.inf
        if found.scatter_mm < min(best, wanted):
            best, chosen = found.scatter_mm, hypothesis
    return chosen


def _residuals(cloud: PointCloud, problem: Problem, T_base_part: Transform) -> Array:
    """Return the residuals (n,) of the readings that were heard, in mm, nan off the surface."""
    rows = _rows(cloud, problem, T_base_part)
    return np.where(rows.valid, rows.r, np.nan)[reading_weights(cloud) > 0]


def _rows(cloud: PointCloud, problem: Problem, T_base_part: Transform) -> Rows:
    origins, distance = model_readings(cloud, problem.setup.alignment.point_model)
    return distance_rows(
        problem.curved, T_base_part, problem.centre_mm(T_base_part), origins, distance, cloud.beams_base
    )


def speed_issues(found: MapFit, problem: Problem) -> list[Issue]:
    """Return a warning where two standoffs show that the speed of sound is not the one believed.

    A wrong speed scales every distance. On one standoff that is a shift along the beam; on two it is not.
    """
    if problem.setup.alignment.point_model != "perpendicular" or not found.used.any():
        return []
    patches, used = found.patches, found.used
    d, design = patches.distance_mm[used], found.rows.jacobian[used] * problem.prior_sigma
    apart = d - design @ np.linalg.lstsq(design, d, rcond=None)[0]
    if float(apart.std()) < LEAST_STANDOFF_SPREAD_MM:
        return []
    x, r = np.column_stack([design, d]), found.rows.r[used]
    # Neighbouring patches share the robot's error: as many count as one as there are in its correlation length, both ways.
    shared = float(np.clip(found.noise.named()["path_length_mm"], 5.0, 40.0))
    left = r - x @ np.linalg.lstsq(x, r, rcond=None)[0]
    variance = shared * mad_sigma(left, 0.01, about_zero=True) ** 2
    information = x.T @ x / variance + np.diag(np.r_[np.ones(6), 1e-6])
    scale = -np.linalg.solve(information, x.T @ r / variance)[6]
    deviation = float(np.sqrt(np.linalg.inv(information)[6, 6]))
    plain = r - design @ np.linalg.lstsq(design, r, rcond=None)[0]
    # A part that is not as its CAD has distances of its own, which no speed explains: then r is d, or little is explained.
    explained = abs(scale) < MOST_SPEED_SHARE and mad_sigma(left, 0.0) < EXPLAINED * mad_sigma(plain, 0.0)
    if not explained or abs(scale) < max(SPEED_SHARE, 4.0 * deviation):
        return []
    speed = sound_speed_m_s(problem.setup.couplant) * (1.0 + scale)
    return [
        Issue(
            "warning",
            "sound-speed-wrong",
            f"distances at different standoffs fit a speed of sound of {speed:.0f} m/s, not "
            f"{sound_speed_m_s(problem.setup.couplant):.0f} m/s.",
            "Measure the temperature of the couplant, or set couplant.sound_speed_m_s.",
            "setup.json: couplant",
        )
    ]


def temperature_issue(setup: Setup) -> list[Issue]:
    """Return what the couplant's temperature is worth along the beam: a scan at one standoff cannot tell."""
    couplant, standoff = setup.couplant, setup.alignment_standoff_mm
    if couplant.sound_speed_m_s is not None:
        per = standoff / couplant.sound_speed_m_s
        text = f"Z rests on the speed of sound given: 1 m/s is {per:.4f} mm at {standoff:g} mm standoff."
    else:
        t = couplant.temperature_c
        slope = (water_speed_m_s(t + 0.5) - water_speed_m_s(t - 0.5)) / water_speed_m_s(t)
        text = (
            f"Z rests on the couplant's temperature of {t:g} deg C: 1 deg C is {slope * standoff:.3f} mm at "
            f"{standoff:g} mm standoff."
        )
    return [Issue("info", "couplant-temperature", text, "Measure it at the nozzle.", "setup.json: couplant")]


def floor_issues(problem: Problem) -> list[Issue]:
    """Return where the tessellation, not the scan, limits the result."""
    chord, angle = problem.curved.chord_error_mm, problem.curved.chord_angle_deg
    if chord <= CHORD_MM and angle <= CHORD_DEG:
        return []
    return [
        Issue(
            "info",
            "tessellation-coarse",
            f"the CAD's triangles stand up to {chord:.3f} mm and {angle:.2f} deg off the smooth surface that was fitted "
            "to them; no accuracy below what that fit recovers can be claimed.",
            "Export the CAD with a finer tessellation if this matters.",
            "part",
        )
    ]
