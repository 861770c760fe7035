"""Job rows: queued, running, then done, failed or cancelled."""

from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.store.content import digest_of
from app.store.names import is_id, new_id, now
from app.store.projects import get
from app.store.refusal import not_found
from app.store.tables import JobRow
from planner.issues import Issue

OPEN = ("queued", "running")


def find_open_or_add(session: Session, project_id: str, kind: str, spec: dict[str, Any]) -> tuple[JobRow, bool]:
    """Return the open job that does exactly this work, or a new queued one (then True)."""
    get(session, project_id)
    key = digest_of([kind, spec])
    same = select(JobRow).where(JobRow.project_id == project_id, JobRow.key == key, JobRow.state.in_(OPEN))
    row = session.scalars(same).first()
    if row is not None:
        return row, False
    at = now()
    row = JobRow(
        id=new_id(), project_id=project_id, kind=kind, key=key, state="queued", spec=spec, attempts=0, result=None, issues=[],
        created=at, changed=at,
    )  # fmt: skip
    session.add(row)
    session.flush()
    return row, True


def done_before(session: Session, project_id: str, kind: str, spec: dict[str, Any]) -> JobRow | None:
    """Return the last job that did exactly this work and succeeded."""
    same = select(JobRow).where(
        JobRow.project_id == project_id, JobRow.key == digest_of([kind, spec]), JobRow.state == "done"
    )
    return session.scalars(same.order_by(JobRow.changed.desc()).limit(1)).first()


def get_job(session: Session, job_id: str) -> JobRow:
    """Return a job; raises Refusal 404."""
    row = session.get(JobRow, job_id) if is_id(job_id) else None
    if row is None:
        raise not_found("job", job_id[:40])
    return row


def jobs_of(session: Session, project_id: str, limit: int = 50) -> list[JobRow]:
    """Return the jobs of a project, newest first."""
    mine = select(JobRow).where(JobRow.project_id == project_id)
    return list(session.scalars(mine.order_by(JobRow.created.desc(), JobRow.id).limit(limit)))


def last_job(session: Session, project_id: str, kind: str) -> JobRow | None:
    """Return the newest job of a kind."""
    mine = select(JobRow).where(JobRow.project_id == project_id, JobRow.kind == kind)
    return session.scalars(mine.order_by(JobRow.created.desc(), JobRow.id).limit(1)).first()


def count(session: Session, state: str) -> int:
    """Return the number of jobs in a state."""
    return session.scalar(select(func.count()).select_from(JobRow).where(JobRow.state == state)) or 0


def take_next(session: Session) -> JobRow | None:
    """Mark the oldest queued job as running and return it."""
    row = session.scalars(
        select(JobRow).where(JobRow.state == "queued").order_by(JobRow.created, JobRow.id).limit(1)
    ).first()
    if row is not None:
        row.state, row.attempts, row.changed = "running", row.attempts + 1, now()
    return row


def close_job(row: JobRow, state: str, result: dict[str, Any] | None = None, issues: tuple[Issue, ...] = ()) -> None:
    """Close a job."""
    row.state, row.result, row.changed = state, result, now()
    row.issues = [issue.to_json() for issue in issues]


def requeue_unfinished(session: Session, max_attempts: int) -> tuple[list[JobRow], list[JobRow]]:
    """Queue again what a killed server left running; give up on what killed it too often. Returns (queued, given up)."""
    again: list[JobRow] = []
    given_up: list[JobRow] = []
    for row in session.scalars(select(JobRow).where(JobRow.state == "running")):
        if row.attempts >= max_attempts:
            text = f"the work was interrupted {row.attempts} times and was given up."
            remedy = "Check memory and disk of the machine, then start it again."
            close_job(row, "failed", None, (Issue("error", "job-given-up", text, remedy),))
            given_up.append(row)
        else:
            row.state, row.changed = "queued", now()
            again.append(row)
    return again, given_up
