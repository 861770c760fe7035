"""An inspection scan against the plan, and against the one from before."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from alignment.metrics import Assessment, assess, compare
from app.plan import Artifacts, Plan, load_plan
from app.report.assessment import AssessmentData, assessment_report
from app.report.known import ScanFacts
from app.report.record import Record
from app.steps.corrections import base_issues, last_correction
from app.steps.records import record_of
from app.steps.scans import cloud_of, read_scans
from planner.frames import Transform
from planner.issues import Issue
from planner.placement import assume_nominal, corrected_base, part_from_correction

Progress = Callable[[float, str], None]
BaseName = Literal["nominal", "corrected"]


@dataclass(frozen=True)
class AssessOptions:
    """What to compare with, and the BASE that was active in files that do not say it: of the scan, and of the one before.

    record: what people know of the inspection; None: `record.json` of the folder, if there is one.
    """

    before: tuple[Path, ...] = ()
    base: BaseName | None = None
    before_base: BaseName | None = None
    record: Record | None = None
    earlier: dict[str, Any] | None = None
    """correction.json as it stands in the folder, for scans that cannot say their BASE; None: not by folder."""


@dataclass(frozen=True, eq=False)
class AssessmentResult:
    """`content` is assessment.json; `after` and `before` hold the maps behind it."""

    content: dict[str, Any]
    artifacts: Artifacts
    issues: tuple[Issue, ...]
    after: Assessment
    before: Assessment | None


def run_assess(folder: Path, scans: Sequence[Path], options: AssessOptions, progress: Progress) -> AssessmentResult:
    """Return the assessment; the part is taken to be where the last correction found it, else where the plan believes it.

    scans: the files of one inspection, passes split over them as they come.
    """
    progress(0.05, "reading the plan")
    plan, record = load_plan(folder), record_of(folder, options.record)
    found = last_correction(folder)
    progress(0.15, "reading and judging the scan")
    after, facts = _judge(plan, found, scans, options.base, "scan", options.earlier)
    earlier = None
    if options.before:
        progress(0.45, "reading and judging the scan from before")
        earlier, more = _judge(plan, found, options.before, options.before_base, "before", options.earlier)
        facts = [*more, *facts]
    content = compare(after.figures, None if earlier is None else earlier.figures)
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    issues = after.issues + (earlier.issues if earlier else ())
    progress(0.8, "writing the report")
    where = (
        "The part is taken to be where the plan believes it; no alignment has found it."
        if found is None
        else "The part is taken to be where the alignment found it."
    )
    data = AssessmentData(content, after, earlier, issues, facts, where, record)
    artifacts = {"assessment.json": text.encode()} | assessment_report(plan, data).files("assessment")
    progress(1.0, "assessed")
    return AssessmentResult(content, artifacts, issues, after, earlier)


def _judge(
    plan: Plan,
    found: Transform | None,
    scans: Sequence[Path],
    base: BaseName | None,
    role: str,
    earlier: dict[str, Any] | None,
) -> tuple[Assessment, list[ScanFacts]]:
    nominal = assume_nominal(plan.setup.T_base_partnom)
    T_base_part = nominal if found is None else part_from_correction(found, plan.setup.T_base_partnom)
    T_world_corrected = None if found is None else corrected_base(plan.setup.T_world_base, found)
    read = read_scans(scans)
    cloud = cloud_of(read, plan.setup, base, T_world_corrected)
    cloud = replace(cloud, issues=(*cloud.issues, *base_issues(earlier, read, base)))
    return assess(cloud, plan.curved, plan.setup, T_base_part), [ScanFacts.of(s, role) for s in read]
