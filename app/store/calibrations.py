"""Calibrations as results of a project: kept with their readings, their report and the cell that they were computed with."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from sqlalchemy import delete
from sqlalchemy.orm import Session

from app.store.blobs import Blob
from app.store.inputs import current, versions_since
from app.store.journal import note
from app.store.projects import touch
from app.store.results import add, all_results, get_result
from app.store.store import VERSION
from app.store.tables import FileRow, ResultRow

KIND = "calibration"
FOLDER = "calibration"
READINGS = "readings"
Applied = Literal["now", "earlier", "never", "nothing"]


class Cell(NamedTuple):
    """The setup in force: its content, its version (0: nobody gave one) and its digest."""

    setup: dict[str, Any]
    version: int
    sha256: str


def cell_in(session: Session, project_id: str) -> Cell:
    """Return the setup in force."""
    row = current(session, project_id, "setup")
    return Cell(row.content, row.version, row.sha256)


def inputs_of(cell: Cell, files: Sequence[tuple[str, Blob]]) -> dict[str, Any]:
    """Return what a calibration is made from: the cell, and each file by name and SHA-256."""
    named = [{"name": name, "sha256": blob.sha256} for name, blob in files]
    return {"setup": cell.sha256, "setup_version": cell.version, "files": named, "version": VERSION}


def same(session: Session, project_id: str, inputs: dict[str, Any], options: dict[str, Any]) -> ResultRow | None:
    """Return the calibration that was already made from the same files in the same cell, or None."""
    for row in reversed(all_results(session, project_id, KIND)):
        if row.inputs == inputs and row.options == options:
            return row
    return None


def keep(
    session: Session, project_id: str, files: dict[str, Blob], inputs: dict[str, Any], options: dict[str, Any],
    summary: dict[str, Any],
) -> ResultRow:  # fmt: skip
    """Add a calibration; its verdict says how many of its values these data show."""
    status = {estimate["status"] for estimate in summary["estimates"].values()}
    verdict = "pass" if status == {"measured"} else "partial" if summary["ok"] else "fail"
    return add(session, project_id, KIND, files, inputs, options, verdict, summary)


def remove(session: Session, project_id: str, number: int) -> None:
    """Delete a calibration; what it changed of the setup stays. Its number is free again only if it was the last."""
    row = get_result(session, project_id, KIND, number)
    note(session, project_id, "calibration-deleted", number=number, sha256=row.sha256)
    owned = (FileRow.project_id == project_id, FileRow.owner == f"{KIND}:{number}")
    session.execute(delete(FileRow).where(*owned))
    session.delete(row)
    touch(session, project_id)


def applied(session: Session, project_id: str, rows: Sequence[ResultRow]) -> list[Applied]:
    """Return for each calibration whether its patch is in force now, was once since it was made, or never."""
    first = min((row.inputs["setup_version"] for row in rows), default=0)
    present = current(session, project_id, "setup").content
    versions = versions_since(session, project_id, "setup", first)
    return [_applied(row, present, versions) for row in rows]


def _applied(row: ResultRow, present: dict[str, Any], versions: list[Any]) -> Applied:
    patch = row.summary["patch"]
    if not patch:
        return "nothing"
    if _holds(patch, present):
        return "now"
    later = (v.content for v in versions if v.version > row.inputs["setup_version"])
    return "earlier" if any(_holds(patch, content) for content in later) else "never"


def _holds(patch: Any, content: Any) -> bool:
    if isinstance(patch, dict):
        return isinstance(content, dict) and all(k in content and _holds(v, content[k]) for k, v in patch.items())
    return bool(patch == content)
