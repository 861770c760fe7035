"""Which other projects can be aligned together with one: same part, planned, scanned; and what is missing where not."""

from fastapi import APIRouter
from pydantic import Field
from sqlalchemy.orm import Session

from app.api.context import Ctx, ProjectId
from app.api.errors import documented
from app.api.models import Answer
from app.store import inputs, projects, results, scans
from app.store.freshness import changed_since
from app.store.tables import ProjectRow

router = APIRouter(prefix="/projects/{project_id}", tags=["results"])


class Companion(Answer):
    """Another project of the same part."""

    project: str
    name: str = Field(examples=["Skin panel 7, flange"])
    scans: list[int]
    """Numbers of the scans of its alignment path, oldest first."""
    missing: str
    """What it lacks before it can be aligned together, as a sentence; empty if nothing."""


@router.get("/together", responses=documented(404))
def get_together(ctx: Ctx, project_id: ProjectId) -> list[Companion]:
    """Return the other projects of this part, the last changed first (`POST alignments` with `together`)."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        part = inputs.current(session, project_id, "part")
        if not part.is_given:
            return []
        sha256 = part.content["sha256"]
        others = [row for row in projects.all_projects(session) if row.id != project_id]
        return [_companion(session, row) for row in others if _part_of(session, row) == sha256]


def _part_of(session: Session, row: ProjectRow) -> str | None:
    part = inputs.current(session, row.id, "part")
    return part.content["sha256"] if part.is_given else None


def _companion(session: Session, row: ProjectRow) -> Companion:
    taken = [scan.number for scan in scans.all_scans(session, row.id) if scan.path in (None, "alignment")]
    plan = results.latest(session, row.id, "plan")
    missing = ""
    if plan is None:
        missing = "It is not planned yet."
    elif changed_since(session, plan):
        missing = "Its plan is out of date."
    elif not taken:
        missing = "It has no alignment scan yet."
    return Companion(project=row.id, name=row.name, scans=taken, missing=missing)
