"""The journal: what was done to a project, line by line, each line sealed by the one before it."""

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store.content import digest_of
from app.store.names import now
from app.store.tables import JournalRow

START = "0" * 64


def note(session: Session, project_id: str, action: str, **detail: Any) -> JournalRow:
    """Append a line within the transaction that does what it tells."""
    last = _last(session, project_id)
    number, before = (last.number + 1, last.digest) if last else (1, START)
    line = {"project": project_id, "number": number, "at": now(), "action": action, "detail": detail}
    row = JournalRow(
        project_id=project_id, number=number, at=line["at"], action=action, detail=detail, digest=seal(before, line)
    )
    session.add(row)
    session.flush()
    return row


def seal(before: str, line: dict[str, Any]) -> str:
    """Return the digest of a line: over the digest before it and the line's own canonical JSON."""
    return digest_of([before, line])


def lines(session: Session, project_id: str) -> list[JournalRow]:
    """Return the journal of a project, oldest first."""
    return list(
        session.scalars(select(JournalRow).where(JournalRow.project_id == project_id).order_by(JournalRow.number))
    )


def first_broken(rows: list[JournalRow]) -> int | None:
    """Return the number of the first line that was changed, removed or put in later; None for an intact journal."""
    before = START
    for expected, row in enumerate(rows, start=1):
        line = {
            "project": row.project_id,
            "number": row.number,
            "at": row.at,
            "action": row.action,
            "detail": row.detail,
        }
        if row.number != expected or seal(before, line) != row.digest:
            return expected
        before = row.digest
    return None


def _last(session: Session, project_id: str) -> JournalRow | None:
    newest = select(JournalRow).where(JournalRow.project_id == project_id).order_by(JournalRow.number.desc()).limit(1)
    return session.scalars(newest).first()
