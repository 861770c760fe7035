"""Results: plans, alignments, assessments and calibrations, each bound to the digests of what it was made from."""

from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.store.blobs import Blob
from app.store.content import digest_of_files
from app.store.inputs import add_files, current, files_of
from app.store.journal import note
from app.store.names import clean_text, now
from app.store.projects import get, touch
from app.store.refusal import not_found
from app.store.result_records import OF, VERSION_KEY, copy
from app.store.tables import ResultRow


def add(
    session: Session, project_id: str, kind: str, files: dict[str, Blob], inputs: dict[str, Any], options: dict[str, Any],
    verdict: str, summary: dict[str, Any],
) -> ResultRow:  # fmt: skip
    """Add a result with its files. The record in force is the one of this result, whatever is written down later."""
    get(session, project_id)
    if kind in OF:
        inputs = {VERSION_KEY: current(session, project_id, "record").version} | inputs
    of_kind = (ResultRow.project_id == project_id, ResultRow.kind == kind)
    highest = session.scalar(select(func.max(ResultRow.number)).where(*of_kind))
    sha256 = digest_of_files((name, blob.sha256) for name, blob in files.items())
    row = ResultRow(
        project_id=project_id, kind=kind, number=(highest or 0) + 1, sha256=sha256, inputs=inputs, options=options,
        verdict=verdict, summary=summary, accepted=None, created=now(),
    )  # fmt: skip
    session.add(row)
    add_files(session, project_id, f"{kind}:{row.number}", files)
    note(session, project_id, f"{kind}-made", number=row.number, sha256=sha256, verdict=verdict, inputs=inputs)
    touch(session, project_id)
    return row


def latest(session: Session, project_id: str, kind: str) -> ResultRow | None:
    """Return the newest result of a kind."""
    of_kind = select(ResultRow).where(ResultRow.project_id == project_id, ResultRow.kind == kind)
    return session.scalars(of_kind.order_by(ResultRow.number.desc()).limit(1)).first()


CORRECTION = "correction/correction.json"


def correction_in_force(session: Session, project_id: str) -> str:
    """Return the digest of correction.json of the newest alignment of the newest plan; empty where it found none."""
    plan, alignment = latest(session, project_id, "plan"), latest(session, project_id, "alignment")
    if plan is None or alignment is None or alignment.inputs["plan"] != plan.sha256 or alignment.verdict == "fail":
        return ""
    return files_of(session, project_id, f"alignment:{alignment.number}")[CORRECTION].sha256


def get_result(session: Session, project_id: str, kind: str, number: int) -> ResultRow:
    """Return a result; raises Refusal 404."""
    found = (ResultRow.project_id == project_id, ResultRow.kind == kind, ResultRow.number == number)
    row = session.scalars(select(ResultRow).where(*found)).first()
    if row is None:
        raise not_found(kind, number)
    return row


def all_results(session: Session, project_id: str, kind: str) -> list[ResultRow]:
    """Return the results of a kind, oldest first."""
    of_kind = select(ResultRow).where(ResultRow.project_id == project_id, ResultRow.kind == kind)
    return list(session.scalars(of_kind.order_by(ResultRow.number)))


def again(session: Session, row: ResultRow) -> ResultRow:
    """Add a result once more as the newest of its kind: the same files, and what was accepted of them."""
    files = {
        name: Blob(file.sha256, file.size)
        for name, file in files_of(session, row.project_id, f"{row.kind}:{row.number}").items()
    }
    made = add(session, row.project_id, row.kind, files, row.inputs, row.options, row.verdict, row.summary)
    # It was made when it was made; the journal says when it was taken up again.
    made.accepted, made.created = row.accepted, row.created
    copy(session, row, made)
    note(session, row.project_id, f"{row.kind}-used-again", number=made.number, made_as=row.number)
    return made


def accept(session: Session, row: ResultRow, name: str, reason: str) -> None:
    """Record who takes a result over, why, and which bytes it was."""
    accepted = {
        "name": clean_text(name, "name"),
        "reason": clean_text(reason, "reason", 1000),
        "at": now(),
        "sha256": row.sha256,
    }
    row.accepted = accepted
    note(session, row.project_id, f"{row.kind}-accepted", number=row.number, **accepted)
