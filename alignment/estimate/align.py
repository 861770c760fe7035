"""`align`: a point cloud and a plan in, a `Correction` with its verdict out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.correction import AxisResult, Correction, Method, Residual
from alignment.estimate.capture import Captured
from alignment.estimate.diagnose import diagnose_fit, diagnose_lost, floor_issues, temperature_issue
from alignment.estimate.directions import directions, named_statuses
from alignment.estimate.keypoint_method import KeyPointFit, KeyPointMatch, align_keypoints, match_keypoints
from alignment.estimate.locks import lock_issues
from alignment.estimate.map import align_map, condense_cloud
from alignment.estimate.motion import motion_rows, named_axes
from alignment.estimate.outlook import after_correction
from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.robust import mad_sigma
from alignment.estimate.surface_rows import Rows, patch_rows
from alignment.estimate.verdict import direction_issues, limit_issues, nominal_shift, residual_issues, verdict_of
from alignment.metrics import expected
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

LEAST_PATCHES = 6
LEAST_READINGS = 30
SIGMA_FLOOR_MM = 0.01
# A patch of at least so many readings that scatter by no more than so many of their usual deviation shows the part.
SHAPE_READINGS = 5
SHAPE_SCATTER = 3.0


def align(
    cloud: PointCloud,
    curved: CurvedSurface,
    keypoints: Sequence[KeyPoint],
    setup: Setup,
    inspection: ToolPath | None = None,
    method: Method = "map",
    edges: bool | None = None,
    stay_on_edges: bool = False,
) -> Correction:
    """Return where the part is, how well that is known, and whether a robot may trust it.

    inspection: the path the verdict is about; without it held directions are not judged. edges: use the edges that the
    scan crosses; None: where it crosses any. stay_on_edges: as in `align_map`. A scan that says too little is an answer
    (verdict "fail" with its issues), not an exception.
    """
    problem = Problem(curved, setup)
    baseline = align_keypoints(cloud, curved, keypoints, setup) if keypoints else None
    if method == "keypoints":
        return _by_keypoints(cloud, problem, baseline, inspection)
    found = align_map(cloud, curved, setup, edges is not False, stay_on_edges)
    if isinstance(found, Captured):
        return _nothing(cloud, problem, baseline, found, method)
    issues = [*cloud.issues, *diagnose_fit(cloud, problem, found)]
    strained = lock_issues(found.strain, found.converged, setup.tolerances)
    issues += strained
    if not found.converged and not strained:
        issues.append(
            Issue(
                "error", "no-convergence", "the estimate did not settle.", "Scan more of the surface, and closer to it."
            )
        )
    keyed = match_keypoints(cloud, curved, keypoints, setup, found.T_base_part)
    keyed = tuple(with_residual(k, found.patches, found.rows, found.used, setup) for k in keyed)
    return finish(
        problem, method, found.T_base_part, found.covariance, found.directions, found.patches, found.rows, found.used,
        keyed, issues, inspection, baseline, found.noise.named(), found.edges,
    )  # fmt: skip


def finish(
    problem: Problem,
    method: Method,
    T_base_part: Transform,
    covariance: Array,
    found: tuple,
    patches: Patches,
    rows: Rows,
    used: NDArray[np.bool_],
    keyed: tuple[KeyPointMatch, ...],
    issues: list[Issue],
    inspection: ToolPath | None,
    baseline: KeyPointFit | None,
    noise: dict[str, float],
    edges: dict | None,
) -> Correction:
    """Return the correction of a placement: residuals, limits, directions, outlook and verdict of one plan's surface."""
    setup, curved = problem.setup, problem.curved
    centre = problem.centre_mm(T_base_part)
    T_base_basecorr = problem.T_base_basecorr(T_base_part)
    residual = residual_of(patches, rows, used | shape_of(patches, rows, setup))
    if residual.readings < LEAST_READINGS or used.sum() < LEAST_PATCHES:
        issues.append(_too_few(residual.readings))
    shift_mm, turn_deg = nominal_shift(setup, T_base_part, curved.surface.centroid_part)
    issues += limit_issues(shift_mm, turn_deg, setup)
    said = residual_issues(residual.rms_mm, setup)
    # Of readings that a lock keeps off the part nothing follows for the part's shape.
    locked_out = any(i.code == "lock-contradicted" for i in issues)
    issues += [i for i in said if i.severity == "error" or not locked_out]
    issues += direction_issues(found, curved, inspection, setup, centre, T_base_part)
    issues += temperature_issue(setup)
    issues += floor_issues(problem)
    axes_map = named_axes(T_base_basecorr, centre)
    statuses = named_statuses(found, axes_map, problem.prior_sigma)
    sigma = np.sqrt(np.diag(axes_map @ covariance @ axes_map.T)) * np.r_[np.ones(3), np.degrees(np.ones(3))]
    before = after = None
    if inspection is not None:
        before = expected(curved, inspection, setup, T_base_part).summary
        after = after_correction(curved, inspection, setup, T_base_part, covariance)
    picked = np.flatnonzero(used)
    return Correction(
        method=method,
        verdict=verdict_of(issues),  # type: ignore[arg-type]
        setup=setup,
        T_base_basecorr=T_base_basecorr,
        covariance=covariance,
        centroid_mm=centre,
        axes=tuple(AxisResult(s, float(v)) for s, v in zip(statuses, sigma, strict=True)),
        directions=found,
        keypoints=keyed,
        residual=residual,
        before=before,
        after=after,
        issues=tuple(issues),
        baseline=baseline_of(problem, baseline),
        noise=noise,
        edges=edges,
        points_base=rows.foot_base[picked],
        deviation_mm=-rows.r[picked],
    )


