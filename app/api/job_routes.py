"""Routes of jobs: state, progress as server-sent events, cancellation."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import StreamingResponse

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented
from app.api.job_answers import job_answer
from app.api.models import Job
from app.api.sse import STREAM_DOCS, stream
from app.store import jobs, projects

router = APIRouter(tags=["jobs"])


@router.get("/jobs/{job_id}", responses=documented(404))
def get_job(ctx: Ctx, job_id: str) -> Job:
    """Return a job."""
    return _job(ctx, job_id)


@router.delete("/jobs/{job_id}", responses=documented(404))
def cancel_job(ctx: Ctx, job_id: str) -> Job:
    """Cancel a job. One that is over stays as it is; one that does not stop is ended after a moment."""
    return job_answer(ctx.runner, ctx.runner.cancel(job_id))


@router.post("/jobs/{job_id}/cancel", responses=documented(404))
def cancel_job_by_post(ctx: Ctx, job_id: str) -> Job:
    """Cancel a job, for clients without DELETE."""
    return job_answer(ctx.runner, ctx.runner.cancel(job_id))


@router.get("/projects/{project_id}/jobs", responses=documented(404))
def list_jobs(ctx: Ctx, project_id: ProjectId, limit: Annotated[int, Query(ge=1, le=500)] = 50) -> list[Job]:
    """Return the last jobs of a project, newest first."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        return [job_answer(ctx.runner, row) for row in jobs.jobs_of(session, project_id, limit)]


@router.get("/jobs/{job_id}/events", responses=documented(404) | STREAM_DOCS, response_class=StreamingResponse)
def job_events(ctx: Ctx, job_id: str, request: Request) -> StreamingResponse:
    """Follow a job: an event `job` with its state now and at every change, until it is over."""
    _job(ctx, job_id)
    return stream(
        ctx.store.exchange,
        f"job:{job_id}",
        request,
        first=lambda: ("job", _job(ctx, job_id).model_dump(mode="json")),
        is_last=lambda event: event.get("state") not in jobs.OPEN,
    )


@router.get("/projects/{project_id}/events", responses=documented(404) | STREAM_DOCS, response_class=StreamingResponse)
def project_events(ctx: Ctx, project_id: ProjectId, request: Request) -> StreamingResponse:
    """Follow a project: `changed` with what changed, `job` with every step of its jobs, and what the 3D view tells."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
    return stream(ctx.store.exchange, f"project:{project_id}", request, first=lambda: ("changed", {"what": "all"}))


def _job(ctx: Context, job_id: str) -> Job:
    with ctx.store.db.read() as session:
        return job_answer(ctx.runner, jobs.get_job(session, job_id))
