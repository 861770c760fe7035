"""What a set of key points is worth before the robot moves: verdicts, coverage, predicted accuracy."""

import json
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

from app.api.parts import part_from
from app.store.blobs import open_blobs
from app.view.model import Insight, KeyPointSet
from planner.errors import EchoBaseError
from planner.part import Part
from planner.setup import Setup


@dataclass(frozen=True)
class Question:
    """Everything an insight depends on, small enough to send: digests and JSON, never arrays."""

    store_url: str
    workflow: str
    arrays_sha256: str
    part_content: str
    setup: str
    seeds: tuple[tuple[float, float, float], ...]
    points: KeyPointSet


def think(question: Question) -> Insight:
    """Return the insight; what cannot be computed for these points is said as issues and left out.

    Runs in the thinker's process, which keeps part and surface for the next question.
    """
    from alignment.estimate.predict import predict  # noqa: PLC0415 - the planner is big; the server only sends questions
    from planner.path.alignment import alignment_path  # noqa: PLC0415
    from planner.path.coverage import coverage  # noqa: PLC0415
    from planner.path.keypoints import snap, verdicts  # noqa: PLC0415

    given = question.points
    setup = Setup.model_validate_json(question.setup)
    issues = []
    try:
        flood = question.seeds + tuple(p.xyz() for p in given.points)
        part = _part(question.store_url, question.arrays_sha256, question.part_content)
        curved = _curved(_surface(part, question.workflow, flood, setup), setup)
        points = tuple(snap(curved, given.points))
        issues = list(verdicts(curved, points, setup))
        path = alignment_path(curved, points, setup)
        covered = coverage(curved, path, setup)
        prediction = predict(path, curved, setup).to_json()
    except EchoBaseError as error:
        return Insight(given.version, (*issues, *error.issues))
    dof = prediction["dof"]
    return Insight(
        given.version,
        tuple(issues),
        coverage=covered.share,
        path=path,
        covered=covered.face_share,
        normal_error_mm=prediction["normal_error_mm"],
        sigma={axis: float(value["sigma"]) for axis, value in dof.items()},
        status={axis: str(value["status"]) for axis, value in dof.items()},
    )


@lru_cache(maxsize=2)
def _part(store_url: str, arrays_sha256: str, content: str) -> Part:
    return part_from(open_blobs(store_url), arrays_sha256, json.loads(content))


_KEPT: dict[str, Any] = {}


def _surface(part: Part, workflow: str, flood: tuple[tuple[float, float, float], ...], setup: Setup) -> Any:
    """Return the surface; the same triangles stay the same object, so that nothing behind it is built again."""
    made = import_module(workflow).choose_surface(part, setup, flood)
    kept = _KEPT.get("surface")
    if kept is not None and kept.part is made.part and kept.part_faces.tobytes() == made.part_faces.tobytes():
        return kept
    _KEPT["surface"] = made
    return made


def _curved(surface: Any, setup: Setup) -> Any:
    from planner.surface.curved import CurvedSurface, footprint_mm  # noqa: PLC0415 - as above

    key = (surface, footprint_mm(setup.probe))
    kept = _KEPT.get("curved")
    if kept is None or kept[0][0] is not surface or kept[0][1] != key[1]:
        _KEPT["curved"] = kept = (key, CurvedSurface(surface, key[1]))
    return kept[1]