def shape_of(patches: Patches, rows: Rows, setup: Setup) -> NDArray[np.bool_]:
    """Return the patches (p,) that show the part's shape, whether or not the rigid estimate could use them.

    Bubbles scatter within a patch; a dent moves all of it. What stands off by more than twice the standoff tolerance is
    taken for something else (a clamp, the table).
    """
    agree = patches.scatter_mm < SHAPE_SCATTER * max(patches.sigma_mm, SIGMA_FLOOR_MM)
    near = np.abs(rows.r) < 2.0 * setup.tolerances.standoff_mm
    return rows.valid & agree & near & (patches.count >= SHAPE_READINGS)


def residual_of(patches: Patches, rows: Rows, used: NDArray[np.bool_]) -> Residual:
    """Return the residuals of the readings that the estimate rests on: patch means and the scatter within them."""
    picked = np.flatnonzero(used)
    if len(picked) == 0:
        return Residual(float("nan"), float("nan"), float("nan"), 0)
    r, count, scatter = rows.r[picked], patches.count[picked], patches.scatter_mm[picked]
    rms = float(np.sqrt(np.average(r**2 + scatter**2, weights=count)))
    order = np.argsort(np.abs(r))
    share = np.cumsum(count[order]) / count.sum()
    p95 = float(np.abs(r)[order][np.searchsorted(share, 0.95)])
    kept = np.count_nonzero(patches.kept & used[patches.cells.of_reading])
    # Of very dense scans some readings stand for all.
    return Residual(rms, p95, float(np.abs(r).max()), round(kept * patches.total / len(patches.kept)))


def baseline_of(problem: Problem, baseline: KeyPointFit | None) -> Transform | None:
    """Return the correction that the key-point method asks for, if it finds one."""
    if baseline is None or baseline.T_base_part is None:
        return None
    return problem.T_base_basecorr(baseline.T_base_part)


def with_residual(
    match: KeyPointMatch, patches: Patches, rows: Rows, used: NDArray[np.bool_], setup: Setup
) -> KeyPointMatch:
    """Return the match with the mean residual, along the normal, of the patches around it."""
    if not used.any():
        return match
    near = used & (
        ((rows.foot_base - np.array(match.nominal_base)) ** 2).sum(axis=1) <= setup.alignment.search_radius_mm**2
    )
    if not near.any():
        return match
    return replace(match, residual_mm=float(np.average(rows.r[near], weights=patches.count[near])))


def _by_keypoints(
    cloud: PointCloud, problem: Problem, fit: KeyPointFit | None, inspection: ToolPath | None
) -> Correction:
    if fit is None or fit.T_base_part is None:
        said = (
            fit.issues
            if fit
            else (Issue("error", "no-keypoints", "there are no key points.", "Choose at least three."),)
        )
        return empty(problem, "keypoints", [*cloud.issues, *said], () if fit is None else fit.matches, None)
    T = fit.T_base_part
    centre = problem.centre_mm(T)
    patches = condense_cloud(cloud, problem, T)
    rows = patch_rows(patches, problem.curved, T, centre)
    sigma = mad_sigma(rows.r[rows.valid], SIGMA_FLOOR_MM, about_zero=True)
    used = rows.valid & (np.abs(rows.r) < 5.0 * sigma)
    good = [m for m in fit.matches if m.matched]
    covariance = _keypoint_covariance(good, problem, T, sigma)
    scale = problem.prior_sigma
    none = np.zeros((6, 0))
    found = directions(covariance, none, none.T, scale, problem.moments_base(T), problem.setup.tolerances)
    return finish(
        problem, "keypoints", T, covariance * np.outer(scale, scale), found, patches, rows, used, fit.matches,
        [*cloud.issues, *fit.issues], inspection, fit, {}, None,
    )  # fmt: skip


def _keypoint_covariance(good: list[KeyPointMatch], problem: Problem, T: Transform, sigma_mm: float) -> Array:
    """Return the posterior (6, 6), whitened by the prior, of key points that know their height and hardly their place.

    Along the surface a matched point is the middle of its search volume, wherever the part is: its deviation is that of
    the volume, not the residual. The paper states no uncertainty.
    """
    radius = problem.setup.alignment.search_radius_mm
    points = np.array([m.point_base for m in good])
    normals = np.array([m.normal_base for m in good])
    information = np.eye(6)
    for axis in np.eye(3):
        x = motion_rows(points, np.tile(axis, (len(points), 1)), problem.centre_mm(T)) * problem.prior_sigma
        information += x.T @ x / radius**2
    x = motion_rows(points, normals, problem.centre_mm(T)) * problem.prior_sigma
    information += x.T @ x * (1.0 / sigma_mm**2 - 1.0 / radius**2)
    return np.asarray(np.linalg.inv(information))


def _nothing(
    cloud: PointCloud, problem: Problem, baseline: KeyPointFit | None, captured: Captured, method: Method
) -> Correction:
    issues = [*cloud.issues, *diagnose_lost(cloud, problem, captured)]
    return empty(problem, method, issues, () if baseline is None else baseline.matches, baseline_of(problem, baseline))


def empty(
    problem: Problem,
    method: Method,
    issues: list[Issue],
    matches: tuple[KeyPointMatch, ...],
    baseline: Transform | None,
) -> Correction:
    """Return the failed correction of readings that determine nothing."""
    return Correction(
        method, "fail", problem.setup, None, None, None, (), (), matches, None, None, None, tuple(issues), baseline
    )


def _too_few(readings: int) -> Issue:
    return Issue(
        "error",
        "readings-too-few",
        f"only {readings} readings lie on the inspection surface.",
        "Scan more of the surface; check gate, delay and standoff.",
    )
