"""Projects: made, listed, renamed, deleted."""

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from app.store.journal import note
from app.store.names import clean_text, is_id, new_id, now
from app.store.refusal import not_found, refuse
from app.store.store import Store
from app.store.tables import ProjectRow


def create(store: Store, name: str) -> ProjectRow:
    """Make an empty project."""
    at = now()
    row = ProjectRow(id=new_id(), name=clean_text(name, "name"), version=1, created=at, changed=at)
    with store.db.write() as session:
        session.add(row)
        session.flush()
        note(session, row.id, "project-created", name=row.name)
    return row


def get(session: Session, project_id: str) -> ProjectRow:
    """Return a project; raises Refusal 404."""
    row = session.get(ProjectRow, project_id) if is_id(project_id) else None
    if row is None:
        raise not_found("project", project_id[:40])
    return row


def all_projects(session: Session) -> list[ProjectRow]:
    """Return every project, the last changed first."""
    return list(session.scalars(select(ProjectRow).order_by(ProjectRow.changed.desc(), ProjectRow.id)))


def rename(store: Store, project_id: str, name: str, expected: int | None) -> ProjectRow:
    """Rename a project; raises Refusal 412 if `expected` is not its version."""
    cleaned = clean_text(name, "name")
    with store.db.write() as session:
        row = get(session, project_id)
        check_version("project", row.version, expected)
        note(session, project_id, "project-renamed", before=row.name, after=cleaned)
        row.name, row.version, row.changed = cleaned, row.version + 1, now()
    store.tell(project_id, "project", version=row.version)
    return row


def remove(store: Store, project_id: str, expected: int | None = None) -> None:
    """Delete a project with everything it has; its journal stays."""
    with store.db.write() as session:
        row = get(session, project_id)
        check_version("project", row.version, expected)
        note(session, project_id, "project-deleted", name=row.name)
        session.execute(delete(ProjectRow).where(ProjectRow.id == project_id))
    store.tell(project_id, "deleted")
    store.tidy()


def touch(session: Session, project_id: str) -> None:
    """Remember that something in the project changed."""
    get(session, project_id).changed = now()


def check_version(what: str, present: int, expected: int | None) -> None:
    """Raise Refusal 412 if somebody changed it since `expected` was read; None: the caller does not mind."""
    if expected is not None and expected != present:
        raise refuse(
            412, "changed-meanwhile", f"the {what} was changed meanwhile (version {present}, you had {expected}).",
            "Read it again, then repeat your change.", what,
        )  # fmt: skip
