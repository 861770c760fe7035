"""Step 3 to 5 of the engineer's day: surface, key points, both paths, both programs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from alignment.estimate.predict import predict
from app.plan import Artifacts, Plan, plan_artifacts
from app.steps.creases import crease_issues
from app.steps.programs import export_path, program_name
from planner.cad import read_part
from planner.checks import check
from planner.checks.left import left_issues
from planner.checks.orientation import orientation_issues
from planner.checks.regions import region_issues
from planner.checks.sound import sound_raster
from planner.checks.tessellation import tessellation_issues
from planner.errors import EchoBaseError
from planner.issues import Issue, errors_in
from planner.keypoint import KeyPoint
from planner.part import Part
from planner.path.alignment import alignment_path
from planner.path.coverage import Coverage, coverage
from planner.path.decimate import decimate
from planner.path.keypoints import kept_out, snap, suggest, verdicts
from planner.setup import Setup
from planner.surface.choose import chosen_surface, clip_issues
from planner.surface.curved import CurvedSurface, footprint_mm
from planner.surface.facing import facing_issues
from planner.surface.inspection import InspectionSurface
from planner.toolpath import ToolPath

Progress = Callable[[float, str], None]
SUGGESTED_SHARE = (0.10, 0.30)
FEWEST_PASSES = 3
"""Passes, each as long as the swath, below which an alignment scan cannot be cut."""


@dataclass(frozen=True)
class PlanRequest:
    """What to plan: a CAD file (`source`, called `name`, in `unit`), or a part already read; the setup; key points or seeds."""

    source: Path | None
    name: str
    unit: str | None
    setup: Setup
    keypoints: tuple[KeyPoint, ...] = ()
    seeds_part: tuple[tuple[float, float, float], ...] = ()
    part: Part | None = None


def run_plan(request: PlanRequest, progress: Progress) -> tuple[Plan, Artifacts]:
    """Return the plan and its files; programs with an error-level issue are missing and the plan's issues say why."""
    setup = request.setup
    progress(0.02, "reading the part")
    part = request.part
    if part is None:
        assert request.source is not None
        part = read_part(request.source, request.name, request.unit)
    progress(0.25, "finding the inspection surface")
    up_part = setup.T_base_partnom.inv().directions([0.0, 0.0, 1.0])
    surface = _surface(part, request)
    creased = crease_issues(surface)
    if errors_in(creased):
        raise EchoBaseError(*creased)
    curved = CurvedSurface(surface, footprint_mm(setup.probe))
    progress(0.35, "choosing key points")
    keypoints = snap(curved, request.keypoints) if request.keypoints else suggest(curved, setup)
    refused = kept_out(curved, keypoints, setup)
    if refused:
        raise EchoBaseError(*refused)
    issues = [*facing_issues(surface, up_part), *clip_issues(surface), *creased, *region_issues(curved, setup)]
    issues += [*tessellation_issues(curved, setup), *orientation_issues(curved, setup)]
    issues += verdicts(curved, keypoints, setup)
    progress(0.5, "laying the alignment path")
    alignment = alignment_path(curved, keypoints, setup)
    progress(0.6, "laying the inspection raster")
    inspection, left_out = sound_raster(curved, setup)
    issues += left_out
    progress(0.7, "measuring coverage")
    covered = {p.kind: coverage(curved, p, setup) for p in (alignment, inspection)}
    issues += left_issues(curved, covered["inspection"], setup)
    if not request.keypoints:
        issues += _coverage_issues(covered["alignment"].swept_share, surface.area_mm2, setup)
    progress(0.75, "predicting the accuracy")
    prediction = predict(alignment, curved, setup)
    summary: dict[str, Any] = {
        "surface": {
            "area_mm2": round(surface.area_mm2, 3),
            "triangles": len(surface.part_faces),
            "centroid_part_mm": [round(float(v), 4) for v in surface.centroid_part],
        },
        "prediction": prediction.to_json(),
    }
    # The surface's own part: a sheet that faced away from up was turned over.
    plan = Plan(surface.part, surface, setup, tuple(keypoints), alignment, inspection, summary).with_curved(curved)
    programs: Artifacts = {}
    for share, path in ((0.8, alignment), (0.9, inspection)):
        progress(share, f"checking and writing the {path.kind} program")
        found, files, record = _checked_program(plan, path)
        issues += found
        programs |= files
        summary[path.kind] = path_json(path, covered[path.kind]) | record
    plan = replace(plan, issues=tuple(issues)).with_curved(curved)
    progress(1.0, "planned")
    return plan, plan_artifacts(plan) | programs


