"""Waits, in a thread, for a job that is short enough to be asked for directly."""

import threading

from app.api.context import Context
from app.store import jobs
from app.store.events import Event
from app.store.refusal import Refusal, refuse
from app.store.tables import JobRow
from planner.issues import Issue

LONGEST_S = 300.0


def wait_for(ctx: Context, row: JobRow) -> JobRow:
    """Return the job when it is done; raises Refusal with its issues if it failed, 409 if it was cancelled."""
    over = threading.Event()

    def hear(event: Event) -> None:
        if event.name == "closing" or event.data.get("state") not in jobs.OPEN:
            over.set()

    stop = ctx.store.exchange.listen(f"job:{row.id}", hear)
    try:
        with ctx.store.db.read() as session:
            if jobs.get_job(session, row.id).state in jobs.OPEN:
                over.wait(LONGEST_S)
    finally:
        stop()
    with ctx.store.db.read() as session:
        row = jobs.get_job(session, row.id)
    if row.state == "failed":
        raise Refusal(422, *(Issue(**issue) for issue in row.issues))
    if row.state != "done":
        where = f"/api/v1/jobs/{row.id}"
        raise refuse(
            409, "not-finished", f"the work was not finished ({row.state}).", "Ask again, or follow the job.", where
        )
    return row
