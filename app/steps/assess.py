"""An inspection scan against the plan, and against the one from before."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alignment.metrics import Assessment, assess, compare
from app.plan import Artifacts, Plan, load_plan
from app.steps.corrections import last_correction
from app.steps.scans import cloud_of, read_scans
from planner.issues import Issue
from planner.placement import assume_nominal, corrected_base, part_from_correction

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class AssessmentResult:
    """`content` is assessment.json; `after` and `before` hold the maps behind it."""

    content: dict[str, Any]
    artifacts: Artifacts
    issues: tuple[Issue, ...]
    after: Assessment
    before: Assessment | None


def run_assess(folder: Path, scan: Path, before: Path | None, progress: Progress) -> AssessmentResult:
    """Return the assessment; the part is taken to be where the last correction found it, else where the plan believes it."""
    progress(0.05, "reading the plan")
    plan = load_plan(folder)
    progress(0.2, "reading and judging the scan")
    after = _judge(folder, plan, scan)
    earlier = None
    if before is not None:
        progress(0.6, "reading and judging the scan from before")
        earlier = _judge(folder, plan, before)
    content = compare(after.figures, None if earlier is None else earlier.figures)
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    issues = after.issues + (earlier.issues if earlier else ())
    progress(1.0, "assessed")
    return AssessmentResult(content, {"assessment.json": text.encode()}, issues, after, earlier)


def _judge(folder: Path, plan: Plan, scan: Path) -> Assessment:
    found = last_correction(folder)
    nominal = assume_nominal(plan.setup.T_base_partnom)
    T_base_part = nominal if found is None else part_from_correction(found, plan.setup.T_base_partnom)
    T_world_corrected = None if found is None else corrected_base(plan.setup.T_world_base, found)
    cloud = cloud_of(read_scans([scan]), plan.setup, None, T_world_corrected)
    return assess(cloud, plan.curved, plan.setup, T_base_part)
