"""Steps 6 to 8 of the engineer's day: scan files to correction, corrected program and report."""

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from alignment.cloud import PointCloud
from alignment.correction import Correction
from alignment.estimate.align import align
from alignment.scan import Scan, SurfacePoints
from app.plan import Artifacts, Plan, load_plan
from app.report.build import Deviation, ReportData, alignment_report
from app.report.known import ScanFacts
from app.report.pictures import Shape
from app.report.record import Record
from app.steps.corrections import base_issues, last_correction, replaced
from app.steps.non_rigid import Followed, follow
from app.steps.programs import ExportedProgram, export_path, findings, program_name
from app.steps.records import record_of
from app.steps.scans import cloud_of, read_scans
from kuka_export.options import ProgramOptions
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.issues import Issue
from planner.placement import assume_nominal, corrected_base, part_from_correction

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class AlignOptions:
    """How to align. `T_base_active`: the correction in force when the scan was taken, for `base` "corrected"."""

    method: Literal["map", "keypoints"] = "map"
    edges: bool | None = None
    non_rigid: bool = False
    base: Literal["nominal", "corrected"] | None = None
    last_correction: Transform | None = None
    record: Record | None = None
    """What people know of the inspection; None: `record.json` of the folder, if there is one."""
    earlier: dict[str, Any] | None = None
    """correction.json as it stood in the folder, for `replaces` and for scans that cannot say their BASE; else None."""

    @classmethod
    def from_folder(
        cls,
        folder: Path,
        method: Literal["map", "keypoints"] = "map",
        edges: bool | None = None,
        non_rigid: bool = False,
        base: Literal["nominal", "corrected"] | None = None,
        record: Record | None = None,
        earlier: dict[str, Any] | None = None,
    ) -> "AlignOptions":
        """Return options that remember the folder's last correction, since `align` replaces it."""
        return cls(method, edges, non_rigid, base, last_correction(folder), record, earlier)


@dataclass(frozen=True, eq=False)
class Alignment:
    """The outcome: correction.json as a dict, files to write, and the arrays behind the pictures."""

    correction: dict[str, Any]
    artifacts: Artifacts
    issues: tuple[Issue, ...]
    failed: bool
    deviation: Deviation


@dataclass(frozen=True, eq=False)
class Prepared:
    """What an alignment starts from: the plan, the record, the scans as read, and their readings in the nominal base."""

    plan: Plan
    record: Record
    read: list[Scan | SurfacePoints]
    cloud: PointCloud
    earlier: dict[str, Any] | None = None


def prepare(folder: Path, scans: Sequence[Path], options: AlignOptions) -> Prepared:
    """Return plan, record and readings; raises EchoBaseError for unusable input."""
    plan, record = load_plan(folder), record_of(folder, options.record)
    read = read_scans(scans)
    last = options.last_correction
    corrected = None if last is None else corrected_base(plan.setup.T_world_base, last)
    cloud = cloud_of(read, plan.setup, options.base, corrected)
    cloud = replace(cloud, issues=(*cloud.issues, *base_issues(options.earlier, read, options.base)))
    return Prepared(plan, record, read, cloud, options.earlier)


def run_align(folder: Path, scans: Sequence[Path], options: AlignOptions, progress: Progress) -> Alignment:
    """Return the alignment. A verdict of fail is an answer (no program); raises EchoBaseError for unusable input."""
    progress(0.02, "reading plan and scan")
    given = prepare(folder, scans, options)
    progress(0.3, "aligning")
    plan = given.plan
    rigid = align(
        given.cloud, plan.curved, plan.keypoints, plan.setup, plan.inspection, options.method, options.edges,
        options.non_rigid,
    )  # fmt: skip
    return complete(given, rigid, options.non_rigid, progress)


