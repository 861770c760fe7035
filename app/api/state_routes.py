"""Where a project stands: every step with its state, the number that matters, its issues, and what to do next."""

from typing import Any, Literal

from fastapi import APIRouter
from pydantic import BaseModel
from sqlalchemy.orm import Session

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented, error_body
from app.api.job_answers import job_answer
from app.api.models import Job
from app.store import inputs, jobs, projects, results, scans
from app.store.freshness import changed_since, in_words
from app.store.handout import why_not
from app.store.tables import ResultRow

router = APIRouter(prefix="/projects/{project_id}", tags=["projects"])
StepState = Literal["empty", "ready", "running", "done", "stale", "failed", "attention"]
KIND_OF_STEP = {"paths": "plan", "scan": "simulate", "alignment": "alignment", "report": "assessment"}


class Step(BaseModel):
    """One step of the job. `ready`: it can be done now; `empty`: something before it is missing."""

    name: str
    state: StepState
    value: dict[str, Any] = {}
    text: str
    next: str
    issues: list[dict[str, Any]] = []
    job: Job | None = None


class ProjectState(BaseModel):
    """All steps, in order, and the versions of the inputs."""

    steps: list[Step]
    versions: dict[str, int]
    programs: dict[str, Any]


@router.get("/state", responses=documented(404))
def get_state(ctx: Ctx, project_id: ProjectId) -> ProjectState:
    """Return where the project stands."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        given = {kind: inputs.current(session, project_id, kind) for kind in ("part", "setup", "surface", "keypoints")}
        steps = [*_input_steps(given), *_made_steps(session, project_id, bool(given["part"].is_given))]
        for step in steps:
            _with_job(ctx, session, project_id, step)
        programs: dict[str, Any] = {}
        for which in ("alignment", "inspection", "corrected"):
            refusal = why_not(session, project_id, which)
            programs[which] = (
                {"available": True} if refusal is None else {"available": False, **error_body(refusal.issues)}
            )
    return ProjectState(steps=steps, versions={kind: row.version for kind, row in given.items()}, programs=programs)


def _input_steps(given: dict[str, inputs.Input]) -> list[Step]:
    part, setup, surface, points = (given[kind] for kind in ("part", "setup", "surface", "keypoints"))
    has_part = part.is_given
    steps = [
        Step(
            name="part",
            state="done",
            value={"extents_mm": part.content["extents_mm"]},
            text=part.content["name"],
            next="",
        )
        if has_part
        else Step(
            name="part", state="ready", text="no part yet", next="Upload the CAD of the part, or open the sample."
        )
    ]
    robot = setup.content["robot"]
    cell = "as set" if setup.is_given else "the paper's cell"
    steps.append(Step(name="cell", state="done", value={"robot": robot}, text=cell, next=""))
    seeds = len(surface.content["seeds"])
    chosen = "picked" if seeds else "the largest one"
    steps.append(
        Step(name="surface", state="done" if has_part else "empty", value={"seeds": seeds}, text=chosen, next="")
    )
    count = len(points.content)
    text, todo = (
        (f"{count} key points", "") if count else ("none yet", "Pick key points, let them be suggested, or just plan.")
    )
    state: StepState = "empty" if not has_part else "done" if count else "ready"
    steps.append(Step(name="keypoints", state=state, value={"count": count}, text=text, next=todo))
    return steps


def _made_steps(session: Session, pid: str, has_part: bool) -> list[Step]:
    plan = results.latest(session, pid, "plan")
    paths = _made(session, plan, "paths", "ready" if has_part else "empty", "Plan the paths.", "Plan again.")
    refusals = [why_not(session, pid, which) for which in ("alignment", "inspection")]
    had = sum(refusal is None for refusal in refusals)
    programs = Step(
        name="programs", state="done" if had == 2 else "attention" if had else paths.state if plan else "empty",
        value={"available": had}, text=f"{had} of 2 can be downloaded",
        next="Run the alignment scan on the robot." if had else "",
    )  # fmt: skip
    taken = scans.all_scans(session, pid)
    fresh_plan = plan is not None and not changed_since(session, plan)
    scan = Step(
        name="scan", state="done" if taken else "ready" if fresh_plan else "empty", value={"count": len(taken)},
        text=f"{len(taken)} scans" if taken else "none yet", next="" if taken else "Upload the scan, or rehearse.",
    )  # fmt: skip
    newest = results.latest(session, pid, "alignment")
    todo = "ready" if taken and fresh_plan else "empty"
    alignment = _made(session, newest, "alignment", todo, "Align.", "Plan and align again.")
    if newest is not None and alignment.state == "done" and newest.verdict == "partial" and newest.accepted is None:
        alignment.state, alignment.next = "attention", "Read the reasons, then accept it with your name and why."
    judged = results.latest(session, pid, "assessment")
    can_report = "ready" if newest is not None and alignment.state in ("done", "attention") else "empty"
    report = _made(session, judged, "report", can_report, "Upload the inspection scan and assess it.", "Assess again.")
    return [paths, programs, scan, alignment, report]


def _made(session: Session, row: ResultRow | None, name: str, missing: Any, todo: str, again: str) -> Step:
    if row is None:
        return Step(name=name, state=missing, text="not made yet", next=todo if missing == "ready" else "")
    value = {"number": row.number, "verdict": row.verdict}
    issues = row.summary.get("issues", [])
    changed = changed_since(session, row)
    if changed:
        text = f"stale: {in_words(changed)} changed"
        return Step(
            name=name, state="stale", value={**value, "stale_because": changed}, text=text, next=again, issues=issues
        )
    if row.verdict == "fail":
        return Step(name=name, state="failed", value=value, text="failed", next="See the issues.", issues=issues)
    return Step(name=name, state="done", value=value, text=row.verdict, next="", issues=issues)


def _with_job(ctx: Context, session: Session, pid: str, step: Step) -> None:
    """Add the job that is making the step, or that failed to make it since."""
    if step.name not in KIND_OF_STEP:
        return
    job = jobs.last_job(session, pid, KIND_OF_STEP[step.name])
    if job is None:
        return
    if job.state in jobs.OPEN:
        step.state, step.job = "running", job_answer(ctx.runner, job)
    elif job.state == "failed":
        step.job = job_answer(ctx.runner, job)
        step.state, step.text, step.next = "failed", "the last attempt failed", "See the issues."
        step.issues = [*job.issues, *step.issues]
