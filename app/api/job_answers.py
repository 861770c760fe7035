"""A job as the API shows it."""

from app.api.errors import error_body
from app.api.models import Job
from app.jobs.runner import JobRunner
from app.store.tables import JobRow
from planner.issues import Issue


def job_answer(runner: JobRunner, row: JobRow) -> Job:
    """Return a job with its progress and, if it failed, the error it would have answered."""
    report = runner.report(row)
    error = None
    if row.state == "failed":
        error = error_body([Issue(**issue) for issue in row.issues])["error"]
    shown = {
        key: getattr(row, key)
        for key in ("id", "project_id", "kind", "state", "result", "issues", "created", "changed")
    }
    return Job(**shown, fraction=report.fraction, text=report.text, error=error)
