"""Scans: files as they came, numbered, never changed."""

from typing import Any

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from app.store.blobs import Blob
from app.store.content import digest_of_files
from app.store.inputs import add_files
from app.store.journal import note
from app.store.names import now
from app.store.projects import get, touch
from app.store.refusal import not_found
from app.store.tables import FileRow, ScanRow


def add(
    session: Session,
    project_id: str,
    files: dict[str, Blob],
    origin: str,
    base: str | None,
    path: str | None,
    detail: dict[str, Any],
) -> ScanRow:
    """Add a scan; `files` by shown name. `base`: the BASE that was active, for files that cannot say."""
    get(session, project_id)
    highest = session.scalar(select(func.max(ScanRow.number)).where(ScanRow.project_id == project_id))
    # The BASE belongs to what a scan means: the same file in another BASE is another scan.
    named = {name: blob.sha256 for name, blob in files.items()} | ({"base": base} if base else {})
    row = ScanRow(
        project_id=project_id, number=(highest or 0) + 1, sha256=digest_of_files(named), origin=origin, base=base, path=path,
        detail=detail, created=now(),
    )  # fmt: skip
    session.add(row)
    add_files(session, project_id, f"scan:{row.number}", files)
    note(session, project_id, "scan-added", number=row.number, sha256=row.sha256, origin=origin)
    touch(session, project_id)
    return row


def get_scan(session: Session, project_id: str, number: int) -> ScanRow:
    """Return a scan; raises Refusal 404."""
    row = session.scalars(select(ScanRow).where(ScanRow.project_id == project_id, ScanRow.number == number)).first()
    if row is None:
        raise not_found("scan", number)
    return row


def all_scans(session: Session, project_id: str) -> list[ScanRow]:
    """Return the scans of a project, oldest first."""
    return list(session.scalars(select(ScanRow).where(ScanRow.project_id == project_id).order_by(ScanRow.number)))


def remove(session: Session, project_id: str, number: int) -> None:
    """Delete a scan; results made from it become stale. Its number is free again only if it was the last."""
    row = get_scan(session, project_id, number)
    note(session, project_id, "scan-deleted", number=number, sha256=row.sha256)
    session.execute(delete(FileRow).where(FileRow.project_id == project_id, FileRow.owner == f"scan:{number}"))
    session.delete(row)
