"""A workflow of known answers and controllable speed, so that the tests are about the server and not about geometry.

The wishes travel in the part's file name: `slow` takes until it is cancelled, `deaf` never listens, `crash` ends its process,
`fault` raises what nobody expects, `refused` says why it cannot.
"""

import hashlib
import json
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from app.report.document import Document, Figure, Line, Lines, Verdict
from app.report.package import Report
from planner.errors import fail
from planner.keypoint import KeyPoint
from planner.part import Part, Provenance
from planner.setup import Setup
from planner.surface.inspection import InspectionSurface

PROGRAM = b"&ACCESS RVP\r\nDEF EB_TEST()\r\nEND\r\n"


@dataclass(frozen=True)
class PlanRequest:
    source: Path
    name: str
    unit: str | None
    setup: Setup
    keypoints: tuple[KeyPoint, ...]
    seeds_part: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class SimulateOptions:
    offset: tuple[float, ...]
    spring_back_mm: float
    seed: int
    path: str
    outliers: float
    dropouts: float
    latency_ms: float


@dataclass(frozen=True)
class AlignOptions:
    method: str
    edges: bool | None
    non_rigid: bool
    base: str | None

    @classmethod
    def from_folder(cls, folder, **options):
        return cls(**options)


def open_part(source: Path, name: str, unit: str | None) -> Part:
    content = source.read_bytes()
    if name.endswith(".stl") and unit is None:
        raise fail("unit-missing", "the file has no unit; it would be 10 mm or 254 mm long.", "Say its unit.", name)
    if b"broken" in content:
        raise fail("cad-broken", "the file is damaged.", "Export it again.", name)
    scale = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4, None: 1.0}[unit]
    vertices = np.array([[0, 0, 0], [10, 0, 0], [10, 5, 0], [0, 5, 0]], dtype=np.float64) * scale
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Part(vertices, faces, Provenance(name, hashlib.sha256(content).hexdigest(), unit or "mm"), 0.0)


def choose_surface(part, setup, seeds=()):
    return InspectionSurface(part, np.arange(len(part.faces), dtype=np.int32))


def suggest_keypoints(part, setup, seeds=()):
    return [KeyPoint(id=f"K{i}", x_mm=float(i), y_mm=1.0, z_mm=0.0) for i in range(1, 4)]


def plan(request: PlanRequest, progress):
    progress(0.1, "reading the part")
    _obey(request.name, progress)
    points = list(request.keypoints) or suggest_keypoints(None, None)
    listed = [p.model_dump() for p in points]
    text = json.dumps(
        [request.setup.model_dump(mode="json"), listed, request.seeds_part, request.source.read_bytes().hex()[:64]]
    )
    mark = hashlib.sha256(text.encode()).hexdigest()[:8].encode()
    program = PROGRAM.replace(b"END\r\n", b"; " + mark + b"\r\nEND\r\n")
    sha = hashlib.sha256(program).hexdigest()
    issues = []
    programs = {f"{kind}/EB_TEST.src": program for kind in ("alignment", "inspection")}
    if "unreachable" in request.name:
        programs.pop("inspection/EB_TEST.src")
        issues = [
            {"severity": "error", "code": "reach", "message": "out of reach.", "remedy": "Move it.", "where": "pass 1"}
        ]
    record = {"files": {"EB_TEST.src": {"sha256": "0" * 64 if "unproven" in request.name else sha}}}
    content = {
        "keypoints": listed,
        "issues": issues,
        "alignment": {"program": record},
        "inspection": {"program": record},
    }
    artifacts = {"plan.json": json.dumps(content).encode(), "keypoints.json": json.dumps(listed).encode()}
    progress(1.0, "planned")
    return None, artifacts | programs


def simulate(folder: Path, options: SimulateOptions, output: Path, progress) -> int:
    program = sorted((folder / options.path).glob("*.src"))[0]
    output.write_text(f"x_mm,tof_us\n{options.offset[0]},{options.seed}\n# {program.name}\n")
    return 1


def align(folder: Path, scans, options: AlignOptions, progress):
    text = " ".join(p.read_text(errors="replace") for p in scans)
    verdict = next((v for v in ("fail", "partial") if f"want-{v}" in text), "pass")
    stood_in = folder / "correction" / "correction.json"
    six = {
        "x_mm": 2.0 if options.non_rigid else 1.0,
        "y_mm": 0.0,
        "z_mm": 0.0,
        "a_deg": 0.0,
        "b_deg": 0.0,
        "c_deg": 0.0,
    }
    sha = hashlib.sha256(PROGRAM).hexdigest()
    issues = (
        [{"severity": "error", "code": "bad", "message": "too far.", "remedy": "", "where": ""}]
        if verdict == "fail"
        else []
    )
    correction = {
        "verdict": verdict,
        "method": options.method,
        "correction": six,
        "keypoints": [],
        "issues": issues,
        "program": sha,
        "stood_in": hashlib.sha256(stood_in.read_bytes()).hexdigest() if stood_in.exists() else "",
    }
    artifacts = {
        "correction/correction.json": json.dumps(correction).encode(),
        **report(verdict).files("correction"),
    }
    if verdict != "fail":
        artifacts["corrected/EB_TEST.src"] = PROGRAM
    return SimpleNamespace(correction=correction, artifacts=artifacts)


@dataclass(frozen=True)
class PlanScans:
    folder: Path
    scans: list[Path]
    options: AlignOptions
    name: str


def align_together(items: list[PlanScans], progress):
    made = [align(item.folder, item.scans, item.options, progress) for item in items]
    for item, one in zip(items, made, strict=True):
        one.correction["called"] = item.name
        one.artifacts["correction/correction.json"] = json.dumps(one.correction).encode()
    return made


@dataclass(frozen=True)
class AssessOptions:
    before: tuple[Path, ...] = ()
    base: str | None = None
    before_base: str | None = None


def report(verdict: str) -> Report:
    """A small report with a drawing and a line that the record fills."""
    lines = Lines(
        title="People", lines=(Line(label="Operator", field="people.operator"), Line(label="S/N", field="part.serial"))
    )
    blocks = (Verdict(tone=verdict, word=verdict.upper()), Figure(name="field", caption="", alt=""), lines)
    drawing = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>'
    return Report(Document(title="Report", subject="panel", version="1", blocks=blocks), {"field": drawing})


def assess(folder: Path, scans, options: AssessOptions, progress):
    content = {"after": {"within_2db": 1.0}, "before": None, "improvement_pct": None}
    artifacts = {"assessment.json": json.dumps(content).encode()}
    return SimpleNamespace(content=content, artifacts=artifacts, issues=(), after=_judged(), before=None)


def _judged() -> SimpleNamespace:
    x, y = (v.ravel().astype(float) for v in np.meshgrid(np.arange(30), np.arange(20)))
    yes = np.ones(len(x), dtype=bool)
    maps = {"feet_part": np.stack([x, y, 0 * x], axis=1), "distance_mm": 15.0 + 0.01 * x, "db": 0.1 * y}
    return SimpleNamespace(**maps, on_part=yes, centre=yes, bubble=~yes)


def _obey(name: str, progress) -> None:
    if "refused" in name:
        raise fail("no-surface", "there is no surface.", "Choose one.", "surface")
    if "fault" in name:
        raise ZeroDivisionError("nobody expected this")
    if "crash" in name:
        os.kill(os.getpid(), signal.SIGKILL)
    while "deaf" in name:
        time.sleep(0.05)
    for step in range(10_000 if "slow" in name else 0):
        progress(0.1 + step * 1e-5, "working")
        time.sleep(0.02)
