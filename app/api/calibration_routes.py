"""Routes of calibrations: files in; values, patch and report kept as a result. Nothing is put in force."""

import asyncio
import base64
import tempfile
import threading
from pathlib import Path
from typing import Annotated, Any, cast

from fastapi import APIRouter, Query, Request, Response, status
from fastapi.responses import StreamingResponse
from sqlalchemy.orm import Session

from app.api.calibration_models import CalibrationInfo, Kind, Target, calibration_info
from app.api.context import Context, Ctx, Number, ProjectId
from app.api.downloads import streamed
from app.api.errors import documented
from app.api.hangup import while_awaited
from app.api.receive import Received, receive
from app.api.upload_body import choice, upload_body
from app.api.upload_body import files as several
from app.jobs.specs import suffix_of
from app.store import calibrations as kept
from app.store import inputs, projects, results
from app.store.content import put_bytes
from app.store.names import safe_member
from app.store.refusal import not_found, refuse
from app.store.tables import ResultRow
from planner.errors import EchoBaseError, fail
from planner.sandbox import STOP_WITHIN_S, run_limited
from planner.setup import Setup

router = APIRouter(prefix="/projects/{project_id}/calibrations", tags=["inputs"])
MOST_FILES = 8
LARGEST_RADIUS_MM = 10_000.0
# A calibration is a process of its own that computes for seconds; more of them at once would only wait for each other.
_AT_ONCE = threading.BoundedSemaphore(2)
CHILD = "app.steps.calibrate:in_child"
ENDED = {
    "reader-time": ("The calibration took too long.", "Use fewer readings: some thousand are plenty."),
    "reader-memory": ("The calibration needs too much memory.", "Use fewer readings: some thousand are plenty."),
    "reader-crash": (
        "Nothing could be computed from these readings.",
        "Check kind, columns and units, or record again.",
    ),
}
UPLOAD_BODY = upload_body(
    several("One file or more, taken together; tcp: one scan, of one file or two."),
    {"target": choice("plane", "sphere", example="plane"), "radius_mm": {"type": "number", "example": 20.0}},
)


@router.post(
    "/{kind}", status_code=status.HTTP_201_CREATED, responses=documented(404, 413, 507), openapi_extra=UPLOAD_BODY
)
async def calibrate(
    ctx: Ctx,
    project_id: ProjectId,
    kind: Kind,
    request: Request,
    response: Response,
    name: Annotated[str | None, Query(description="File name, for a bare body.", examples=["tilt.csv"])] = None,
    target: Annotated[Target | None, Query(description="tcp: the fixed target that was scanned.")] = None,
    radius_mm: Annotated[
        float | None, Query(gt=0, le=LARGEST_RADIUS_MM, description="tcp: radius of the sphere; none: to be found.")
    ] = None,
) -> CalibrationInfo:
    """Calibrate tilt loss, couplant or TCP from measurements, with the setup in force.

    What was found is kept as a result with its readings and report; nothing is put in force. The same files in the same
    setup are the same calibration. A client that hangs up ends the work; nothing is kept of it then.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="echobase-calibrate-") as folder, ctx.store.busy():
            cell = await asyncio.to_thread(_cell, ctx, project_id)
            received = await receive(request, ctx.store, ctx.settings.max_scan_bytes, MOST_FILES, "file", name)
            options = {
                "kind": kind,
                "target": _target(received.fields.get("target")) or target or "plane",
                "radius_mm": _radius(received.fields.get("radius_mm")) or radius_mm,
            }
            answer, is_new = await while_awaited(
                request, lambda stop: _made(ctx, project_id, cell, received, options, Path(folder), stop)
            )
    finally:
        # Readings of a calibration that was refused are named by no row: they go.
        await asyncio.to_thread(ctx.store.tidy)
    if is_new:
        ctx.store.tell(project_id, "calibration", number=answer.number)
    response.headers["Cache-Control"] = "no-store"
    response.headers["Location"] = answer.report.removesuffix("/report")
    return answer


@router.get("", responses=documented(404))
def list_calibrations(ctx: Ctx, project_id: ProjectId) -> list[CalibrationInfo]:
    """Return all calibrations, oldest first, and which of them are in force."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return _answers(session, project_id, results.all_results(session, project_id, kept.KIND))


@router.get("/{number}", responses=documented(404))
def get_calibration(ctx: Ctx, project_id: ProjectId, number: Number) -> CalibrationInfo:
    """Return a calibration."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return _answers(session, project_id, [results.get_result(session, project_id, kept.KIND, number)])[0]


@router.get("/{number}/readings/{place}", responses=documented(404), response_class=StreamingResponse)
def download_readings(ctx: Ctx, project_id: ProjectId, number: Number, place: int) -> StreamingResponse:
    """Download a file of readings as it came; `place` counts `inputs` from 0."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = results.get_result(session, project_id, kept.KIND, number)
        named = row.inputs["files"]
        if not 0 <= place < len(named):
            raise not_found("file", place)
        owned = inputs.files_of(session, project_id, f"{kept.KIND}:{number}").values()
        (size,) = {file.size for file in owned if file.sha256 == named[place]["sha256"]}
    return streamed(ctx.store.blobs, named[place]["name"], named[place]["sha256"], size)


