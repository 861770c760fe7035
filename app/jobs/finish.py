"""Closes a job: what it made becomes rows, in the transaction that says it is done."""

from typing import Any

from sqlalchemy.orm import Session

from app.jobs import finish_together
from app.jobs.payload import Outcome
from app.store import inputs, jobs, results, scans
from app.store.blobs import Blob
from app.store.refusal import Refusal
from app.store.store import Store
from app.store.tables import JobRow
from planner.issues import Issue, Severity

WHAT = {"plan": "plan", "simulate": "scan", "alignment": "alignment", "assessment": "assessment"}


def finish(store: Store, job_id: str, outcome: Outcome) -> list[JobRow]:
    """Close a job with its outcome; returns the closed row, or nothing if its project is gone."""
    try:
        with store.db.write() as session:
            row = jobs.get_job(session, job_id)
            if outcome.cancelled:
                jobs.close_job(row, "cancelled")
            elif outcome.failed:
                jobs.close_job(row, "failed", None, outcome.issues)
            else:
                jobs.close_job(row, "done", _rows(session, row, outcome), _issues(outcome.data.get("summary")))
    except Refusal as refusal:
        if refusal.status == 404:
            return []
        raise
    if row.state == "done" and row.kind in WHAT:
        store.tell(row.project_id, WHAT[row.kind], **(row.result or {}))
        for other in (row.result or {}).get("together", []):
            store.tell(other["project"], WHAT[row.kind], number=other["number"], verdict=other["verdict"])
        if row.result and row.result.get("keypoints_set"):
            store.tell(row.project_id, "keypoints")
    return [row]


def _rows(session: Session, row: JobRow, outcome: Outcome) -> dict[str, Any]:
    spec, pid = row.spec, row.project_id
    files = {name: Blob(sha256, size) for name, (sha256, size) in outcome.files.items()}
    data = outcome.data
    if row.kind == "suggest":
        return {"keypoints": data["keypoints"]}
    if row.kind == "simulate":
        options = spec["options"]
        name = f"simulated-{options['path']}.csv"
        scan = scans.add(
            session, pid, {name: files["scan.csv"]}, "simulated", None, options["path"], {"options": options}
        )
        return {"number": scan.number}
    if spec["options"].get("together"):
        return finish_together.rows(session, row, files, data)
    made_from = dict(spec["inputs"])
    extra: dict[str, Any] = {}
    if row.kind == "plan":
        extra = _adopt_keypoints(session, pid, made_from, data["keypoints"])
    summary = data["summary"]
    verdict = str(summary.get("verdict", "pass"))
    result = results.add(session, pid, row.kind, files, made_from, spec["options"], verdict, _small(row.kind, summary))
    return {"number": result.number, "verdict": verdict, **extra}


def _adopt_keypoints(session: Session, pid: str, made_from: dict[str, Any], points: list[Any]) -> dict[str, Any]:
    """Put the key points that a plan chose itself in force, unless somebody picked some meanwhile; the plan is then of them."""
    before = inputs.current(session, pid, "keypoints")
    if before.content or before.sha256 != made_from["keypoints"]:
        return {}
    after, changed = inputs.put_in(session, pid, "keypoints", points, None, "plan")
    made_from["keypoints"] = after.sha256
    return {"keypoints_set": changed}


def _small(kind: str, summary: dict[str, Any]) -> dict[str, Any]:
    """Return what of a result is kept in its row: everything for the small ones, the head of a plan."""
    if kind != "plan":
        return summary
    return {key: value for key, value in summary.items() if len(str(value)) < 20_000}


def _issues(summary: Any) -> tuple[Issue, ...]:
    found = summary.get("issues", []) if isinstance(summary, dict) else []
    return tuple(_issue(item) for item in found if isinstance(item, dict))


def _issue(item: dict[str, Any]) -> Issue:
    severity: Severity = item["severity"] if item.get("severity") in ("error", "warning", "info") else "warning"
    texts = (str(item.get(key) or "") for key in ("code", "message", "remedy", "where"))
    return Issue(severity, *texts)
