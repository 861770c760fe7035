"""What an alignment of several projects made becomes an alignment of each of them, in one transaction."""

from typing import Any

from sqlalchemy.orm import Session

from app.jobs.specs_together import FOLDER
from app.store import results
from app.store.blobs import Blob
from app.store.tables import JobRow, ProjectRow


def rows(session: Session, row: JobRow, files: dict[str, Blob], data: dict[str, Any]) -> dict[str, Any]:
    """Add one alignment per project that is still there; return the job's result: the first one, and `together`."""
    options, made_from = dict(row.spec["options"]), row.spec["inputs"]
    others = options.pop("together")
    own = {name: blob for name, blob in files.items() if not name.startswith(f"{FOLDER}/")}
    names = [options.pop("name"), *(other["name"] for other in others)]
    first = _add(
        session,
        row.project_id,
        own,
        _from(made_from, made_from, row.project_id),
        _with(options, names, 0),
        data["summary"],
    )
    together = []
    for k, (other, summary) in enumerate(zip(others, data["together"], strict=True), start=1):
        if session.get(ProjectRow, other["project"]) is None:
            continue
        start = f"{FOLDER}/{k}/"
        part = {name.removeprefix(start): blob for name, blob in files.items() if name.startswith(start)}
        its_inputs = _from(other["inputs"], made_from, other["project"])
        made = _add(session, other["project"], part, its_inputs, _with(other["options"], names, k), summary)
        together.append({"project": other["project"], **made})
    return {**first, "together": together}


def _add(
    session: Session,
    pid: str,
    files: dict[str, Blob],
    inputs: dict[str, Any],
    options: dict[str, Any],
    summary: dict[str, Any],
) -> dict[str, Any]:
    verdict = str(summary.get("verdict", "pass"))
    made = results.add(session, pid, "alignment", files, inputs, options, verdict, summary)
    return {"number": made.number, "verdict": verdict}


def _from(own: dict[str, Any], made_from: dict[str, Any], pid: str) -> dict[str, Any]:
    """Return what one project's alignment was made from: its own plan and scans, and those of the others."""
    return {**own, "together": [other for other in made_from["together"] if other["project"] != pid]}


def _with(options: dict[str, Any], names: list[str], own: int) -> dict[str, Any]:
    """Return the options of one project's alignment, with the names of the others."""
    return {**options, "together": [name for k, name in enumerate(names) if k != own]}
