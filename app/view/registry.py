"""`ViewRegistry`: the 3D views of the projects that are open, made when first looked at."""

import secrets
import threading
from collections.abc import Callable

from app.view.model import ProjectModel
from app.view.project_view import ProjectView


class ViewRegistry:
    """Lazy and thread-safe: one view per project; beyond `keep`, the longest unused view nobody looks at is closed.

    project_loader: project id -> its model; raises EchoBaseError (or KeyError) for a project that does not exist.
    `key` is the secret the proxy must send with every connection (`app.view.loopback.KEY_HEADER`).
    """

    def __init__(self, project_loader: Callable[[str], ProjectModel], keep: int = 6) -> None:
        self.key = secrets.token_urlsafe(32)
        self._load = project_loader
        self._keep = keep
        self._views: dict[str, ProjectView] = {}
        self._locks: dict[str, threading.Lock] = {}
        self._lock = threading.Lock()

    def get(self, project_id: str) -> ProjectView:
        """Return the view of a project, made now if need be. Never call it from an event loop."""
        with self._lock:
            lock = self._locks.setdefault(project_id, threading.Lock())
        with lock:
            view = self._views.get(project_id)
            if view is None:
                try:
                    model = self._load(project_id)
                except Exception:
                    with self._lock:
                        self._locks.pop(project_id, None)
                    raise
                view = ProjectView(model, self.key)
                with self._lock:
                    self._views[project_id] = view
        self._trim(project_id)
        return view

    def peek(self, project_id: str) -> ProjectView | None:
        """Return the view of a project if it is open."""
        with self._lock:
            return self._views.get(project_id)

    def close(self, project_id: str) -> None:
        """Close the view of a project (because it was deleted, say)."""
        with self._lock:
            view = self._views.pop(project_id, None)
            self._locks.pop(project_id, None)
        if view is not None:
            view.close()

    def close_all(self) -> None:
        """Close every view: at shutdown."""
        with self._lock:
            names = list(self._views)
        for name in names:
            self.close(name)

    def _trim(self, just_used: str) -> None:
        with self._lock:
            idle = [(v.last_used, n) for n, v in self._views.items() if not v.connected and n != just_used]
            surplus = len(self._views) - self._keep
        for _, name in sorted(idle)[: max(0, surplus)]:
            self.close(name)
