"""Routes of reports: of an alignment, an assessment or a calibration, as HTML, PDF, JSON or CSV, with what is known by now."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query, Response
from sqlalchemy.orm import Session

from app.api.context import Context, Ctx, Number, ProjectId
from app.api.downloads import attachment, disposition, zipped
from app.api.errors import documented
from app.api.etags import IfMatch, expected, tag
from app.report.document import Acceptance
from app.report.package import Report, stored
from app.report.record import Record
from app.security import CSP_DOCUMENT
from app.store import projects, results
from app.store.content import get_bytes
from app.store.freshness import changed_since, in_words
from app.store.inputs import files_of
from app.store.refusal import not_found
from app.store.result_records import OF, edit, record_in, record_of
from app.store.tables import FileRow, ResultRow

router = APIRouter(prefix="/projects/{project_id}", tags=["results"])
Kind = Literal["alignment", "assessment", "calibration"]
Recorded = Literal["alignment", "assessment"]
Format = Literal["html", "pdf", "json", "csv"]
FOLDER = {"alignment": "correction", "assessment": "assessment", "calibration": "calibration"}
# Programs and readings have addresses of their own.
NO_DOCUMENTS = ("corrected/", "readings/")
MEDIA = {
    "html": "text/html; charset=utf-8",
    "pdf": "application/pdf",
    "json": "application/json",
    "csv": "text/csv; charset=utf-8",
}
ANSWERS: dict[int | str, dict[str, Any]] = {200: {"content": {kind.split(";")[0]: {} for kind in MEDIA.values()}}}
SVG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/svg+xml": {}}}}
FigureName = Annotated[str, Path(pattern=r"^[a-z0-9-]{1,40}$", examples=["deviation"])]
ZIP: dict[int | str, dict[str, Any]] = {200: {"content": {"application/zip": {}}}}


@router.get("/{kind}s/{number}/report", responses=documented(404) | ANSWERS, response_class=Response)
def get_report(
    ctx: Ctx,
    project_id: ProjectId,
    kind: Kind,
    number: Number,
    format: Annotated[Format, Query(description="HTML is one file without scripts.")] = "html",
    download: Annotated[bool, Query(description="As an attachment.")] = False,
) -> Response:
    """Return the report of a result; of an alignment or assessment with its own record and who accepted it."""
    with ctx.store.db.read() as session:
        project = projects.get(session, project_id)
        row = results.get_result(session, project_id, kind, number)
        files = files_of(session, project_id, f"{kind}:{number}")
        report = _report(ctx, session, row, files)
    content = _as_made(ctx, files, kind, format) if report is None else getattr(report, format)()
    name = f"{project.name} {kind} {number}.{format}"
    headers = {
        "Content-Disposition": disposition(name, "attachment" if download else "inline"),
        "Cache-Control": "no-store",
    }
    if format == "html":
        headers["Content-Security-Policy"] = CSP_DOCUMENT
    return Response(content, media_type=MEDIA[format], headers=headers)


@router.get("/{kind}s/{number}/figures/{name}", responses=documented(404) | SVG, response_class=Response)
def get_figure(ctx: Ctx, project_id: ProjectId, kind: Kind, number: Number, name: FigureName) -> Response:
    """Return one drawing of a report as SVG; `report?format=json` names them."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        results.get_result(session, project_id, kind, number)
        files = files_of(session, project_id, f"{kind}:{number}")
    path = f"{FOLDER[kind]}/figures/{name}.svg"
    if path not in files:
        raise not_found("drawing", name)
    headers = {"Content-Security-Policy": CSP_DOCUMENT, "Cache-Control": "no-store"}
    return Response(get_bytes(ctx.store.blobs, files[path].sha256), media_type="image/svg+xml", headers=headers)


@router.get("/{kind}s/{number}/files", responses=documented(404) | ZIP, response_class=Response)
def get_files(ctx: Ctx, project_id: ProjectId, kind: Kind, number: Number) -> Response:
    """Download the documents of a result as ZIP: reports, JSON, tables, maps. Programs and readings have their own address."""
    with ctx.store.db.read() as session:
        project = projects.get(session, project_id)
        row = results.get_result(session, project_id, kind, number)
        rows = files_of(session, project_id, f"{kind}:{number}")
        report = _report(ctx, session, row, rows)
    documents = {n: get_bytes(ctx.store.blobs, f.sha256) for n, f in rows.items() if not n.startswith(NO_DOCUMENTS)}
    if report is not None:
        documents |= report.files(FOLDER[kind])
    return attachment(zipped(documents), f"{project.name} {kind} {number}.zip", "application/zip")


@router.get("/{kind}s/{number}/record", responses=documented(404))
def get_record(ctx: Ctx, project_id: ProjectId, kind: Recorded, number: Number, response: Response) -> Record:
    """Return the record of a result: as the project's was when it was made, or as last edited for it."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = record_of(session, results.get_result(session, project_id, kind, number))
    tag(response, row.version)
    return Record.model_validate(row.content)


@router.put("/{kind}s/{number}/record", responses=documented(404, 412))
def put_record(
    ctx: Ctx,
    project_id: ProjectId,
    kind: Recorded,
    number: Number,
    body: Record,
    response: Response,
    if_match: IfMatch = None,
) -> Record:
    """Replace the record of one result; its reports show it from now on, those of other results stay as they are."""
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        result = results.get_result(session, project_id, kind, number)
        row, changed = edit(session, result, body.model_dump(mode="json"), expected(if_match))
    if changed:
        ctx.store.tell(project_id, "record", of=f"{kind} {number}", version=row.version)
    tag(response, row.version)
    return body


def _report(ctx: Context, session: Session, row: ResultRow, files: dict[str, FileRow]) -> Report | None:
    """Return the report with the result's record and acceptance; None for a result that was made without one."""
    folder = FOLDER[row.kind]
    document = files.get(f"{folder}/report.document.json")
    if document is None:
        return None
    start = f"{folder}/figures/"
    drawn = {
        name.removeprefix(start).removesuffix(".svg"): get_bytes(ctx.store.blobs, file.sha256)
        for name, file in files.items()
        if name.startswith(start)
    }
    accepted = Acceptance.model_validate(row.accepted) if row.accepted else None
    made = stored(get_bytes(ctx.store.blobs, document.sha256), drawn)
    if row.kind not in OF:
        # A calibration says what these readings show; the cell that it was computed with is part of it.
        return made.completed(None, None, row.created)
    return made.completed(record_in(session, row), accepted, row.created, _outdated(session, row))


def _outdated(session: Session, row: ResultRow) -> str:
    """Return as a sentence why a result is not the one that counts; empty if it is."""
    changed = changed_since(session, row)
    if changed:
        return f"Changed since it was made: {in_words(changed)}."
    newest = results.latest(session, row.project_id, row.kind)
    if newest is not None and newest.number != row.number and newest.sha256 != row.sha256:
        return f"The {row.kind} in force is number {newest.number}; this is number {row.number}."
    return ""


def _as_made(ctx: Context, files: dict[str, FileRow], kind: str, form: str) -> bytes:
    name = f"{FOLDER[kind]}/report.{form}"
    if name not in files:
        raise not_found("file", name)
    return get_bytes(ctx.store.blobs, files[name].sha256)