def _surface(part: Part, request: PlanRequest) -> InspectionSurface:
    """Return the surface flooded from seeds and key points; an error about a key point names it by its id."""
    places = {f"seed {i}": f"seed {i}" for i in range(1, len(request.seeds_part) + 1)}
    for i, keypoint in enumerate(request.keypoints, len(request.seeds_part) + 1):
        places[f"seed {i}"] = f"key point {keypoint.id}"
    try:
        seeds = [*request.seeds_part, *(k.xyz() for k in request.keypoints)]
        return chosen_surface(part, request.setup, seeds)
    except EchoBaseError as error:
        raise EchoBaseError(*(replace(i, where=places.get(i.where, i.where)) for i in error.issues)) from error


def _checked_program(plan: Plan, path: ToolPath) -> tuple[list[Issue], Artifacts, dict[str, Any]]:
    """Return issues, files and the record for plan.json of one path; no files if anything is wrong with it."""
    sent = decimate(path)
    checked = check(plan.curved, sent, plan.setup)
    issues = [replace(i, where=f"{path.kind}: {i.where}" if i.where else path.kind) for i in checked.issues]
    record: dict[str, Any] = {"checks": checked.summary(), "program": None}
    if errors_in(issues):
        return issues, {}, record
    try:
        exported = export_path(plan, sent, path, program_name(plan, path.kind))
    except EchoBaseError as error:
        return issues + list(error.issues), {}, record
    record["program"] = exported.manifest
    return issues + list(exported.issues), exported.files, record


def path_json(path: ToolPath, covered: Coverage) -> dict[str, Any]:
    """Return what plan.json says of a path."""
    data = path.is_data
    xyz = path.Ts_part_tcp.xyz_mm
    step = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
    along = data[1:] & data[:-1] & (path.pass_id[1:] == path.pass_id[:-1])
    return {
        "passes": path.passes,
        "poses": len(path),
        "data_poses": int(data.sum()),
        "data_length_mm": round(float(step[along].sum()), 3),
        "coverage": {
            "area_mm2": covered.area_mm2,
            "swept_mm2": covered.swept_mm2,
            "share": covered.swept_share,
            "within_tolerance_mm2": covered.within_tolerance_mm2,
            "within_tolerance_share": covered.within_share,
            "missed_mm2": covered.missed_mm2,
            "margin_mm2": covered.margin_mm2,
            "beside_mm2": covered.beside_mm2,
            "beyond_mm2": covered.beyond_mm2,
            "unexplained_mm2": covered.unexplained_mm2,
            "kept_out_mm2": covered.kept_out_mm2,
        },
    }


def _coverage_issues(share: float, area_mm2: float, setup: Setup) -> list[Issue]:
    low, high = SUGGESTED_SHARE
    if low <= share <= high:
        return []
    text = f"the suggested alignment scan covers {share:.0%} of the surface, outside {low:.0%} to {high:.0%}"
    swath = setup.probe.swath_mm
    if share > high and area_mm2 * high / swath < FEWEST_PASSES * swath:
        return [
            Issue(
                "info",
                "coverage-small-part",
                f"{text}: the surface is small beside the {swath:g} mm swath, and fewer passes would not fix all directions.",
                "Nothing needs to be done; pick key points by hand for a shorter scan.",
                "alignment",
            )
        ]
    remedy = "Change alignment.coverage, or pick key points by hand."
    return [Issue("warning", "coverage-outside", f"{text}.", remedy, "alignment")]
