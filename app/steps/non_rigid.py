"""The part that sprang back: the field behind a rigid alignment, for its prediction, and for the poses where asked for."""

import io
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from alignment.cloud import PointCloud
from alignment.correction import Correction
from alignment.estimate.align import residual_of
from alignment.estimate.verdict import limit_issues, nominal_shift, residual_issues, verdict_of
from alignment.metrics import Expected, expected
from alignment.metrics.figures import WITHIN_DB
from alignment.non_rigid import Field, FieldFit, LeftOver, SprungSurface, fit_field, left_over
from app.plan import Plan
from app.steps.left import REST, STEP, left_issues, left_json, with_left, with_shape
from planner.checks import check
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.path.adapt import adapt
from planner.path.decimate import decimate
from planner.placement import assume_nominal, correction, part_from_correction
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

PARTIAL = ("not-rigid", "harmful", "lock-contradicted", "off-edges", "non-rigid-support")
# So many times beyond `tolerances.standoff_mm` and, at once, `tolerances.tilt_deg` no part springs back: another part does.
ANOTHER_MM, ANOTHER_DEG = 2.5, 3.0
# A rigid alignment promises to follow no shape: only a step of so many `tolerances.position_mm` has to be accepted.
MUCH = 3.0
# What a rigid verdict says of the misfit; said again of what is left after the field.
ABOUT_MISFIT = ("not-rigid", "residual-large", "limit-displacement", "limit-rotation", "scan-of-another-part")
# Share of the inspection's data poses that must stand where the data determine the field.
ENOUGH_POSES = 0.99
# Share of the patches on the surface that must agree with the deformed part.
ENOUGH_PATCHES = 0.6


@dataclass(frozen=True, eq=False)
class Followed:
    """found: the correction, with the field in it if it was applied. dense, sent: inspection path and its decimation.

    before, keyed, after: what the inspection sees of the part as measured: uncorrected, corrected by the key-point
    method's answer (None where it has none), and by `found`. deviation_after_mm (p,): rest at `found.points_base`.
    field_npz: the field as an artifact, or None.
    """

    found: Correction
    dense: ToolPath
    sent: ToolPath
    adapted: bool
    before: Expected | None
    keyed: Expected | None
    after: Expected | None
    deviation_after_mm: Array
    field_npz: bytes | None


def follow(plan: Plan, cloud: PointCloud, found: Correction, adapt_poses: bool) -> Followed:
    """Return what the inspection will meet, with the part's shape in it; poses follow it if `adapt_poses`."""
    if found.T_base_basecorr is None:
        return Followed(found, plan.inspection, plan.inspection, False, None, None, None, found.deviation_mm, None)
    T = part_from_correction(found.T_base_basecorr, plan.setup.T_base_partnom)
    fit = fit_field(cloud, plan.curved, plan.setup, T, found.directions if adapt_poses else ())
    left = left_over(cloud, plan.curved, plan.setup, fit.T_base_part, fit.field)
    if fit.field is None:
        if adapt_poses:
            found = _refused(plan, found, fit, left)
        elif fit.seen:
            found = replace(found, issues=(*found.issues, unfollowed(fit)))
        found = _left_said(found, left, plan, adapt_poses)
        return _rigid(plan, found, plan.curved, T, None, left)
    if adapt_poses:
        return _adapted(plan, found, fit, fit.field, left)
    found = _misfit_said(found, fit, plan)
    found = replace(
        found,
        non_rigid=figures(fit, fit.field)
        | left_json(left, plan.inspection)
        | {"applied": False, "reason": "aligned as a rigid part"},
    )
    found = _left_said(found, left, plan, False)
    return _rigid(plan, found, SprungSurface(plan.curved, fit.field), T, fit.field, left)


def _left_said(found: Correction, left: LeftOver | None, plan: Plan, adapt_poses: bool) -> Correction:
    """Return the rigid correction with what the scan shows beyond it."""
    new = left_issues(left, plan.setup)
    if {i.code for i in found.issues} & {"not-rigid", "residual-large", "sprung-back-unfollowed"}:
        new = [i for i in new if i.code == STEP]
    issues = [*found.issues, *new]
    much = MUCH * plan.setup.tolerances.position_mm
    steps = left is not None and bool(left.steps.found) and (adapt_poses or left.steps.found[0].height_mm > much)
    slow = left is not None and adapt_poses and left.slow_rms_mm > plan.setup.tolerances.position_mm
    partial = [*PARTIAL, *([STEP] if steps else []), *([REST] if slow else [])]
    worse = found.verdict == "pass" and verdict_of(issues, partial) == "partial"
    return replace(found, issues=tuple(issues), verdict="partial" if worse else found.verdict)


