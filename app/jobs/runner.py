"""`JobRunner`: takes queued jobs, runs each in a slot, and closes it in one transaction with what it made."""

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any

from app.jobs.finish import finish
from app.jobs.payload import Outcome, Payload, Report
from app.jobs.slot import Slot
from app.store import jobs
from app.store.store import Store
from app.store.tables import JobRow
from planner.issues import Issue

log = logging.getLogger(__name__)
TICK_S = 0.1
IDLE_S = 2.0


@dataclass
class _Running:
    report: Report = field(default_factory=Report)
    cancel_at: float | None = None


class JobRunner:
    """One thread per slot. Jobs are rows: what is queued survives the server."""

    def __init__(self, store: Store, make_slot: Callable[[], Slot]) -> None:
        self.store = store
        self._make_slot = make_slot
        self._wake = threading.Condition()
        self._running: dict[str, _Running] = {}
        self._stopping = False
        self._submitted = 0
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Queue again what a killed server left, and begin."""
        with self.store.db.write() as session:
            jobs.requeue_unfinished(session, self.store.settings.max_attempts)
        for number in range(self.store.settings.workers):
            thread = threading.Thread(target=self._serve, name=f"echobase-slot-{number}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def stop(self) -> None:
        """End the running work; it stays queued for the next start."""
        with self._wake:
            self._stopping = True
            self._wake.notify_all()
        for thread in self._threads:
            thread.join(timeout=10.0)

    def submit(self, project_id: str, kind: str, spec: dict[str, Any]) -> JobRow:
        """Queue work, or return the open job that is doing exactly this."""
        with self.store.db.write() as session:
            row, added = jobs.find_open_or_add(session, project_id, kind, spec)
        if added:
            self._tell(row)
            with self._wake:
                self._submitted += 1
                self._wake.notify_all()
        return row

    def cancel(self, job_id: str) -> JobRow:
        """Cancel a job; one that is over stays as it is."""
        with self._wake:
            running = self._running.get(job_id)
            if running is not None and running.cancel_at is None:
                running.cancel_at = time.monotonic()
        with self.store.db.write() as session:
            row = jobs.get_job(session, job_id)
            if row.state == "queued":
                jobs.close_job(row, "cancelled")
        if row.state == "cancelled":
            self._tell(row)
        return row

    def supersede(self, project_id: str, kind: str, keep: str) -> None:
        """Cancel the open jobs of a kind whose inputs are no longer those in force."""
        with self.store.db.read() as session:
            others = [
                r.id
                for r in jobs.jobs_of(session, project_id)
                if r.kind == kind and r.state in jobs.OPEN and r.id != keep
            ]
        for job_id in others:
            self.cancel(job_id)

    def cancel_project(self, project_id: str) -> None:
        """Cancel everything a project has open."""
        with self.store.db.read() as session:
            mine = [r.id for r in jobs.jobs_of(session, project_id) if r.state in jobs.OPEN]
        for job_id in mine:
            self.cancel(job_id)

    def report(self, row: JobRow) -> Report:
        """Return how far a job is."""
        running = self._running.get(row.id)
        if running is not None and row.state == "running":
            return running.report
        return Report(1.0 if row.state == "done" else 0.0, row.state)

    def counts(self) -> dict[str, int]:
        """Return how many jobs wait and how many run."""
        with self.store.db.read() as session:
            return {state: jobs.count(session, state) for state in jobs.OPEN}

    def _serve(self) -> None:
        slot = self._make_slot()
        try:
            while (row := self._take(slot)) is not None:
                try:
                    self._do(slot, row)
                except Exception:
                    # The database or the disk failed while a job was closed: leave the row, keep the slot alive.
                    log.exception("job %s could not be closed", row.id)
                finally:
                    self._running.pop(row.id, None)
                    self.store.release()
        finally:
            slot.close()

    def _take(self, slot: Slot) -> JobRow | None:
        """Wait for a queued job; None when the server stops."""
        while True:
            with self._wake:
                if self._stopping:
                    return None
                seen = self._submitted
            self.store.hold()
            with self.store.db.write() as session:
                row = jobs.take_next(session)
                if row is not None:
                    self._running[row.id] = _Running()
            if row is not None:
                self._tell(row)
                return row
            self.store.release()
            with self._wake:
                # What was submitted since the look at the table has already called.
                woken = self._stopping or self._submitted != seen or self._wake.wait(timeout=IDLE_S)
            if not woken:
                slot.warm()

    def _do(self, slot: Slot, row: JobRow) -> None:
        settings = self.store.settings
        spec = row.spec
        payload = Payload(row.id, row.kind, spec["files"], spec["options"], settings.store_url(), settings.workflow)
        outcome = self._watch(slot, row, slot.submit(payload))
        if outcome is None:  # the server stops: the job stays for the next start
            with self.store.db.write() as session:
                again = jobs.get_job(session, row.id)
                again.state, again.attempts = "queued", again.attempts - 1
            return
        for closed in finish(self.store, row.id, outcome):
            self._tell(closed)

    def _watch(self, slot: Slot, row: JobRow, future: "Future[Outcome]") -> Outcome | None:
        running = self._running[row.id]
        asked = False
        while True:
            done = wait([future], timeout=TICK_S).done
            if done:
                break
            report = slot.report()
            if report != running.report:
                running.report = report
                self._tell(row)
            if self._stopping:
                slot.kill()
                return None
            if running.cancel_at is not None:
                if not asked:
                    slot.ask_to_stop()
                    asked = True
                if time.monotonic() - running.cancel_at > self.store.settings.cancel_grace_s:
                    slot.kill()
                    return Outcome(cancelled=True)
        try:
            outcome = future.result()
        except BrokenProcessPool:
            slot.kill()
            text = "the worker process ended unexpectedly, most likely for want of memory."
            issue = Issue(
                "error", "worker-crashed", text, "Use a coarser CAD or a smaller scan, or give the machine more memory."
            )
            outcome = Outcome(issues=(issue,), failed=True)
        except Exception as error:
            log.exception("job %s: the worker did not answer", row.id)
            issue = Issue(
                "error", "worker-lost", f"the worker did not answer ({type(error).__name__}).", "Start the work again."
            )
            outcome = Outcome(issues=(issue,), failed=True)
        return Outcome(cancelled=True) if running.cancel_at is not None else outcome

    def _tell(self, row: JobRow) -> None:
        data = {"id": row.id, "kind": row.kind, "state": row.state, **vars(self.report(row))}
        self.store.exchange.publish(f"job:{row.id}", "job", data)
        self.store.exchange.publish(f"project:{row.project_id}", "job", data)
