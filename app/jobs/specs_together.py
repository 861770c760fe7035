"""Builds the work of aligning scans of several projects of one part together."""

from dataclasses import replace
from typing import Any

from sqlalchemy.orm import Session

from app.jobs.specs import Spec, align_spec
from app.store import inputs, projects
from app.store.refusal import Refusal, refuse

# Where the files of the other projects lie in the folder of the job; what it makes for them lies there too.
FOLDER = "together"


def together_spec(session: Session, wanted: list[tuple[str, list[int] | None]], options: dict[str, Any]) -> Spec:
    """Return the work of aligning the scans (None: the newest) of several projects, the first of them the one asked.

    Raises Refusal 404 and 409 as for each by itself, 422 for a project named twice or of another part.
    """
    ids = [pid for pid, _ in wanted]
    if len(set(ids)) < len(ids):
        raise refuse(422, "project-twice", "a project is named twice.", "Name each other project once.", "together")
    rows = [projects.get(session, pid) for pid in ids]
    names = _names([row.name for row in rows])
    parts = [inputs.current(session, pid, "part") for pid in ids]
    for name, part in zip(names[1:], parts[1:], strict=True):
        if part.is_given and parts[0].is_given and part.content["sha256"] != parts[0].content["sha256"]:
            text = f"the part of project '{name}' is not the same CAD file as that of '{names[0]}'."
            remedy = "Align together only projects that were planned from the same file of the part."
            raise refuse(422, "parts-differ", text, remedy, "together")
    specs = [_own(session, pid, numbers, options, name) for (pid, numbers), name in zip(wanted, names, strict=True)]
    made_from = [
        {"project": pid, "name": name, **{key: spec["inputs"][key] for key in ("plan", "scans")}}
        for pid, name, spec in zip(ids, names, specs, strict=True)
    ]
    files = dict(specs[0]["files"])
    others = []
    for k, spec in enumerate(specs[1:], start=1):
        files |= {f"{FOLDER}/{k}/{name}": sha256 for name, sha256 in spec["files"].items()}
        others.append({"project": ids[k], "name": names[k], "options": spec["options"], "inputs": spec["inputs"]})
    return {
        "files": files,
        "options": {**specs[0]["options"], "name": names[0], "together": others},
        "inputs": specs[0]["inputs"] | {"together": made_from},
    }


def _own(session: Session, pid: str, numbers: list[int] | None, options: dict[str, Any], name: str) -> Spec:
    """Return the work of one project by itself; a refusal says whose it is."""
    try:
        return align_spec(session, pid, numbers, options)
    except Refusal as refusal:
        issues = [replace(i, message=f"project '{name}': {i.message}") for i in refusal.issues]
        raise Refusal(refusal.status, *issues) from refusal


def _names(names: list[str]) -> list[str]:
    """Return what the projects are called in reports: numbered where two have one name."""
    return [f"{name} ({k})" if names.count(name) > 1 else name for k, name in enumerate(names, start=1)]
