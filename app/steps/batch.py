"""Serial parts of one design on one fixture: corrections, or scans aligned one after another, to what is common and own."""

import hashlib
import io
import json
import zipfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from alignment.batch import Batch, PartShape, Shapes, advice, batch, common_shape, evidence_of
from alignment.batch.face import face_axes
from alignment.estimate.align import align
from app.plan import Artifacts, Plan, load_plan
from app.report.batch import batch_report
from app.report.package import Report
from app.steps.align import AlignOptions
from app.steps.calibrate import patch_text
from app.steps.non_rigid import follow
from app.steps.scans import cloud_of, read_scans
from planner.errors import EchoBaseError, fail
from planner.issues import Issue
from planner.placement import assume_nominal, corrected_base

Progress = Callable[[float, str], None]
CORRECTION, FIELD = "correction.json", "field.npz"


@dataclass(frozen=True, eq=False)
class BatchItem:
    """One part: correction.json as read, its digest, the shape beside it, whether no transducer took the scan."""

    name: str
    content: dict[str, Any]
    sha256: str
    field_npz: bytes | None = None
    simulated: bool = False


@dataclass(frozen=True, eq=False)
class BatchResult:
    """`content` is batch.json."""

    content: dict[str, Any]
    issues: tuple[Issue, ...]
    found: Batch
    shapes: Shapes | None
    plan: Plan

    @cached_property
    def report(self) -> Report:
        """The same as a report."""
        return batch_report(self.plan, self.found, self.shapes, self.content)

    @property
    def artifacts(self) -> Artifacts:
        """batch.json, its patch of setup.json (empty if there is nothing to change), and batch/report.html, pdf, json, csv."""
        text, patch = (patch_text(content).encode() for content in (self.content, self.content["patch"]))
        return {"batch.json": text, "batch/patch.json": patch, **self.report.files("batch")}


def run_batch(folder: Path, items: Sequence[Path], options: AlignOptions, progress: Progress) -> BatchResult:
    """Return what the parts have in common. items: correction.json, a folder with one, or a scan (one part each)."""
    progress(0.02, "reading the plan")
    plan = load_plan(folder)
    read = []
    for i, (path, name) in enumerate(zip(items, _names(items), strict=True)):
        progress(0.05 + 0.8 * i / max(len(items), 1), f"part {i + 1} of {len(items)}: {name}")
        is_correction = path.is_dir() or path.suffix.lower() == ".json"
        read.append(_correction(path, name) if is_correction else _aligned(plan, path, name, options))
    progress(0.88, "comparing the parts")
    result = judge_batch(plan, read)
    progress(1.0, "compared")
    return result


def judge_batch(plan: Plan, items: Sequence[BatchItem]) -> BatchResult:
    """Return what corrections of a plan have in common; those that cannot be compared are left out and named."""
    issues: list[Issue] = []
    used, parts, seen = [], [], set()
    for item in items:
        scans = tuple(item.content.get("inputs", {}).get("scan_sha256", ())) or (item.sha256,)
        if item.content.get("inputs", {}).get("plan_sha256") != plan.sha256:
            issues.append(_left_out(item, "it belongs to another plan", "Align its scan with this plan."))
        elif scans in seen:
            issues.append(_left_out(item, "its scan is that of a part named before", "Name each part once."))
        else:
            try:
                parts.append(evidence_of(item.name, item.content))
            except EchoBaseError as error:
                issues.append(_left_out(item, "its alignment failed or has no directions", error.issues[0].remedy))
                continue
            used.append(item)
            seen.add(scans)
    if len(parts) < 2:
        said = " ".join(i.message for i in issues)
        raise fail(
            "batch-parts", f"A batch needs two parts; {len(parts)} can be compared. {said}".strip(), "Add parts."
        )
    found = batch(parts, face_axes(plan.surface, assume_nominal(plan.setup.T_base_partnom)))
    patch, more = advice(found, plan.setup)
    shapes = common_shape([s for item in used if (s := _shape(item)) is not None])
    issues = [*issues, *found.issues, *more]
    content = {
        **found.to_json(),
        "patch": patch,
        "shape": None if shapes is None else shapes.to_json(),
        "issues": [i.to_json() for i in issues],
        "inputs": {
            "plan_sha256": plan.sha256,
            "parts": [{"name": i.name, "sha256": i.sha256, "simulated": i.simulated} for i in used],
        },
    }
    return BatchResult(content, tuple(issues), found, shapes, plan)


def _left_out(item: BatchItem, why: str, remedy: str) -> Issue:
    return Issue("warning", "batch-left-out", f"{item.name} is left out: {why}.", remedy, item.name)


def _names(items: Sequence[Path]) -> list[str]:
    """Return a name per part: of its file, or of the folder where files are all called alike."""
    names = []
    for path in items:
        folder = path if path.is_dir() else path.parent
        plain = path.name if path.is_dir() else path.name.split(".")[0]
        if plain == "correction" and folder.name == "correction":
            folder = folder.parent
        names.append(folder.resolve().name if plain == "correction" else plain)
    often = Counter(names)
    return [n if often[n] == 1 else f"{n} ({i})" for i, n in enumerate(names, start=1)]


def _correction(path: Path, name: str) -> BatchItem:
    if path.is_dir():
        inner = path / "correction"
        path = (inner if (inner / CORRECTION).is_file() else path) / CORRECTION
    try:
        raw = path.read_bytes()
        content = json.loads(raw)
        if not isinstance(content, dict):
            raise ValueError("no JSON object")
    except OSError as error:
        raise fail("batch-correction", "There is no correction.json to read.", "Align first.", str(path)) from error
    except ValueError as error:
        text = f"The file is no correction.json: it is damaged or cut short ({error})."
        raise fail("batch-correction", text, "Copy it again, or align again.", str(path)) from error
    field, report = path.parent / FIELD, path.parent / "report.json"
    simulated = False
    if report.is_file():
        try:
            simulated = bool(json.loads(report.read_bytes())["simulated"])
        except (ValueError, KeyError, TypeError):
            simulated = False
    npz = field.read_bytes() if field.is_file() else None
    return BatchItem(name, content, hashlib.sha256(raw).hexdigest(), npz, simulated)


def _aligned(plan: Plan, scan: Path, name: str, options: AlignOptions) -> BatchItem:
    """Align one scan as `align` would, but for files: no program, no report."""
    read = read_scans([scan])
    last = options.last_correction
    T_world_corrected = None if last is None else corrected_base(plan.setup.T_world_base, last)
    cloud = cloud_of(read, plan.setup, options.base, T_world_corrected)
    setup, inspection = plan.setup, plan.inspection
    rigid = align(
        cloud, plan.curved, plan.keypoints, setup, inspection, options.method, options.edges, options.non_rigid
    )
    followed = follow(plan, cloud, rigid, options.non_rigid)
    content = followed.found.to_json()
    content["inputs"] = {"scan_sha256": [s.sha256 for s in read], "plan_sha256": plan.sha256}
    return BatchItem(name, content, read[0].sha256, followed.field_npz, any(s.simulated for s in read))


def _shape(item: BatchItem) -> PartShape | None:
    if item.field_npz is None:
        return None
    try:
        with np.load(io.BytesIO(item.field_npz), allow_pickle=False) as arrays:
            fields = [arrays[k] for k in ("nodes", "values", "sd", "supported")]
    except (ValueError, KeyError, OSError, zipfile.BadZipFile) as error:
        raise fail("batch-shape", "Its field.npz cannot be read.", "Align it again.", item.name) from error
    return PartShape(item.name, fields[0], fields[1], fields[2], fields[3].astype(bool))
