"""Routes of projects themselves."""

from fastapi import APIRouter, Response, status

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented
from app.api.etags import IfMatch, expected, tag
from app.api.models import NewProject, Project, ProjectChange
from app.api.samples import fill_with_sample
from app.store import projects
from app.store.tables import ProjectRow

router = APIRouter(prefix="/projects", tags=["projects"])


@router.post("", status_code=status.HTTP_201_CREATED, responses=documented(507))
def create_project(ctx: Ctx, body: NewProject, response: Response) -> Project:
    """Make a project, empty or with a sample part."""
    row = projects.create(ctx.store, body.name)
    if body.sample:
        try:
            fill_with_sample(ctx, row.id, body.sample)
        except BaseException:
            projects.remove(ctx.store, row.id)
            raise
    response.headers["Location"] = f"/api/v1/projects/{row.id}"
    return _answer(row, response)


@router.get("", responses=documented())
def list_projects(ctx: Ctx) -> list[Project]:
    """Return all projects, the last changed first."""
    with ctx.store.db.read() as session:
        return [Project.model_validate(row) for row in projects.all_projects(session)]


@router.get("/{project_id}", responses=documented(404))
def get_project(ctx: Ctx, project_id: ProjectId, response: Response) -> Project:
    """Return a project."""
    with ctx.store.db.read() as session:
        return _answer(projects.get(session, project_id), response)


@router.patch("/{project_id}", responses=documented(404, 412))
def change_project(
    ctx: Ctx, project_id: ProjectId, body: ProjectChange, response: Response, if_match: IfMatch = None
) -> Project:
    """Rename a project."""
    return _answer(projects.rename(ctx.store, project_id, body.name, expected(if_match)), response)


@router.delete("/{project_id}", status_code=status.HTTP_204_NO_CONTENT, responses=documented(404, 412))
def delete_project(ctx: Ctx, project_id: ProjectId, if_match: IfMatch = None) -> None:
    """Delete a project with all its files. Its archive, if you took one, can be imported again."""
    remove_project(ctx, project_id, expected(if_match))


def remove_project(ctx: Context, project_id: str, version: int | None) -> None:
    """Stop what a project is doing, delete it, and close its view."""
    with ctx.store.db.read() as session:
        projects.check_version("project", projects.get(session, project_id).version, version)
    ctx.runner.cancel_project(project_id)
    projects.remove(ctx.store, project_id, version)
    ctx.views.close(project_id)


def _answer(row: ProjectRow, response: Response) -> Project:
    tag(response, row.version)
    return Project.model_validate(row)
