"""Routes that take a project out as one ZIP and bring it in again; and whether the server is well."""

import asyncio
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response, status
from fastapi.responses import StreamingResponse

from app.api.context import Ctx, ProjectId
from app.api.downloads import disposition
from app.api.errors import documented
from app.api.etags import tag
from app.api.models import Project
from app.api.receive import receive
from app.api.upload_body import one_file, upload_body
from app.store.archive import archive, manifest_of
from app.store.journal import first_broken, lines
from app.store.projects import get
from app.store.restore import restore
from app.store.store import VERSION, Store, free_bytes
from app.store.tables import ProjectRow

router = APIRouter(tags=["archive"])
ZIP: dict[int | str, dict[str, Any]] = {200: {"content": {"application/zip": {}}}}
IMPORT_BODY = upload_body(one_file(), bare="application/zip")


@router.get("/projects/{project_id}/archive", responses=documented(404) | ZIP, response_class=StreamingResponse)
def get_archive(ctx: Ctx, project_id: ProjectId) -> StreamingResponse:
    """Download the whole project as one ZIP."""
    with ctx.store.db.read() as session:
        name = get(session, project_id).name
        manifest = manifest_of(session, project_id)
    headers = {"Content-Disposition": disposition(f"{name}.echobase.zip"), "Cache-Control": "no-store"}
    return StreamingResponse(archive(ctx.store.blobs, manifest), media_type="application/zip", headers=headers)


@router.post(
    "/projects/import", status_code=status.HTTP_201_CREATED, responses=documented(413, 507), openapi_extra=IMPORT_BODY
)
async def import_project(ctx: Ctx, request: Request, response: Response) -> Project:
    """Make a project from an archive. Programs in it are proven again before they are handed out."""
    with ctx.store.busy():
        received = await receive(request, ctx.store, ctx.settings.max_archive_bytes, 1, "archive", "project.zip")
        row = await asyncio.to_thread(_restore, ctx.store, received.files[0][1].sha256)
    # The ZIP itself is not kept: no row names it.
    await asyncio.to_thread(ctx.store.tidy)
    response.headers["Location"] = f"/api/v1/projects/{row.id}"
    tag(response, row.version)
    return Project.model_validate(row)


@router.get("/projects/{project_id}/journal", responses=documented(404))
def get_journal(ctx: Ctx, project_id: ProjectId, after: Annotated[int, Query(ge=0)] = 0) -> dict[str, Any]:
    """Return what was done to a project, line by line, and whether the chain of seals is whole."""
    with ctx.store.db.read() as session:
        get(session, project_id)
        rows = lines(session, project_id)
    shown = [
        {"number": r.number, "at": r.at, "action": r.action, "detail": r.detail, "digest": r.digest}
        for r in rows
        if r.number > after
    ]
    return {"intact": first_broken(rows) is None, "lines": shown}


@router.get("/health", tags=["server"], responses=documented())
def health(ctx: Ctx) -> dict[str, Any]:
    """Return whether the server is well."""
    with ctx.store.db.read() as session:
        session.connection().exec_driver_sql("SELECT 1")
    missing = len(ctx.store.swept.missing)
    return {
        "status": "ok" if not missing else "files-missing",
        "version": VERSION,
        "free_bytes": free_bytes(ctx.store),
        "missing_files": missing,
        "jobs": ctx.runner.counts(),
    }


def _restore(store: Store, sha256: str) -> ProjectRow:
    with store.blobs.open(sha256) as file:
        return restore(store, file)
