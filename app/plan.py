"""`Plan`: everything decided before the robot moves, and how it is kept on disk.

`plan.json` holds what people and scripts read, `plan.npz` the arrays (no pickle). Both are written and read here only.
"""

import hashlib
import io
import json
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import fail
from planner.frames import Transform
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.part import Part, Provenance
from planner.setup import Setup
from planner.surface.curved import CurvedSurface, footprint_mm
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import PARENTS
from planner.toolpath import ToolPath

FORMAT = 1
Artifacts = dict[str, bytes]


@dataclass(frozen=True, eq=False)
class Plan:
    """A part, its inspection surface, the key points and both dense paths, with the settings they were planned for.

    `summary` is the content of plan.json beyond these: coverage, prediction, checks, files.
    """

    part: Part
    surface: InspectionSurface
    setup: Setup
    keypoints: tuple[KeyPoint, ...]
    alignment: ToolPath
    inspection: ToolPath
    summary: dict[str, Any]
    issues: tuple[Issue, ...] = ()
    sha256: str = ""

    @cached_property
    def curved(self) -> CurvedSurface:
        """The smooth surface behind the triangles."""
        return CurvedSurface(self.surface, footprint_mm(self.setup.probe))

    def with_curved(self, curved: CurvedSurface) -> "Plan":
        """Return this plan with the smooth surface it was made on, which is slow to make on a large part."""
        self.__dict__["curved"] = curved
        return self


def plan_artifacts(plan: Plan) -> Artifacts:
    """Return plan.json, plan.npz, setup.json and keypoints.json."""
    arrays = {"vertices": plan.part.vertices, "faces": plan.part.faces, "part_faces": plan.surface.part_faces}
    if PARENTS in plan.part.meta:
        arrays[PARENTS] = plan.part.meta[PARENTS]
    for name, path in (("alignment", plan.alignment), ("inspection", plan.inspection)):
        arrays[f"{name}.Ts_part_contact"] = path.Ts_part_contact.matrix
        for f in fields(ToolPath)[2:]:
            arrays[f"{name}.{f.name}"] = getattr(path, f.name)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    content = {
        "format": FORMAT,
        "part": part_json(plan.part),
        "setup": plan.setup.model_dump(mode="json"),
        "keypoints": [k.model_dump() for k in plan.keypoints],
        **plan.summary,
        "issues": [i.to_json() for i in plan.issues],
        "arrays_sha256": hashlib.sha256(buffer.getvalue()).hexdigest(),
    }
    return {
        "plan.json": _json(content),
        "plan.npz": buffer.getvalue(),
        "setup.json": _json(plan.setup.model_dump(mode="json")),
        "keypoints.json": _json([k.model_dump() for k in plan.keypoints]),
    }


def load_plan(folder: Path) -> Plan:
    """Return the plan of a folder written by `echobase plan`; raise EchoBaseError if it is missing, mixed or damaged."""
    text = _read(folder, "plan.json")
    try:
        content = json.loads(text)
        if content["format"] != FORMAT:
            raise fail("plan-version", "the plan was written by another version.", "Plan again.", "plan.json")
        data = _read(folder, "plan.npz")
        if hashlib.sha256(data).hexdigest() != content["arrays_sha256"]:
            raise fail("plan-mixed", "plan.json and plan.npz do not belong together.", "Plan again.", str(folder))
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            stored = dict(arrays)
        part = _part(content["part"], stored)
        return Plan(
            part=part,
            surface=InspectionSurface(part, stored["part_faces"]),
            setup=Setup.model_validate(content["setup"]),
            keypoints=tuple(KeyPoint.model_validate(k) for k in content["keypoints"]),
            alignment=_path("alignment", stored),
            inspection=_path("inspection", stored),
            summary={k: v for k, v in content.items() if k not in {"format", "part", "setup", "keypoints", "issues"}},
            issues=tuple(Issue(**i) for i in content["issues"]),
            sha256=hashlib.sha256(text).hexdigest(),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise fail("plan-damaged", "the plan cannot be read back.", "Plan again.", str(folder)) from error


def part_json(part: Part) -> dict[str, Any]:
    """Return what plan.json says of the part."""
    origin = part.provenance
    chord = part.chord_error_mm
    return {
        "name": origin.name,
        "sha256": origin.sha256,
        "unit": origin.unit,
        "notes": list(origin.notes),
        "triangles": len(part.faces),
        "extents_mm": [round(float(v), 3) for v in part.extents_mm],
        "chord_error_mm": None if np.isnan(chord) else chord,
    }


def _part(data: dict[str, Any], stored: dict[str, np.ndarray]) -> Part:
    origin = Provenance(data["name"], data["sha256"], data["unit"], tuple(data["notes"]))
    chord = float("nan") if data["chord_error_mm"] is None else data["chord_error_mm"]
    meta = {PARENTS: stored[PARENTS]} if PARENTS in stored else {}
    return Part(stored["vertices"], stored["faces"], origin, chord, meta)


def _path(kind: str, stored: dict[str, np.ndarray]) -> ToolPath:
    columns = {f.name: stored[f"{kind}.{f.name}"] for f in fields(ToolPath)[2:]}
    contact = Transform.from_matrix("part", "contact", stored[f"{kind}.Ts_part_contact"])
    return ToolPath(kind=kind, Ts_part_contact=contact, **columns)  # type: ignore[arg-type]


def _read(folder: Path, name: str) -> bytes:
    path = folder / name
    if not path.is_file():
        raise fail("plan-missing", f"'{folder}' holds no {name}.", "Run `echobase plan` into it first.", str(folder))
    return path.read_bytes()


def _json(content: Any) -> bytes:
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()
