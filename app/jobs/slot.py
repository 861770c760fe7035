"""A slot runs one job at a time in a worker process of its own, so that ending one job never touches another."""

import contextlib
import json
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing.connection import wait
from pathlib import Path
from typing import Protocol

from app.jobs.execute import execute
from app.jobs.payload import Cancelled, Outcome, Payload, Report
from app.scratch import clear

POSIX = os.name == "posix"
CONTEXT = multiprocessing.get_context("forkserver" if POSIX else "spawn")
if POSIX:
    CONTEXT.set_forkserver_preload(["app.jobs.slot", "scipy.spatial", "trimesh", "planner.setup"])


class Slot(Protocol):
    """Where a job runs."""

    def submit(self, payload: Payload) -> "Future[Outcome]":
        """Start the work."""

    def warm(self) -> None:
        """Get ready while nobody waits."""

    def report(self) -> Report:
        """Return how far it is."""

    def ask_to_stop(self) -> None:
        """Ask the running work to stop at its next report."""

    def kill(self) -> None:
        """End the work at once; the slot can be used again."""

    def close(self) -> None:
        """Give everything free."""


class ProcessSlot:
    """A slot on this machine: one process, kept warm between jobs; progress and the wish to stop are two files."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="echobase-slot-"))
        self._work = self._folder / "work"
        self._pool: ProcessPoolExecutor | None = None

    def warm(self) -> None:
        """Have the process ready: it imports for some seconds, better now than when somebody waits for it."""
        if self._pool is None:
            self._ready().submit(os.getpid)

    def _ready(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, CONTEXT, begin_worker, (str(self._work),))
        return self._pool

    def submit(self, payload: Payload) -> "Future[Outcome]":
        """Start the work in the process; a new one if the last was ended."""
        for name in ("report", "stop"):
            (self._folder / name).unlink(missing_ok=True)
        return self._ready().submit(_run, payload, str(self._folder))

    def report(self) -> Report:
        """Return the last report."""
        try:
            return Report(**json.loads((self._folder / "report").read_text(encoding="utf-8")))
        except (OSError, ValueError):
            return Report()

    def ask_to_stop(self) -> None:
        """Leave the sign that the next report meets."""
        (self._folder / "stop").touch()

    def kill(self) -> None:
        """End the process and what it started."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        for process in list((pool._processes or {}).values()):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if POSIX and process.pid and os.getpgid(process.pid) == process.pid:
                    os.killpg(process.pid, signal.SIGKILL)
                else:
                    process.kill()
        pool.shutdown(wait=True, cancel_futures=True)
        clear(self._work)

    def close(self) -> None:
        """End the process and remove its files."""
        self.kill()
        shutil.rmtree(self._folder, ignore_errors=True)


def begin_worker(work: str | None = None) -> None:
    """Prepare a new worker: a process group of its own, and an end when the server ends, however that happens.

    What it makes in passing goes into the folder `work`, if one is named: whoever kills it can then clear that.
    """
    if work is not None:
        Path(work).mkdir(parents=True, exist_ok=True)
        os.environ["TMPDIR"], tempfile.tempdir = work, None
    if POSIX:
        os.setsid()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True, name="echobase-watch").start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    wait([parent.sentinel])
    if POSIX:
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


def _run(payload: Payload, folder_name: str) -> Outcome:
    folder = Path(folder_name)

    def progress(fraction: float, text: str) -> None:
        if (folder / "stop").exists():
            raise Cancelled
        new = folder / "report.new"
        new.write_text(
            json.dumps({"fraction": min(max(float(fraction), 0.0), 1.0), "text": str(text)[:200]}), encoding="utf-8"
        )
        os.replace(new, folder / "report")

    return execute(payload, progress)
