"""Routes of a batch: what the parts of a project's alignments have in common. Computed when asked for, kept nowhere."""

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from sqlalchemy.orm import Session

from app.api.context import Context, Ctx, ProjectId
from app.api.downloads import disposition
from app.api.errors import documented
from app.api.report_routes import ANSWERS, MEDIA
from app.security import CSP_DOCUMENT
from app.store import projects, results, scans
from app.store.content import get_bytes
from app.store.inputs import current, files_of
from app.store.refusal import refuse
from app.store.results import CORRECTION
from app.store.tables import ResultRow

if TYPE_CHECKING:
    from app.steps.batch import BatchItem, BatchResult

router = APIRouter(prefix="/projects/{project_id}", tags=["results"])
FIELD = "correction/field.npz"
MOST = 200
Chosen = Annotated[
    list[Annotated[int, Query(ge=1)]],
    Query(
        max_length=MOST,
        description="Numbers of the alignments, one a part; none: the newest usable one of each scan.",
        examples=[[1, 2, 3]],
    ),
]


@router.get("/batch", responses=documented(404, 409, 422))
def get_batch(ctx: Ctx, project_id: ProjectId, alignments: Chosen = []) -> dict[str, Any]:  # noqa: B006 - read only
    """Return what serial parts have in common and what is each part's own (`batch.json`), and which alignments it is of.

    `patch` holds fields of the setup; it is of `setup_version` (merge it, `PUT setup` with `If-Match`), which is null where the
    setup in force is no longer that of the plan: plan and align again first.
    """
    numbers, result = _batch(ctx, project_id, alignments)
    return {**result.content, "alignments": numbers, "setup_version": _setup_version(ctx, project_id)}


@router.get("/batch/report", responses=documented(404, 409, 422) | ANSWERS, response_class=Response)
def get_batch_report(
    ctx: Ctx,
    project_id: ProjectId,
    alignments: Chosen = [],  # noqa: B006 - read only
    format: Annotated[
        Literal["html", "pdf", "json", "csv"], Query(description="HTML is one file without scripts.")
    ] = "html",
    download: Annotated[bool, Query(description="As an attachment.")] = False,
) -> Response:
    """Return the same as a report."""
    _, result = _batch(ctx, project_id, alignments)
    with ctx.store.db.read() as session:
        name = f"{projects.get(session, project_id).name} batch.{format}"
    headers = {
        "Content-Disposition": disposition(name, "attachment" if download else "inline"),
        "Cache-Control": "no-store",
    }
    if format == "html":
        headers["Content-Security-Policy"] = CSP_DOCUMENT
    return Response(getattr(result.report, format)(), media_type=MEDIA[format], headers=headers)


def _batch(ctx: Context, project_id: str, numbers: list[int]) -> tuple[list[int], "BatchResult"]:
    from app.plan import load_plan  # noqa: PLC0415 - big, and only here
    from app.steps.batch import judge_batch  # noqa: PLC0415 - as above

    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        plan = results.latest(session, project_id, "plan")
        if plan is None:
            raise refuse(409, "plan-missing", "nothing is planned yet.", "Plan first.", "plan")
        rows = [results.get_result(session, project_id, "alignment", n) for n in dict.fromkeys(numbers)]
        rows = rows or usual(results.all_results(session, project_id, "alignment"), plan)
        items = [_item(ctx, session, row) for row in rows]
        files = files_of(session, project_id, f"plan:{plan.number}")
    with tempfile.TemporaryDirectory(prefix="echobase-batch-") as name:
        for file in ("plan.json", "plan.npz"):
            ctx.store.blobs.copy_to(files[file].sha256, Path(name) / file)
        loaded = load_plan(Path(name))
    return [row.number for row in rows], judge_batch(loaded, items)


def _setup_version(ctx: Context, project_id: str) -> int | None:
    with ctx.store.db.read() as session:
        plan, setup = results.latest(session, project_id, "plan"), current(session, project_id, "setup")
    return setup.version if plan is not None and plan.inputs.get("setup") == setup.sha256 else None


def usual(rows: list[ResultRow], plan: ResultRow) -> list[ResultRow]:
    """Return the newest alignment of each set of scans that belongs to the plan, did not fail and knows its directions."""
    newest: dict[str, ResultRow] = {}
    for row in rows:
        if (
            row.verdict != "fail"
            and row.inputs["plan"] == plan.sha256
            and len(row.summary.get("directions") or []) == 6
        ):
            newest[json.dumps(row.inputs["scans"])] = row
    return sorted(newest.values(), key=lambda row: row.number)


def _item(ctx: Context, session: Session, row: ResultRow) -> "BatchItem":
    from app.steps.batch import BatchItem  # noqa: PLC0415 - as above

    files = files_of(session, row.project_id, f"alignment:{row.number}")
    text = get_bytes(ctx.store.blobs, files[CORRECTION].sha256)
    field = get_bytes(ctx.store.blobs, files[FIELD].sha256) if FIELD in files else None
    known = {scan.number: scan for scan in scans.all_scans(session, row.project_id)}
    taken = [known[n] for n in row.options.get("scans", []) if n in known]
    of = ", ".join(file for scan in taken for file in sorted(files_of(session, row.project_id, f"scan:{scan.number}")))
    name = f"{row.number}" + (f": {of}" if of else "")
    simulated = any(scan.origin == "simulated" for scan in taken)
    return BatchItem(name, json.loads(text), files[CORRECTION].sha256, field, simulated)
