"""Routes that start slow work. Each answers 202 with the job and its address."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Query, Response, status

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented
from app.api.etags import IfMatch, expected, tag
from app.api.job_answers import job_answer
from app.api.models import AlignmentRequest, AssessmentRequest, Job, Rehearsal
from app.api.waiting import wait_for
from app.jobs.specs import Spec, align_spec, assess_spec, plan_spec, simulate_spec
from app.jobs.specs_together import together_spec
from app.store import inputs, jobs, projects
from app.store.tables import JobRow
from planner.keypoint import KeyPoint, KeyPointList

router = APIRouter(prefix="/projects/{project_id}", tags=["work"])
ACCEPTED = status.HTTP_202_ACCEPTED


@router.post("/plan", status_code=ACCEPTED, responses=documented(404, 409))
def plan(ctx: Ctx, project_id: ProjectId, response: Response) -> Job:
    """Plan both paths and write both programs from what is in force; key points are chosen if none are given."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        spec = plan_spec(session, project_id)
    row = _submit(ctx, project_id, "plan", spec, response)
    ctx.runner.supersede(project_id, "plan", row.id)
    return job_answer(ctx.runner, row)


@router.post("/simulate", status_code=ACCEPTED, responses=documented(404, 409))
def simulate(
    ctx: Ctx,
    project_id: ProjectId,
    response: Response,
    body: Annotated[Rehearsal, Body()] = Rehearsal(),  # noqa: B008
) -> Job:
    """Run an exported program on the simulated scanner; the scan is added to the project."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        spec = simulate_spec(session, project_id, body.model_dump(mode="json"))
    return job_answer(ctx.runner, _submit(ctx, project_id, "simulate", spec, response))


@router.post("/alignments", status_code=ACCEPTED, responses=documented(404, 409))
def align(
    ctx: Ctx,
    project_id: ProjectId,
    response: Response,
    body: Annotated[AlignmentRequest, Body()] = AlignmentRequest(),  # noqa: B008
) -> Job:
    """Find the part from scans and write the corrected program; with scans of other projects of the part, all of theirs."""
    options = body.model_dump(mode="json", exclude={"scans", "together"})
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        if body.together:
            wanted = [(project_id, body.scans), *((other.project, other.scans) for other in body.together)]
            spec = together_spec(session, wanted, options)
        else:
            spec = align_spec(session, project_id, body.scans, options)
    return job_answer(ctx.runner, _submit(ctx, project_id, "alignment", spec, response))


@router.post("/assessments", status_code=ACCEPTED, responses=documented(404, 409))
def assess(
    ctx: Ctx,
    project_id: ProjectId,
    response: Response,
    body: Annotated[AssessmentRequest, Body()] = AssessmentRequest(),  # noqa: B008
) -> Job:
    """Judge an inspection scan (in one file or more) against the plan, and against the one from before."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        numbers, before = body.numbers(), body.before_numbers()
        spec = assess_spec(session, project_id, numbers, before, body.base, body.before_base)
    return job_answer(ctx.runner, _submit(ctx, project_id, "assessment", spec, response))


@router.post("/keypoints/suggest", responses=documented(404, 409, 412))
def suggest(
    ctx: Ctx,
    project_id: ProjectId,
    response: Response,
    keep: Annotated[bool, Query(description="Put the suggestion in force; false: only return it.")] = True,
    if_match: IfMatch = None,
) -> list[KeyPoint]:
    """Suggest key points whose alignment scan covers what the setup asks for, and put them in force.

    Earlier key points stay readable (`GET keypoints?version=n`).
    """
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        before = inputs.current(session, project_id, "keypoints")
        projects.check_version("keypoints", before.version, expected(if_match))
        spec = plan_spec(session, project_id)
    # What is suggested does not depend on what was picked: the same question is asked once.
    spec["options"]["keypoints"] = []
    spec["inputs"].pop("keypoints")
    row = wait_for(ctx, ctx.runner.submit(project_id, "suggest", spec))
    points = (row.result or {})["keypoints"]
    if keep:
        # What somebody picked while this was computed is not overwritten.
        after = inputs.put(ctx.store, project_id, "keypoints", points, before.version, "suggestion")
        tag(response, after.version)
    return KeyPointList.validate_python(points)


def _submit(ctx: Context, project_id: str, kind: str, spec: Spec, response: Response) -> JobRow:
    row = _done(ctx, project_id, kind, spec) or ctx.runner.submit(project_id, kind, spec)
    response.headers["Location"] = f"/api/v1/jobs/{row.id}"
    return row


def _done(ctx: Context, project_id: str, kind: str, spec: dict[str, Any]) -> JobRow | None:
    """Return the job that already made exactly this, if what it made is still the newest of its kind."""
    from app.store import results, scans  # noqa: PLC0415

    with ctx.store.db.read() as session:
        row = jobs.done_before(session, project_id, kind, spec)
        number = (row.result or {}).get("number") if row else None
        if row is None or number is None:
            return None
        if kind == "simulate":
            return row if any(s.number == number for s in scans.all_scans(session, project_id)[-1:]) else None
        made = {project_id: number} | {o["project"]: o["number"] for o in (row.result or {}).get("together", [])}
        newest = {pid: results.latest(session, pid, kind) for pid in made}
        return row if all(n is not None and n.number == made[pid] for pid, n in newest.items()) else None
