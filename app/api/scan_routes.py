"""Routes of scans: streamed upload, list, download, delete."""

import asyncio
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Query, Request, Response, status
from fastapi.responses import StreamingResponse

from app.api.context import Ctx, Number, ProjectId
from app.api.downloads import streamed
from app.api.errors import documented
from app.api.models import Scan
from app.api.receive import Received, receive
from app.api.scan_glance import glance
from app.api.upload_body import choice, files, upload_body
from app.store import inputs, projects, scans
from app.store.blobs import Blob
from app.store.refusal import Refusal, not_found, refuse
from app.store.results import correction_in_force
from app.store.store import Store
from app.store.tables import ScanRow
from planner.errors import EchoBaseError

router = APIRouter(prefix="/projects/{project_id}/scans", tags=["scans"])
BaseName = Literal["nominal", "corrected"]
UPLOAD_BODY = upload_body(
    files("One file, or two: poses and readings."),
    {
        "base": choice("nominal", "corrected", example="nominal"),
        "path": choice("alignment", "inspection", "corrected", example="alignment"),
    },
)


@router.post("", status_code=status.HTTP_201_CREATED, responses=documented(404, 413, 507), openapi_extra=UPLOAD_BODY)
async def upload_scan(
    ctx: Ctx,
    project_id: ProjectId,
    request: Request,
    response: Response,
    name: Annotated[str | None, Query(description="File name, for a bare body.", examples=["scan.csv"])] = None,
    base: Annotated[BaseName | None, Query(description="BASE that was active, for files that cannot say.")] = None,
    path: Annotated[
        Literal["alignment", "inspection", "corrected"] | None, Query(description="Path it was taken on.")
    ] = None,
) -> Scan:
    """Upload a scan: a form with one or two `file`s and `base`, or a bare file with `?name=scan.csv`.

    It is kept as it came and read when it is used; what a reader finds wrong is then said with the line it is in. A file whose
    beginning says that it is no scan is refused at once.
    """
    try:
        with ctx.store.busy():
            await asyncio.to_thread(_exists, ctx.store, project_id)
            received = await receive(request, ctx.store, ctx.settings.max_scan_bytes, 2, "scan", name)
            said_base = _choice(received.fields.get("base"), ("nominal", "corrected"), "base") or base
            said_path = _choice(received.fields.get("path"), ("alignment", "inspection", "corrected"), "path") or path
            for shown, blob in received.files:
                await asyncio.to_thread(glance, ctx.store.blobs, shown, blob)
            row = await asyncio.to_thread(_add, ctx.store, project_id, received, said_base, said_path)
    except (EchoBaseError, Refusal):
        # What was refused is named by no row: it goes.
        await asyncio.to_thread(ctx.store.tidy)
        raise
    ctx.store.tell(project_id, "scan", number=row.number)
    response.headers["Location"] = f"/api/v1/projects/{project_id}/scans/{row.number}"
    return await asyncio.to_thread(_answer, ctx.store, row)


@router.get("", responses=documented(404))
def list_scans(ctx: Ctx, project_id: ProjectId) -> list[Scan]:
    """Return the scans of a project, oldest first."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        rows = scans.all_scans(session, project_id)
    return [_answer(ctx.store, row) for row in rows]


@router.get("/{number}", responses=documented(404))
def get_scan(ctx: Ctx, project_id: ProjectId, number: Number) -> Scan:
    """Return a scan."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = scans.get_scan(session, project_id, number)
    return _answer(ctx.store, row)


@router.get("/{number}/files/{place}", responses=documented(404), response_class=StreamingResponse)
def download_scan(ctx: Ctx, project_id: ProjectId, number: Number, place: int) -> StreamingResponse:
    """Download a file of a scan as it came; `place` counts its files from 0."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        scans.get_scan(session, project_id, number)
        files = sorted(inputs.files_of(session, project_id, f"scan:{number}").items())
    if not 0 <= place < len(files):
        raise not_found("file", place)
    name, row = files[place]
    return streamed(ctx.store.blobs, name, row.sha256, row.size)


@router.delete("/{number}", status_code=status.HTTP_204_NO_CONTENT, responses=documented(404))
def delete_scan(ctx: Ctx, project_id: ProjectId, number: Number) -> None:
    """Delete a scan; alignments made from it become stale."""
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        scans.remove(session, project_id, number)
    ctx.store.tell(project_id, "scan", number=number)
    ctx.store.tidy()


def _exists(store: Store, project_id: str) -> None:
    with store.db.read() as session:
        projects.get(session, project_id)


def _add(store: Store, project_id: str, received: Received, base: str | None, path: str | None) -> ScanRow:
    files: dict[str, Blob] = {}
    for name, blob in received.files:
        # Two files of one name stay two files, in the order they came.
        files[name if name not in files else f"2-{name}"] = blob
    with store.db.write() as session:
        # A scan remembers the BASE it was taken in: which correction that was, before another one is in force.
        detail = {"correction": correction_in_force(session, project_id)} if base == "corrected" else {}
        return scans.add(session, project_id, files, "uploaded", base, path, detail)


def _answer(store: Store, row: ScanRow) -> Scan:
    with store.db.read() as session:
        files = sorted(inputs.files_of(session, row.project_id, f"scan:{row.number}").items())
    listed = [{"name": name, "bytes": file.size, "sha256": file.sha256} for name, file in files]
    shown = {key: getattr(row, key) for key in ("number", "base", "path", "detail", "created")}
    return Scan(origin=cast(Literal["uploaded", "simulated"], row.origin), files=listed, **shown)


def _choice(text: str | None, choices: tuple[str, ...], what: str) -> Any:
    if not text:
        return None
    if text not in choices:
        raise refuse(422, f"{what}-unknown", f"there is no {what} '{text[:40]}'.", f"Use {' or '.join(choices)}.", what)
    return text
