"""What each browser of a project shows: its step, its layers, its tool, its probe. Shared nodes, private visibility."""

import threading
from dataclasses import dataclass, field

import viser

from app.view.layers import LAYERS, layers_of
from app.view.loopback import place_for, show_for
from planner.frames import Array
from planner.toolpath import PathKind


@dataclass
class Browser:
    """One connected 3D view."""

    client: viser.ClientHandle
    step: str = "part"
    shown: set[str] = field(default_factory=lambda: set(layers_of("part")))
    pick: str = "none"
    brush_mm: float = 20.0
    """Radius of what a click paints, erases or keeps out."""
    may_cross: bool = True
    probe: tuple[PathKind, float] = ("alignment", 0.0)
    probe_pose: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    moved: bool = False
    """True once somebody chose a camera or the first picture was framed."""
    framed: tuple[str, Array, tuple[int, int]] | None = None
    """Standard view last framed: its name, the camera's place (m), the size of the picture (px)."""

    def apply(self) -> None:
        """Send which layers this browser shows."""
        with self.client.atomic():
            for name, layer in LAYERS.items():
                show_for(self.client, layer.node, name in self.shown)
            if self.probe_pose is not None:
                place_for(self.client, f"{LAYERS['probe'].node}/tcp", *self.probe_pose)

    def turn_to(self, step: str, found: bool) -> None:
        """Show the layers of a step; `found`: whether an alignment has found the part."""
        self.step = step
        self.shown = set(layers_of(step, found))


class Browsers:
    """The connected views of a project, safe from any thread."""

    def __init__(self) -> None:
        self._all: dict[int, Browser] = {}
        self._lock = threading.Lock()

    def add(self, client: viser.ClientHandle) -> Browser:
        """Register a browser."""
        browser = Browser(client)
        with self._lock:
            self._all[client.client_id] = browser
        return browser

    def drop(self, client_id: int) -> None:
        """Forget a browser."""
        with self._lock:
            self._all.pop(client_id, None)

    def chosen(self, client_id: int | None) -> list[Browser]:
        """Return one browser, or all of them for None; empty if it is gone."""
        with self._lock:
            if client_id is None:
                return list(self._all.values())
            found = self._all.get(client_id)
            return [found] if found else []

    def __len__(self) -> int:
        with self._lock:
            return len(self._all)