def _misfit_said(found: Correction, fit: FieldFit, plan: Plan) -> Correction:
    """Return the rigid correction with the misfit of all that is the part's, also what its robust fit left out (a dent)."""
    all_of_it = residual_of(fit.patches, fit.rows, fit.used)
    known = {i.code for i in found.issues}
    new = [i for i in residual_issues(all_of_it.rms_mm, plan.setup) if not known & {i.code, "residual-large"}]
    if not new and not known & {"not-rigid", "residual-large"}:
        largest = float(np.abs(fit.rows.r[fit.used]).max())
        new = [
            Issue(
                "warning",
                "sprung-back",
                f"the part differs smoothly from its CAD, by up to {largest:.2f} mm where it was scanned; the prediction "
                "after the correction takes it into account.",
                "Run the alignment as non-rigid to follow its shape.",
                "scan",
            )
        ]
    issues = [*found.issues, *new]
    return replace(found, issues=tuple(issues), verdict=verdict_of(issues))  # type: ignore[arg-type]


def _rigid(
    plan: Plan, found: Correction, surface: CurvedSurface, T: Transform, field: Field | None, left: LeftOver | None
) -> Followed:
    before, after = _seen(plan, surface, plan.inspection, T, field, left)
    # Of a part true to CAD the estimate's own error is all that is left, and `align` foresaw that; a field outweighs it.
    if field is None and found.after is not None:
        after = replace(after, summary=with_shape(found.after, after.summary, left))
    found = replace(found, before=before.summary, after=after.summary)
    npz = None if field is None else field_npz(field, plan.curved)
    sent = decimate(plan.inspection)
    keyed = _keyed(plan, found, surface, T, field, left)
    return Followed(found, plan.inspection, sent, False, before, keyed, after, found.deviation_mm, npz)


def _seen(
    plan: Plan,
    surface: CurvedSurface,
    path: ToolPath,
    T_base_part: Transform,
    field: Field | None,
    left: LeftOver | None,
) -> tuple[Expected, Expected]:
    setup = plan.setup
    nominal = assume_nominal(setup.T_base_partnom)
    before = expected(surface, plan.inspection, setup, T_base_part)
    after = expected(surface, path, setup, nominal)
    return _doubted(plan, before, field, left), _doubted(plan, after, field, left)


def _keyed(
    plan: Plan,
    found: Correction,
    surface: CurvedSurface,
    T_base_part: Transform,
    field: Field | None,
    left: LeftOver | None,
) -> Expected | None:
    """Return what the inspection sees if it runs in the BASE that the key-point method asks for."""
    if found.baseline is None:
        return None
    lies = Transform("base", "part", (found.baseline.inv() @ T_base_part).rigid)
    return _doubted(plan, expected(surface, plan.inspection, plan.setup, lies), field, left)


def _doubted(plan: Plan, seen: Expected, field: Field | None, left: LeftOver | None) -> Expected:
    """Return what is seen, with what the scan shows beyond it, and with the field's own standard deviations in its summary.

    Spread and range are of the poses that stand where the scan went, if anything is left there that counts: what lies between
    its passes is not known. A slope known to s (of each of two directions) adds k s^2 per axis to the loss to be expected.
    """
    poses = plan.inspection.take(plan.inspection.is_data)
    on = seen.on_part & np.isfinite(seen.distance_mm)
    if not on.any():
        return seen
    places = poses.Ts_part_contact.xyz_mm
    known = on
    if left is not None and left.counts:
        seen, known = with_left(seen, left, places, on)
    if field is None or field.support is None:
        return seen
    at = field.support.nearest(places)
    d, s = seen.distance_mm[known], field.support.sigma_mm[at][known]
    slope_deg = np.degrees(field.support.slope_rad[at][on])
    loss = plan.setup.probe.tilt_loss_db_per_deg2
    db = seen.db[on] - (loss.b + loss.c) * slope_deg**2
    summary = replace(
        seen.summary,
        tof_std_mm=float(np.hypot(seen.summary.tof_std_mm, np.sqrt(np.mean(s**2)))),
        tof_range_mm=float((d + s).max() - (d - s).min()),
        tilt_max_deg=float(np.hypot(seen.tilt_deg[on], slope_deg).max()),
        within_2db=float((db >= -WITHIN_DB).mean()),
        mean_abs_db=float(np.abs(db).mean()),
    )
    return replace(seen, summary=summary)