@router.delete("/{number}", status_code=status.HTTP_204_NO_CONTENT, responses=documented(404))
def delete_calibration(ctx: Ctx, project_id: ProjectId, number: Number) -> None:
    """Delete a calibration with its readings; what it changed of the setup stays."""
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        kept.remove(session, project_id, number)
    ctx.store.tell(project_id, "calibration", number=number)
    ctx.store.tidy()


def _answers(session: Session, project_id: str, rows: list[ResultRow]) -> list[CalibrationInfo]:
    sha256 = kept.cell_in(session, project_id).sha256
    found = kept.applied(session, project_id, rows)
    return [calibration_info(row, applied, sha256) for row, applied in zip(rows, found, strict=True)]


def _cell(ctx: Context, project_id: str) -> kept.Cell:
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return kept.cell_in(session, project_id)


def _made(
    ctx: Context,
    project_id: str,
    cell: kept.Cell,
    received: Received,
    options: dict[str, Any],
    folder: Path,
    stop: threading.Event,
) -> tuple[CalibrationInfo, bool]:
    """Return the calibration of what came, and whether it is new; the blobs that came are held by the caller."""
    made_from = kept.inputs_of(cell, received.files)
    with ctx.store.db.read() as session:
        if row := kept.same(session, project_id, made_from, options):
            return _answers(session, project_id, [row])[0], False
    setup = Setup.model_validate(cell.setup).model_dump(mode="json")
    names = [shown for shown, _ in received.files]
    files = _lay_out(ctx, received, folder)
    found = _in_child(folder, {**options, "setup": setup, "names": names, "files": files}, stop)
    blobs = {name: put_bytes(ctx.store.blobs, base64.b64decode(text)) for name, text in found.pop("files").items()}
    for place, (shown, blob) in enumerate(received.files, start=1):
        blobs[f"{kept.READINGS}/{place}-{safe_member(shown)}"] = blob
    if stop.is_set():
        raise _stopped()
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        row = kept.same(session, project_id, made_from, options)
        is_new = row is None
        row = row or kept.keep(session, project_id, blobs, made_from, options, found)
        session.flush()
        return _answers(session, project_id, [row])[0], is_new


def _lay_out(ctx: Context, received: Received, folder: Path) -> list[str]:
    """Copy the files into a folder; a name only keeps the suffix a reader goes by."""
    files = []
    for place, (shown, blob) in enumerate(received.files, start=1):
        files.append(f"file-{place}{suffix_of(shown)}")
        ctx.store.blobs.copy_to(blob.sha256, folder / files[-1])
    return files


def _stopped() -> EchoBaseError:
    return fail("calibration-stopped", "The calibration was stopped; nothing was kept.", "Send the files again.", "")


def _in_child(folder: Path, options: dict[str, Any], stop: threading.Event) -> dict[str, Any]:
    while not _AT_ONCE.acquire(timeout=STOP_WITHIN_S):
        if stop.is_set():
            raise _stopped()
    try:
        _, found = run_limited(CHILD, folder, options, stop=stop)
    except EchoBaseError as error:
        issue = error.issues[0]
        if stop.is_set():
            raise _stopped() from error
        if issue.where != folder.name:
            raise
        # It was not a file that could not be read: the calibration as a whole ended without an answer.
        text, remedy = ENDED.get(issue.code, ENDED["reader-crash"])
        code = issue.code.replace("reader", "calibration")
        raise fail(code, text, remedy, " + ".join(options["names"])) from error
    finally:
        _AT_ONCE.release()
    found.pop("console")
    return found


def _target(text: str | None) -> Target | None:
    if text and text not in ("plane", "sphere"):
        raise refuse(422, "target-unknown", f"there is no target '{text[:40]}'.", "Use plane or sphere.", "target")
    return cast(Target, text) if text else None


def _radius(text: str | None) -> float | None:
    if not text or not text.strip():
        return None
    try:
        radius = float(text)
    except ValueError:
        radius = 0.0
    if not 0.0 < radius <= LARGEST_RADIUS_MM:
        remedy = f"State it in mm, above 0 and up to {LARGEST_RADIUS_MM:.0f}."
        raise refuse(422, "radius_mm-invalid", f"'{text[:40]}' is no radius of a sphere.", remedy, "radius_mm")
    return radius