def complete(
    given: Prepared,
    rigid: Correction,
    non_rigid: bool,
    progress: Progress,
    together: Sequence[dict[str, Any]] = (),
) -> Alignment:
    """Return the alignment of a rigid correction: the part's shape, the corrected program, the report.

    together: what `inputs` says of the other plans whose scans determined the correction too.
    """
    plan, read = given.plan, given.read
    progress(0.6, "looking for a deformation")
    followed = follow(plan, given.cloud, rigid, non_rigid)
    found = followed.found
    content = found.to_json()
    content["inputs"] = {
        "part_sha256": plan.part.provenance.sha256,
        "scan_sha256": [s.sha256 for s in read],
        "plan_sha256": plan.sha256,
        "version": version("echobase"),
    }
    content["replaces"] = replaced(given.earlier, content["correction"])
    if together:
        content["inputs"]["together"] = list(together)
    program = None
    if not found.failed:
        progress(0.8, "writing the corrected program")
        program = _corrected_program(plan, followed, content)
        content["program"] = program.manifest if program else None
    progress(0.9, "writing the report")
    artifacts: Artifacts = {
        "correction/correction.json": (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
    }
    deviation = _deviation(plan, followed)
    if followed.field_npz is not None:
        artifacts["correction/field.npz"] = followed.field_npz
    data = _report_data(followed, content, deviation, program, [ScanFacts.of(s) for s in read], given.record)
    artifacts |= alignment_report(plan, data).files("correction")
    if program:
        artifacts |= program.files
    progress(1.0, "aligned")
    issues = tuple(Issue(**i) for i in content["issues"])
    return Alignment(content, artifacts, issues, content["verdict"] == "fail", deviation)


def _corrected_program(plan: Plan, followed: Followed, content: dict[str, Any]) -> ExportedProgram | None:
    """Return the corrected inspection program; if it cannot be written the verdict in `content` becomes fail."""
    found = followed.found
    notes = [f"verdict {content['verdict']}: {i.message}" for i in found.issues if i.severity != "info"]
    accepted = "" if found.verdict == "pass" else "NOT GIVEN YET; THE VERDICT IS PARTIAL, READ THE REPORT FIRST"
    try:
        return export_path(
            plan,
            followed.sent,
            followed.dense,
            program_name(plan, "corrected"),
            T_base_basecorr=found.T_base_basecorr,
            notes=notes,
            verdict=found.verdict,
            acceptance=accepted,
            options=ProgramOptions(adapted=followed.adapted),
        )
    except EchoBaseError as error:
        content["verdict"] = "fail"
        content["issues"] += [i.to_json() for i in error.issues]
        return None


def _deviation(plan: Plan, followed: Followed) -> Deviation:
    """Return the deviation map: each measured patch against the part where the plan believed it, and where it was found."""
    found = followed.found
    if found.T_base_basecorr is None or not len(found.points_base):
        return Deviation(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    T_base_part = part_from_correction(found.T_base_basecorr, plan.setup.T_base_partnom)
    on_part = plan.curved.closest(T_base_part.inv().points(found.points_base))
    measured_base = found.points_base + found.deviation_mm[:, None] * T_base_part.directions(on_part.normals)
    nominal = assume_nominal(plan.setup.T_base_partnom).inv()
    before = plan.curved.closest(nominal.points(measured_base)).distance_mm
    return Deviation(on_part.points, before, followed.deviation_after_mm)


def _report_data(
    followed: Followed,
    content: dict[str, Any],
    deviation: Deviation,
    program: ExportedProgram | None,
    scans: list[ScanFacts],
    record: Record,
) -> ReportData:
    return ReportData(
        correction=content,
        before=followed.before,
        keyed=followed.keyed,
        after=followed.after,
        deviation=deviation,
        baseline=followed.found.baseline_xyzabc,
        shape=None if followed.field_npz is None else _shape(followed.field_npz),
        manifest=program.manifest if program else None,
        findings=findings(program) if program else (),
        scans=scans,
        record=record,
    )


def _shape(field_npz: bytes) -> Shape:
    with np.load(io.BytesIO(field_npz), allow_pickle=False) as arrays:
        return Shape(arrays["nodes"], arrays["values"], arrays["sd"], arrays["supported"])
