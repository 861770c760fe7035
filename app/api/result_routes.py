"""Routes of what was made: plan, programs, alignments and their acceptance, assessments."""

import json
from typing import Any, Literal

from fastapi import APIRouter, Response
from sqlalchemy.orm import Session

from app.api.context import Context, Ctx, Number, ProjectId
from app.api.downloads import attachment, zipped
from app.api.errors import documented, error_body
from app.api.models import Acceptance, AlignmentInfo, PlanInfo
from app.store import projects, results
from app.store.content import get_bytes
from app.store.freshness import changed_since
from app.store.handout import hand_out, why_not
from app.store.inputs import files_of
from app.store.names import safe_member
from app.store.refusal import not_found, refuse
from app.store.tables import ResultRow

router = APIRouter(prefix="/projects/{project_id}", tags=["results"])
Which = Literal["alignment", "inspection", "corrected"]
ZIP: dict[int | str, dict[str, Any]] = {200: {"content": {"application/zip": {}}}}


@router.get("/plan", responses=documented(404))
def get_plan(ctx: Ctx, project_id: ProjectId) -> PlanInfo:
    """Return the newest plan (`plan.json`), and whether its programs can be had."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = results.latest(session, project_id, "plan")
        if row is None:
            raise refuse(404, "plan-missing", "nothing is planned yet.", "Plan first.", "plan")
        content = _json(ctx, session, row, "plan.json")
        programs = {which: _availability(session, project_id, which) for which in ("alignment", "inspection")}
        return PlanInfo.model_validate({**content, **_state(session, row), "programs": programs})


@router.get("/programs/{which}", responses=documented(404, 409) | ZIP, response_class=Response)
def get_program(ctx: Ctx, project_id: ProjectId, which: Which) -> Response:
    """Download a KRL program as ZIP. A stale, failed, unaccepted or unproven one is never handed out."""
    with ctx.store.db.read() as session:
        project = projects.get(session, project_id)
        out = hand_out(session, ctx.store.blobs, project_id, which)
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        projects.note(
            session, project_id, "program-handed-out", which=which, result=out.result.number, sha256=out.result.sha256
        )
    return attachment(zipped(out.files), f"{project.name} {which}.zip", "application/zip")


@router.get("/alignments", responses=documented(404))
def list_alignments(ctx: Ctx, project_id: ProjectId) -> list[AlignmentInfo]:
    """Return all alignments, oldest first."""
    return _listed(ctx, project_id, "alignment")


@router.get("/alignments/{number}", responses=documented(404))
def get_alignment(ctx: Ctx, project_id: ProjectId, number: Number) -> AlignmentInfo:
    """Return an alignment (`correction.json`), and whether its program can be had."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = results.get_result(session, project_id, "alignment", number)
        return _alignment(ctx, session, row)


@router.post("/alignments/{number}/accept", responses=documented(404, 409))
def accept_alignment(ctx: Ctx, project_id: ProjectId, number: Number, body: Acceptance) -> AlignmentInfo:
    """Take an alignment over, with your name and the reason. A failed or stale one cannot be."""
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        row = results.get_result(session, project_id, "alignment", number)
        where = f"alignment {number}"
        if row.verdict == "fail":
            raise refuse(
                409, "alignment-failed", "a failed alignment cannot be accepted.", "Scan and align again.", where
            )
        changed = changed_since(session, row)
        if changed:
            raise refuse(409, "alignment-stale", "the alignment is stale.", "Plan and align again.", where)
        results.accept(session, row, body.name, body.reason)
        answer = _alignment(ctx, session, row)
    ctx.store.tell(project_id, "alignment", number=number)
    return answer


@router.post("/alignments/{number}/use", responses=documented(404, 409))
def use_alignment(ctx: Ctx, project_id: ProjectId, number: Number) -> AlignmentInfo:
    """Put an earlier alignment in force again: it becomes the newest, with the same files, proof and acceptance.

    A failed or stale earlier one cannot be. The newest one stays as it is.
    """
    with ctx.store.db.write() as session:
        projects.get(session, project_id)
        row = results.get_result(session, project_id, "alignment", number)
        newest = results.latest(session, project_id, "alignment")
        if newest is not None and newest.number != number:
            where = f"alignment {number}"
            if row.verdict == "fail":
                raise refuse(
                    409, "alignment-failed", "a failed alignment cannot be used.", "Scan and align again.", where
                )
            if changed_since(session, row):
                raise refuse(409, "alignment-stale", "the alignment is stale.", "Plan and align again.", where)
            row = results.again(session, row)
        answer = _alignment(ctx, session, row)
    ctx.store.tell(project_id, "alignment", number=row.number)
    return answer


@router.get("/assessments", responses=documented(404))
def list_assessments(ctx: Ctx, project_id: ProjectId) -> list[dict[str, Any]]:
    """Return all assessments, oldest first."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        rows = results.all_results(session, project_id, "assessment")
        return [{**row.summary, **_state(session, row)} for row in rows]


@router.get("/assessments/{number}", responses=documented(404))
def get_assessment(ctx: Ctx, project_id: ProjectId, number: Number) -> dict[str, Any]:
    """Return an assessment (`assessment.json`)."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = results.get_result(session, project_id, "assessment", number)
        return {**_json(ctx, session, row, "assessment.json"), **_state(session, row)}


@router.get("/assessments/{number}/charts", responses=documented(404))
def get_charts(ctx: Ctx, project_id: ProjectId, number: Number) -> dict[str, Any]:
    """Return the maps and histograms of an assessment (`charts.json`), after and before on common scales."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return _json(ctx, session, results.get_result(session, project_id, "assessment", number), "charts.json")


def _listed(ctx: Context, project_id: str, kind: str) -> list[AlignmentInfo]:
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return [_alignment(ctx, session, row) for row in results.all_results(session, project_id, kind)]


def _alignment(ctx: Context, session: Session, row: ResultRow) -> AlignmentInfo:
    newest = results.latest(session, row.project_id, "alignment")
    if newest is not None and newest.number != row.number:
        refusal = refuse(409, "alignment-superseded", f"alignment {newest.number} came after it.", "Use that one.")
        program: dict[str, Any] = {"available": False, **error_body(refusal.issues)}
    else:
        program = _availability(session, row.project_id, "corrected")
    content = {**row.summary, **_state(session, row), "accepted": row.accepted, "program": program}
    return AlignmentInfo.model_validate(content)


def _availability(session: Session, project_id: str, which: str) -> dict[str, Any]:
    refusal = why_not(session, project_id, which)
    if refusal is None:
        return {"available": True, "href": f"/api/v1/projects/{project_id}/programs/{which}"}
    return {"available": False, **error_body(refusal.issues)}


def _state(session: Session, row: ResultRow) -> dict[str, Any]:
    changed = changed_since(session, row)
    state = {"number": row.number, "verdict": row.verdict, "stale": bool(changed), "stale_because": changed}
    return {**state, "options": row.options, "created": row.created}


def _json(ctx: Context, session: Session, row: ResultRow, name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(_bytes(ctx, session, row, name))
    return content


def _bytes(ctx: Context, session: Session, row: ResultRow, name: str) -> bytes:
    files = files_of(session, row.project_id, f"{row.kind}:{row.number}")
    if name not in files:
        raise not_found("file", safe_member(name))
    return get_bytes(ctx.store.blobs, files[name].sha256)