def unfollowed(fit: FieldFit) -> Issue:
    """Return what to say of a shape that single passes show and no other pass foretells: a dent between two of them."""
    largest = float(np.abs(fit.rows.r[fit.used]).max())
    return Issue(
        "warning",
        "sprung-back-unfollowed",
        f"the part differs smoothly from its CAD, by up to {largest:.2f} mm where it was scanned, but {fit.reason}: the "
        "prediction after the correction leaves it out.",
        "Scan with passes closer together (the inspection path itself will do), and align as non-rigid.",
        "scan",
    )


def _refused(plan: Plan, found: Correction, fit: FieldFit, left: LeftOver | None) -> Correction:
    steps = left is not None and bool(left.steps.found)
    reason = f"besides steps, {fit.reason}" if steps else fit.reason
    issue = Issue(
        "info",
        "non-rigid-refused",
        f"no deformation is followed: {reason}.",
        "The rigid correction stands; scan more passes if the part is known to have sprung back.",
        "scan",
    )
    if fit.seen:
        issue = unfollowed(fit)
    record = {"applied": False, "reason": reason, "evidence": fit.gain, **left_json(left, plan.inspection)}
    return replace(found, non_rigid=record, issues=(*found.issues, issue))


def _adapted(plan: Plan, found: Correction, fit: FieldFit, field: Field, left: LeftOver | None) -> Followed:
    setup, T = plan.setup, fit.T_base_part
    surface = SprungSurface(plan.curved, field)
    dense = adapt(plan.inspection, plan.curved, field)
    sent = decimate(dense)
    before, after = _seen(plan, surface, dense, T, field, left)
    keyed = _keyed(plan, found, surface, T, field, left)
    residual = residual_of(fit.patches, replace(fit.rows, r=fit.rest_mm), fit.used)
    T_base_basecorr = correction(T, setup.T_base_partnom)
    issues = [_of_shape(i) for i in found.issues if i.code not in ABOUT_MISFIT]
    issues += limit_issues(*nominal_shift(setup, T, plan.surface.centroid_part), setup)
    issues += residual_issues(residual.rms_mm, setup)
    issues += _shape_issues(plan, fit, field)
    issues += [
        i for i in left_issues(left, setup) if i.code == STEP or residual.rms_mm <= 3.0 * setup.tolerances.position_mm
    ]
    issues += [
        replace(i, where=f"corrected: {i.where}" if i.where else "corrected")
        for i in check(surface, sent, setup).issues
        if i.severity == "error"
    ]
    picked = np.flatnonzero(fit.used)
    found = replace(
        found,
        verdict=verdict_of(issues, (*PARTIAL, STEP)),  # type: ignore[arg-type]
        T_base_basecorr=T_base_basecorr,
        centroid_mm=T.points(plan.surface.centroid_part),
        residual=residual,
        before=before.summary,
        after=after.summary,
        issues=tuple(issues),
        non_rigid=figures(fit, field) | left_json(left, plan.inspection) | {"applied": True, "reason": None},
        points_base=fit.rows.foot_base[picked],
        deviation_mm=-fit.rows.r[picked],
    )
    npz = field_npz(field, plan.curved)
    return Followed(found, dense, sent, True, before, keyed, after, -fit.rest_mm[picked], npz)


def _of_shape(issue: Issue) -> Issue:
    """Return what a rigid fit said of edges and of itself with the remedy that is left once the shape is followed."""
    if issue.code == "no-convergence":
        return replace(
            issue,
            remedy="Check that this is a scan of this part; if it is, scan more of the surface, and across its edges.",
        )
    if issue.code != "off-edges":
        return issue
    remedy = "The shape is followed along the normal only: in the plane trust the correction no better than this."
    return replace(issue, remedy=remedy)


