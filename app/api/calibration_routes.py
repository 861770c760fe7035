"""Route of calibrations: files in, values, patch, drawing and report out. Nothing is kept, nothing is put in force."""

import asyncio
import tempfile
import threading
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import IssueBody, documented
from app.api.receive import Received, receive
from app.api.upload_body import choice, files, upload_body
from app.jobs.specs import suffix_of
from app.store import inputs, projects
from app.store.refusal import refuse
from planner.errors import EchoBaseError, fail
from planner.sandbox import run_limited
from planner.setup import Setup

router = APIRouter(prefix="/projects/{project_id}/calibrations", tags=["inputs"])
Kind = Literal["tilt", "couplant", "tcp"]
Target = Literal["plane", "sphere"]
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
    files("One file or more, taken together; tcp: one scan, of one file or two."),
    {"target": choice("plane", "sphere", example="plane"), "radius_mm": {"type": "number", "example": 20.0}},
)


class CalibratedValue(BaseModel):
    """One value; null where a number is not known."""

    value: float | None
    sigma: float | None
    half_95: float | None
    """Half width of its 95 % interval."""
    unit: str
    status: Literal["measured", "weak", "held"]


class CalibrationInput(BaseModel):
    """One file as it came."""

    name: str
    sha256: str


class CalibrationAnswer(BaseModel):
    """What `echobase calibrate --json` prints, and its drawing and report."""

    ok: bool
    """At least one value is not held."""
    kind: Kind
    estimates: dict[str, CalibratedValue]
    patch: dict[str, Any] = Field(examples=[{"probe": {"tilt_loss_db_per_deg2": {"b": 2.011, "c": 1.003}}}])
    """Fields of the setup to change; merge it and `PUT setup` with `If-Match`."""
    readings: int
    residual_rms: float
    residual_unit: str
    issues: list[IssueBody]
    inputs: list[CalibrationInput]
    setup_version: int
    """The version of the setup it was computed with; the patch is of that one (its ETag)."""
    figure_svg: str
    report_html: str
    """One page without scripts, drawing inside."""


@router.post("/{kind}", responses=documented(404, 413, 507), openapi_extra=UPLOAD_BODY)
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
) -> CalibrationAnswer:
    """Calibrate tilt loss, couplant or TCP from measurements, with the setup in force; nothing is kept or put in force."""
    with tempfile.TemporaryDirectory(prefix="echobase-calibrate-") as folder:
        try:
            with ctx.store.busy():
                setup, version = await asyncio.to_thread(_setup, ctx, project_id)
                received = await receive(request, ctx.store, ctx.settings.max_scan_bytes, MOST_FILES, "file", name)
                options = {
                    "kind": kind,
                    "setup": setup,
                    "target": _target(received.fields.get("target")) or target or "plane",
                    "radius_mm": _radius(received.fields.get("radius_mm")) or radius_mm,
                    "names": [shown for shown, _ in received.files],
                }
                options["files"] = await asyncio.to_thread(_lay_out, ctx, received, Path(folder))
        finally:
            # No row names what came: it goes, whatever became of the request.
            await asyncio.to_thread(ctx.store.tidy)
        found = await asyncio.to_thread(_in_child, Path(folder), options)
    response.headers["Cache-Control"] = "no-store"
    return CalibrationAnswer(**found, setup_version=version)


def _setup(ctx: Context, project_id: str) -> tuple[dict[str, Any], int]:
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = inputs.current(session, project_id, "setup")
    return Setup.model_validate(row.content).model_dump(mode="json"), row.version


def _lay_out(ctx: Context, received: Received, folder: Path) -> list[str]:
    """Copy the files into a folder; a name only keeps the suffix a reader goes by."""
    files = []
    for place, (shown, blob) in enumerate(received.files, start=1):
        files.append(f"file-{place}{suffix_of(shown)}")
        ctx.store.blobs.copy_to(blob.sha256, folder / files[-1])
    return files


def _in_child(folder: Path, options: dict[str, Any]) -> dict[str, Any]:
    try:
        with _AT_ONCE:
            _, found = run_limited(CHILD, folder, options)
    except EchoBaseError as error:
        issue = error.issues[0]
        if issue.where != folder.name:
            raise
        # It was not a file that could not be read: the calibration as a whole ended without an answer.
        text, remedy = ENDED.get(issue.code, ENDED["reader-crash"])
        code = issue.code.replace("reader", "calibration")
        raise fail(code, text, remedy, " + ".join(options["names"])) from error
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
