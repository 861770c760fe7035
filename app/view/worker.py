"""One thread that does things in order and says what went wrong, so that no viser callback ever waits or fails unseen."""

import logging
import queue
import threading
from collections.abc import Callable, Hashable

from planner.errors import EchoBaseError
from planner.issues import Issue

log = logging.getLogger("echobase.view")


class Worker:
    """Runs tasks one after the other; a task with a key already waiting is not queued twice."""

    def __init__(self, name: str, on_issue: Callable[[Issue], None]) -> None:
        self._queue: queue.SimpleQueue[tuple[Hashable | None, Callable[[], None]] | None] = queue.SimpleQueue()
        self._waiting: set[Hashable] = set()
        self._lock = threading.Lock()
        self._on_issue = on_issue
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, task: Callable[[], None], key: Hashable | None = None) -> None:
        """Queue a task; with a key, at most one task of that key waits."""
        with self._lock:
            if key is not None:
                if key in self._waiting:
                    return
                self._waiting.add(key)
        self._queue.put((key, task))

    def wait(self, timeout_s: float = 60.0) -> bool:
        """Return True once everything queued before this call is done."""
        done = threading.Event()
        self._queue.put((None, done.set))
        return done.wait(timeout_s)

    def stop(self) -> None:
        """End after the task at hand."""
        self._queue.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=10.0)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            key, task = item
            with self._lock:
                self._waiting.discard(key)
            try:
                task()
            except EchoBaseError as error:
                for issue in error.issues:
                    self._on_issue(issue)
            except Exception as error:
                log.exception("the 3D view failed")
                self._on_issue(
                    Issue(
                        "error",
                        "view-failed",
                        f"The 3D view could not be drawn: {type(error).__name__}: {error}.",
                        "Reload the page; the project itself is not affected.",
                        "3D view",
                    )
                )
