"""`Thinker`: a process of its own for what the page asks while somebody picks: neither picking nor REST waits for it."""

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, TypeVar

from app.jobs.slot import CONTEXT, POSIX, begin_worker
from planner.errors import EchoBaseError, fail
from planner.issues import Issue

T = TypeVar("T")


class Thinker:
    """One warm process; functions sent to it may keep what they built (in their module) for the next question."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._closed = False

    def ask(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return what the function answers in the process; its issues come back as EchoBaseError."""
        with self._lock:
            # A process begun now would outlive the server's will to stop: the interpreter waits for its answers.
            if self._closed:
                raise _closing()
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, CONTEXT, begin_worker)
            pool = self._pool
        try:
            answer, issues = pool.submit(_answer, function, arguments).result()
        except (BrokenProcessPool, CancelledError, RuntimeError) as error:
            with self._lock:
                if self._closed:
                    raise _closing() from error
                if self._pool is pool:
                    self._pool = None
            text = "the process that judges key points ended unexpectedly."
            raise fail("worker-crashed", text, "Try again; use a coarser CAD if it happens again.") from error
        if issues:
            raise EchoBaseError(*issues)
        return answer

    def close(self) -> None:
        """End the process, whatever it is at; nothing is answered any more."""
        with self._lock:
            self._closed = True
            pool, self._pool = self._pool, None
        if pool is None:
            return
        for process in list((pool._processes or {}).values()):
            with suppress(ProcessLookupError, PermissionError):
                if POSIX and process.pid and os.getpgid(process.pid) == process.pid:
                    os.killpg(process.pid, signal.SIGKILL)
                else:
                    process.kill()
        pool.shutdown(wait=False, cancel_futures=True)


def _closing() -> EchoBaseError:
    return fail("server-closing", "the server is being stopped.", "Ask again once it is back.")


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, tuple[Issue, ...]]:
    try:
        return function(*arguments), ()
    except EchoBaseError as error:
        return None, error.issues
