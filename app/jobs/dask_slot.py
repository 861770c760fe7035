"""A slot on a Dask cluster: the same payload, run where the cluster has room. Needs the package `distributed` on both sides."""

import importlib
from concurrent.futures import Future
from typing import Any

from app.jobs.execute import execute
from app.jobs.payload import Cancelled, Outcome, Payload, Report
from app.store.refusal import refuse


def connect(address: str) -> Any:
    """Return a client of the scheduler; raises Refusal if the package or the scheduler is not there."""
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise refuse(
            503, "dask-missing", "ECHOBASE_SCHEDULER is set, but the package 'distributed' is not installed.",
            "Install it, or unset the variable.", "ECHOBASE_SCHEDULER",
        ) from error  # fmt: skip
    try:
        return distributed.Client(address, timeout="10s", set_as_default=False)
    except OSError as error:
        raise refuse(
            503,
            "dask-unreachable",
            f"no Dask scheduler answers at {address}.",
            "Start it, or unset the variable.",
            "ECHOBASE_SCHEDULER",
        ) from error


class DaskSlot:
    """One job at a time on the cluster; reports travel as topics, the wish to stop as an event."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._distributed = importlib.import_module("distributed")
        self._future: Any = None
        self._topic = ""
        self._report = Report()

    def submit(self, payload: Payload) -> "Future[Outcome]":
        """Send the work to the cluster."""
        self._end_topic()
        self._topic, self._report = f"echobase-{payload.job_id}", Report()
        self._client.subscribe_topic(self._topic, self._hear)
        self._distributed.Event(self._topic, client=self._client).clear()
        # A payload that ran before must run again when asked: never the cluster's cached answer.
        self._future = self._client.submit(run_on_worker, payload, self._topic, pure=False, retries=0)
        answer: Future[Outcome] = Future()
        answer.set_running_or_notify_cancel()
        self._future.add_done_callback(lambda done: _settle(done, answer))
        return answer

    def warm(self) -> None:
        """The cluster keeps itself warm."""

    def _hear(self, event: tuple[Any, Any]) -> None:
        message = event[1]
        self._report = Report(float(message["fraction"]), str(message["text"]))

    def report(self) -> Report:
        """Return the last report."""
        return self._report

    def ask_to_stop(self) -> None:
        """Set the event that the next report meets."""
        self._distributed.Event(self._topic, client=self._client).set()

    def kill(self) -> None:
        """Take the work from the cluster; a worker that is in the middle of it ends at its next report."""
        if self._future is not None:
            self.ask_to_stop()
            self._future.cancel(force=True)
            self._future = None

    def close(self) -> None:
        """Stop listening."""
        self.kill()
        self._end_topic()

    def _end_topic(self) -> None:
        if self._topic:
            self._client.unsubscribe_topic(self._topic)
            self._topic = ""


def run_on_worker(payload: Payload, topic: str) -> Outcome:
    """Run a payload inside a Dask worker."""
    distributed = importlib.import_module("distributed")
    worker, stop = distributed.get_worker(), distributed.Event(topic)

    def progress(fraction: float, text: str) -> None:
        if stop.is_set():
            raise Cancelled
        worker.log_event(topic, {"fraction": min(max(float(fraction), 0.0), 1.0), "text": str(text)[:200]})

    return execute(payload, progress)


def _settle(done: Any, answer: "Future[Outcome]") -> None:
    if done.cancelled():
        answer.set_result(Outcome(cancelled=True))
    elif (error := done.exception()) is not None:
        answer.set_exception(error)
    else:
        answer.set_result(done.result())