def _shape_issues(plan: Plan, fit: FieldFit, field: Field) -> list[Issue]:
    """Return what stands in the way of trusting the field: no part springs back like that, too little of the scan agrees, or
    poses stand beyond it."""
    out = _another_part(plan, fit, field)
    valid, kept = int(fit.rows.valid.sum()), int(fit.used.sum())
    if kept < ENOUGH_PATCHES * valid:
        out.append(
            Issue(
                "error",
                "scan-of-another-part",
                f"only {kept} of {valid} patches of the scan agree with the part, deformed or not.",
                "Check that this is a scan of this part.",
                "scan",
            )
        )
    poses = plan.inspection.take(plan.inspection.is_data)
    assert field.support is not None
    on = field.support.covers(poses.Ts_part_contact.xyz_mm)
    if on.mean() >= ENOUGH_POSES:
        return out
    out.append(
        Issue(
            "warning",
            "non-rigid-support",
            f"the scan determines the deformation over {field.support.share:.0%} of the surface; {int((~on).sum())} of "
            f"{len(on)} inspection poses stand beyond, where they go back to the rigid part.",
            "Add key points or passes there and scan again.",
            "alignment",
        )
    )
    return out


def _another_part(plan: Plan, fit: FieldFit, field: Field) -> list[Issue]:
    """Return an error where the shape to be followed is another part's: a smooth field explains the difference of any two."""
    assert fit.samples is not None
    assert field.support is not None
    inside, t = field.support.inside, plan.setup.tolerances
    if not inside.any():
        return []
    f, g = field.on(fit.samples.face[inside], fit.samples.bary[inside])
    off_mm, slope_deg = float(np.abs(f).max()), float(np.degrees(np.linalg.norm(g, axis=1).max()))
    if off_mm <= ANOTHER_MM * t.standoff_mm or slope_deg <= ANOTHER_DEG * t.tilt_deg:
        return []
    return [
        Issue(
            "error",
            "scan-of-another-part",
            f"wherever it is put, the part scanned stands up to {off_mm:.1f} mm off the CAD, with slopes up to {slope_deg:.1f} "
            "deg: that is another part's shape rather than spring-back.",
            "Check that this is a scan of this part, in its unit and BASE; if the part does spring back that far, raise "
            "tolerances.standoff_mm and tolerances.tilt_deg.",
            "scan",
        )
    ]


def figures(fit: FieldFit, field: Field) -> dict[str, Any]:
    """Return what correction.json says of a field. Displacements are those beyond what BASE takes up, mm."""
    assert fit.samples is not None
    assert field.support is not None
    around = fit.samples
    f, g = field.on(around.face, around.bary)
    inside = field.support.inside
    sigma = field.support.sigma_mm[inside] if inside.any() else field.support.sigma_mm
    along, across = field.lengths_mm
    return {
        "field_rms_mm": float(np.sqrt(np.mean(f**2))),
        "field_max_mm": float(np.abs(f).max()),
        "slope_max_deg": float(np.degrees(np.linalg.norm(g, axis=1).max())),
        "length_mm": float(min(along, across)),
        "length_along_mm": float(along),
        "length_across_mm": float(across),
        "sigma_max_mm": float(sigma.max()),
        "support_share": field.support.share,
        "evidence": fit.gain,
        "foretold_rms_mm": fit.cv_mm,
        "foretold_rigid_rms_mm": fit.cv_rigid_mm,
    }


def field_npz(field: Field, curved: CurvedSurface) -> bytes:
    """Return the field as arrays (no pickle): at nodes of equal area, and at the vertices of the surface, `part`, mm.

    nodes (m, 3), values (m,), sd (m,), supported (m,). vertices (v, 3), vertex_values (v,).
    """
    assert field.support is not None
    support = field.support
    foot = curved.closest(support.points_part)
    vertices = curved.surface.vertices
    at = curved.closest(vertices)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        nodes=support.points_part,
        values=field.on(foot.face, foot.bary)[0],
        sd=support.sigma_mm,
        supported=support.inside,
        vertices=vertices,
        vertex_values=field.on(at.face, at.bary)[0],
    )
    return buffer.getvalue()
