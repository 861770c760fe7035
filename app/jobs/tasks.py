"""The tasks a worker knows: folders in, folders out, the workflow in between.

Each is `task(workflow, inputs, outputs, options, progress) -> JSON for the result row`.
"""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from app.folder import write_artifacts
from app.jobs.payload import Progress
from app.jobs.specs_together import FOLDER
from planner.keypoint import KeyPointList
from planner.setup import Setup

Task = Callable[[str, Path, Path, dict[str, Any], Progress], dict[str, Any]]
SIX = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


def _plan(workflow: str, inputs: Path, outputs: Path, options: dict[str, Any], progress: Progress) -> dict[str, Any]:
    steps = import_module(workflow)
    request = steps.PlanRequest(
        source=inputs / "part" / "source",
        name=options["part_name"],
        unit=options["unit"],
        setup=Setup.model_validate(options["setup"]),
        keypoints=tuple(KeyPointList.validate_python(options["keypoints"])),
        seeds_part=_seeds(options),
    )
    _, artifacts = steps.plan(request, progress)
    write_artifacts(outputs, artifacts)
    summary = json.loads(artifacts["plan.json"])
    failed = any(issue["severity"] == "error" for issue in summary.get("issues", []))
    summary["verdict"] = "fail" if failed else "pass"
    return {"keypoints": json.loads(artifacts["keypoints.json"]), "summary": summary}


def _suggest(
    workflow: str, inputs: Path, _outputs: Path, options: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    steps = import_module(workflow)
    progress(0.1, "reading the part")
    part = steps.open_part(inputs / "part" / "source", options["part_name"], options["unit"])
    progress(0.5, "choosing key points")
    points = steps.suggest_keypoints(part, Setup.model_validate(options["setup"]), _seeds(options))
    return {"keypoints": KeyPointList.dump_python(list(points), mode="json")}


def _simulate(
    workflow: str, inputs: Path, outputs: Path, options: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    steps = import_module(workflow)
    offset = tuple(float(options["offset"][name]) for name in SIX)
    chosen = steps.SimulateOptions(**{**options, "offset": offset})
    return {"readings": int(steps.simulate(inputs, chosen, outputs / "scan.csv", progress))}


def _align(workflow: str, inputs: Path, outputs: Path, options: dict[str, Any], progress: Progress) -> dict[str, Any]:
    steps = import_module(workflow)
    if options.get("together"):
        return _align_together(steps, inputs, outputs, options, progress)
    wanted = {name: options[name] for name in ("method", "edges", "non_rigid", "base")}
    chosen = steps.AlignOptions.from_folder(inputs, **wanted)
    done = steps.align(inputs, [inputs / name for name in options["scan_files"]], chosen, progress)
    write_artifacts(outputs, done.artifacts)
    return {"summary": done.correction}


def _align_together(
    steps: Any, inputs: Path, outputs: Path, options: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    """Align the project asked and others; what is made for these lies in `together/<k>/`."""
    others = options["together"]
    chosen = [("", options["name"], options)]
    chosen += [(f"{FOLDER}/{k}", other["name"], other["options"]) for k, other in enumerate(others, start=1)]
    items = []
    for place, name, own in chosen:
        folder = inputs / place
        wanted = {key: own[key] for key in ("method", "edges", "non_rigid", "base")}
        scans = [folder / file for file in own["scan_files"]]
        items.append(steps.PlanScans(folder, scans, steps.AlignOptions.from_folder(folder, **wanted), name))
    made = steps.align_together(items, progress)
    for (place, _, _), one in zip(chosen, made, strict=True):
        write_artifacts(outputs / place, one.artifacts)
    return {"summary": made[0].correction, "together": [one.correction for one in made[1:]]}


def _assess(workflow: str, inputs: Path, outputs: Path, options: dict[str, Any], progress: Progress) -> dict[str, Any]:
    from app.view.assessment_charts import assessment_charts  # noqa: PLC0415 - other tasks do without

    after = [inputs / name for name in options["scan_files"]]
    before = [inputs / name for name in options["before_files"]]
    steps = import_module(workflow)
    chosen = steps.AssessOptions(before=tuple(before), base=options["base"], before_base=options["before_base"])
    done = steps.assess(inputs, after, chosen, progress)
    charts = assessment_charts(done.after, done.before, options["standoff_mm"], options["loss_db"])
    text = json.dumps(charts, allow_nan=False)
    write_artifacts(outputs, {**done.artifacts, "charts.json": text.encode()})
    return {"summary": done.content | {"issues": [issue.to_json() for issue in done.issues]}}


def _seeds(options: dict[str, Any]) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in options["seeds"])


TASKS: dict[str, Task] = {
    "plan": _plan,
    "suggest": _suggest,
    "simulate": _simulate,
    "alignment": _align,
    "assessment": _assess,
}
