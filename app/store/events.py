"""Who wants to know what changed: a small in-memory exchange between the threads of one server."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

KEPT = 512


@dataclass(frozen=True)
class Event:
    """Something that happened: `number` grows with time, also over restarts; `name` and `data` go to the listeners."""

    number: int
    topic: str
    name: str
    data: dict[str, Any]


class Exchange:
    """Publishes events by topic (`project:<id>`, `job:<id>`); remembers the last few for those who were away."""

    def __init__(self) -> None:
        # Re-entrant: the signal that ends the server may come while its own thread is in here.
        self._lock = threading.RLock()
        self._listeners: dict[int, tuple[str, Callable[[Event], None]]] = {}
        self._next = 0
        self._number = 0
        self._past: dict[str, deque[Event]] = {}
        self._closed = False

    @property
    def is_closed(self) -> bool:
        """True once the server is going down."""
        return self._closed

    def publish(self, topic: str, name: str, data: dict[str, Any]) -> Event:
        """Send an event to the listeners of a topic; callbacks are quick and never raise."""
        with self._lock:
            # Milliseconds since 1970 when idle, one more when busy: numbers of a restarted server continue upwards.
            self._number = max(self._number + 1, time.time_ns() // 1_000_000)
            event = Event(self._number, topic, name, data)
            self._past.setdefault(topic, deque(maxlen=KEPT)).append(event)
            while len(self._past) > KEPT:
                self._past.pop(next(iter(self._past)))
            callbacks = [callback for wanted, callback in self._listeners.values() if wanted == topic]
        for callback in callbacks:
            callback(event)
        return event

    def listen(self, topic: str, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Call back for every event of a topic, from any thread; return the function that ends it."""
        with self._lock:
            self._next += 1
            mine = self._next
            self._listeners[mine] = (topic, callback)

        def stop() -> None:
            with self._lock:
                self._listeners.pop(mine, None)

        return stop

    def since(self, topic: str, number: int) -> list[Event] | None:
        """Return the events after `number`, or None if some may have been forgotten."""
        with self._lock:
            past = list(self._past.get(topic, ()))
        if not past or past[0].number > number:
            return None
        return [event for event in past if event.number > number]

    def close(self) -> None:
        """Tell every listener that the server is going down."""
        self._closed = True
        with self._lock:
            callbacks = [(topic, callback) for topic, callback in self._listeners.values()]
        for topic, callback in callbacks:
            callback(Event(0, topic, "closing", {}))
