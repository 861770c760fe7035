"""`align_several`: scans of several surfaces of one part, each with its plan, determine one placement of the part.

The readings of each scan count against the surface of their own plan; motion, fixture prior and noise are common. The prior
is about the area centroid of all surfaces together. What comes back is one `Correction` per plan: the same placement in its
base, the same posterior about its own centroid, and its own surface, path, residuals and verdict.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.correction import AxisResult, Correction
from alignment.estimate.align import baseline_of, empty, finish, residual_of, shape_of, with_residual
from alignment.estimate.capture import Captured, capture_together
from alignment.estimate.diagnose import diagnose_fit, diagnose_lost
from alignment.estimate.directions import Direction, named_statuses
from alignment.estimate.keypoint_method import align_keypoints, match_keypoints
from alignment.estimate.locks import lock_issues
from alignment.estimate.map import MapFit, condense_cloud, edge_data, fit_captured
from alignment.estimate.motion import motion_rows, named_axes, rms_displacement_mm
from alignment.estimate.patches import Patches
from alignment.estimate.pose_line import pose_line
from alignment.estimate.problem import Problem
from alignment.estimate.several_checks import bases_in_first, require_one_part
from alignment.estimate.several_rows import Member, SeveralEdges, SeveralTracks, joined_edges, joined_patches
from alignment.estimate.several_surface import union_of
from alignment.estimate.surface_rows import patch_rows, same_afresh
from planner.errors import fail
from planner.frames import Array
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.follow import Follower
from planner.toolpath import ToolPath

# Fewer of a surface's patches than this share that agree with all the scans together: it is not where they say.
AGREE_SHARE = 0.6


@dataclass(frozen=True, eq=False)
class SurfaceScan:
    """A scan (in its plan's nominal base) and what its plan says. name: what people call the plan."""

    name: str
    cloud: PointCloud
    curved: CurvedSurface
    keypoints: Sequence[KeyPoint]
    setup: Setup
    inspection: ToolPath | None = None

    @property
    def problem(self) -> Problem:
        """The plan's own problem."""
        return Problem(self.curved, self.setup)


def align_several(scans: Sequence[SurfaceScan], edges: bool | None = None) -> tuple[Correction, ...]:
    """Return one correction per plan, in order; raise EchoBaseError where the plans cannot be aligned together.

    edges: as in `align`. A scan that says too little, or a surface that contradicts the others, is an answer.
    """
    names = [s.name for s in scans]
    require_one_part(names, [s.curved.surface.part.provenance.sha256 for s in scans])
    members = [Member(s.curved, T) for s, T in zip(scans, bases_in_first(names, [s.setup for s in scans]), strict=True)]
    if len({s.cloud.beams_base is None for s in scans}) > 1:
        raise fail(
            "scan-mixed",
            "ultrasonic readings and ready surface points cannot be mixed.",
            "Align them one after the other.",
        )
    problem = Problem(union_of([s.curved.surface for s in scans]), scans[0].setup)
    samplers = [m.sampler(s.cloud, s.setup.alignment.point_model) for m, s in zip(members, scans, strict=True)]
    captured = capture_together(samplers, problem)
    if not all(c.converged for c in captured):
        return _lost(scans, captured)
    found, tracks, crossings = _fitted(scans, members, captured, problem, edges is not False)
    if not isinstance(found, MapFit):
        return _lost(scans, [replace(c, converged=False) for c in captured])
    return _corrections(scans, members, captured, problem, found, tracks, crossings)


def _fitted(
    scans: Sequence[SurfaceScan], members: Sequence[Member], captured: list[Captured], problem: Problem, edges: bool
) -> tuple[MapFit | Captured, SeveralTracks, SeveralEdges | None]:
    start = captured[0].T_base_part
    parts, crossed = [], []
    for scan, member in zip(scans, members, strict=True):
        line = None if scan.cloud.beams_base is None else pose_line(scan.cloud, scan.setup.probe)
        parts.append(condense_cloud(scan.cloud, scan.problem, member.placed(start), line))
        crossed.append(edge_data(scan.cloud, scan.problem, line, member.placed(start)) if edges else None)
    together = joined_edges(members, crossed)
    worst = replace(captured[0], scatter_mm=max(c.scatter_mm for c in captured))
    for strict in (False, True):
        if strict:
            # Feet that were followed over a fold: every patch asks its whole surface at every step.
            parts = [replace(p, follower=Follower(m.curved)) for p, m in zip(parts, members, strict=True)]
        patches = joined_patches(members, parts, problem.curved)
        tracks = SeveralTracks(members, parts)
        found = fit_captured(problem, worst, patches, together)
        if not isinstance(found, MapFit):
            break
        T = found.T_base_part
        each = zip(members, parts, tracks.each(T, problem.centre_mm(T)), strict=True)
        if all(same_afresh(p, m.curved, m.placed(T), rows) for m, p, rows in each):
            break
    return found, tracks, together


def _corrections(
    scans: Sequence[SurfaceScan],
    members: Sequence[Member],
    captured: list[Captured],
    problem: Problem,
    found: MapFit,
    tracks: SeveralTracks,
    crossings: SeveralEdges | None,
) -> tuple[Correction, ...]:
    centre = problem.centre_mm(found.T_base_part)
    views = []
    first = 0
    for scan, member, caught, patches in zip(scans, members, captured, tracks.patches, strict=True):
        used = found.used[first : first + len(patches)]
        first += len(patches)
        views.append(_view(scan, member, caught, found, patches, used, centre))
    surfaces = [_figures(s, v) for s, v in zip(scans, views, strict=True)]
    for i, figures in enumerate(surfaces):
        part = None if crossings is None else crossings.parts[i]
        figures["crossings"] = 0 if part is None else len(part.points)
    said = [_said_of(scan, figures) for scan, figures in zip(scans, surfaces, strict=True)]
    strained = lock_issues(found.strain, found.converged, problem.setup.tolerances)
    general = list(strained)
    if not found.converged and not strained:
        text = "the estimate did not settle."
        general.append(Issue("error", "no-convergence", text, "Scan more of the surfaces, and closer to them."))
    out = []
    for i, (scan, member, view) in enumerate(zip(scans, members, views, strict=True)):
        own = scan.problem
        issues = [*scan.cloud.issues, *diagnose_fit(scan.cloud, own, view), *general]
        # What is said of each surface by name says it better.
        issues = [x for x in issues if x.code != "scan-of-another-part"]
        issues += [x for k, one in enumerate(said) for x in one if k != i or x.severity == "error"]
        keyed = match_keypoints(scan.cloud, scan.curved, scan.keypoints, scan.setup, view.T_base_part)
        keyed = tuple(with_residual(k, view.patches, view.rows, view.used, scan.setup) for k in keyed)
        baseline = align_keypoints(scan.cloud, scan.curved, scan.keypoints, scan.setup) if scan.keypoints else None
        made = finish(
            own, "map", view.T_base_part, view.covariance, view.directions, view.patches, view.rows, view.used, keyed,
            issues, scan.inspection, baseline, found.noise.named(), found.edges,
        )  # fmt: skip
        axes = _axes(made, view, member.T_first_own.inv().points(centre), own)
        out.append(replace(made, axes=axes, surfaces=surfaces))
    return tuple(out)


def _view(
    scan: SurfaceScan,
    member: Member,
    caught: Captured,
    found: MapFit,
    patches: Patches,
    used: NDArray[np.bool_],
    centre: Array,
) -> MapFit:
    """Return the common fit as the plan of one scan sees it: its base, its centroid, its patches, its tolerances."""
    own, T = scan.problem, member.placed(found.T_base_part)
    here = own.centre_mm(T)
    rows = patch_rows(patches, scan.curved, T, here)
    # Rows that are linear from a known placement turn about its centre: here every motion is about this one.
    rows = replace(rows, jacobian=motion_rows(rows.foot_base, rows.normal_base, here))
    move = _transport(member, member.T_first_own.inv().points(centre), here)
    moments = own.moments_base(T)
    tolerances = scan.setup.tolerances
    directions = tuple(_judged(d, move, moments, tolerances) for d in found.directions)
    return replace(
        found,
        T_base_part=T,
        centre_mm=here,
        covariance=move @ found.covariance @ move.T,
        directions=directions,
        patches=patches,
        rows=rows,
        used=used & rows.valid,
        captured=replace(caught, T_base_part=T),
    )


def _transport(member: Member, centre_own: Array, here: Array) -> Array:
    """Return the matrix (6, 6) that takes motions about the common centroid, first base, to motions about one's own.

    The turn stays; the shift is that of the plan's centroid: v + w x (own - common). Axes of the plan's own base.
    """
    r = member.T_first_own.inv().rotation_matrix
    x, y, z = here - centre_own
    arm = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = r
    out[3:, :3] = arm @ r
    return out


def _judged(d: Direction, move: Array, moments_base: Array, tolerances: Any) -> Direction:
    """Return a common direction as a motion about a plan's centroid: measured or weak by what it does to its surface."""
    vector = move @ d.vector
    displacement = rms_displacement_mm(d.sigma * vector, moments_base)
    status = d.status
    if status != "held":
        loose = displacement > tolerances.position_mm or d.turn_deg > tolerances.angle_deg
        status = "weak" if loose else "measured"
    return replace(d, vector=vector, displacement_mm=displacement, status=status)


def _axes(made: Correction, view: MapFit, centre_own: Array, own: Problem) -> tuple[AxisResult, ...]:
    """Return the named axes, their shares taken of the prior as it is: about the common centroid."""
    assert made.T_base_basecorr is not None
    back = np.eye(6)
    x, y, z = centre_own - view.centre_mm
    back[3:, :3] = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    common = tuple(replace(d, vector=back @ d.vector) for d in view.directions)
    statuses = named_statuses(common, named_axes(made.T_base_basecorr, centre_own), own.prior_sigma)
    return tuple(AxisResult(s, a.sigma) for s, a in zip(statuses, made.axes, strict=True))


def _figures(scan: SurfaceScan, view: MapFit) -> dict[str, Any]:
    """Return what is said of one surface: how far its readings stand off the part as placed by all scans together."""
    residual = residual_of(view.patches, view.rows, view.used | shape_of(view.patches, view.rows, scan.setup))
    valid, used = view.rows.valid, view.used
    mean = float(np.average(view.rows.r[used], weights=view.patches.count[used])) if used.any() else float("nan")
    return {
        "name": scan.name,
        "area_mm2": float(scan.curved.surface.area_mm2),
        **vars(residual),
        "mean_mm": mean,
        "agreeing_share": float(used.sum() / max(1, valid.sum())),
    }


def _said_of(scan: SurfaceScan, figures: dict[str, Any]) -> list[Issue]:
    """Return what the others' corrections must know of a surface: it contradicts them, or does not fit."""
    share, rms, t = figures["agreeing_share"], figures["rms_mm"], scan.setup.tolerances
    if figures["readings"] == 0 or share < AGREE_SHARE:
        text = f"only {share:.0%} of what was scanned of '{scan.name}' agrees with where all the scans together put the part."
        remedy = "Check that this is a scan of this part in this BASE; align without it to see which surface is out of place."
        return [Issue("error", "surface-apart", text, remedy, scan.name)]
    if rms > 3.0 * t.position_mm:
        text = (
            f"the readings of '{scan.name}' stand {rms:.2f} mm rms off the part as all the scans together place it, beyond "
            f"three times tolerances.position_mm ({t.position_mm:g} mm); this correction rests on them too."
        )
        return [
            Issue("warning", "surface-not-rigid", text, "See that surface's own report; align without it.", scan.name)
        ]
    return []


def _lost(scans: Sequence[SurfaceScan], captured: list[Captured]) -> tuple[Correction, ...]:
    """Return failed corrections that name the scans which do not fit."""
    bad = [s for s, c in zip(scans, captured, strict=True) if not c.converged] or list(scans)
    issues = [
        replace(x, where=s.name) for s in bad for x in diagnose_lost(s.cloud, s.problem, captured[scans.index(s)])
    ]
    out = []
    for scan in scans:
        fit = align_keypoints(scan.cloud, scan.curved, scan.keypoints, scan.setup) if scan.keypoints else None
        matches = () if fit is None else fit.matches
        out.append(empty(scan.problem, "map", [*scan.cloud.issues, *issues], matches, baseline_of(scan.problem, fit)))
    return tuple(out)
