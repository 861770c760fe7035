"""Server-sent events from the exchange: bounded queues, heartbeats, and a resume that never loses the last word."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

from fastapi import Request
from fastapi.responses import StreamingResponse

from app.store.events import Event, Exchange

HEARTBEAT_S = 15.0
MAX_WAITING = 1024
STREAM_DOCS: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Server-sent events; send `Last-Event-ID` to go on after the last one you got.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}
First = Callable[[], tuple[str, dict[str, Any]]]


def stream(
    exchange: Exchange,
    topic: str,
    request: Request,
    first: First,
    is_last: Callable[[dict[str, Any]], bool] = lambda _: False,
) -> StreamingResponse:
    """Return the events of a topic as a stream.

    It starts with the events after `Last-Event-ID` if they are still known, else with `first()`: the state as it is now.
    """
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    content = _events(exchange, topic, request.headers.get("last-event-id", ""), first, is_last)
    return StreamingResponse(content, media_type="text/event-stream", headers=headers)


async def _events(
    exchange: Exchange, topic: str, last_id: str, first: First, is_last: Callable[[dict[str, Any]], bool]
) -> AsyncIterator[str]:
    loop = asyncio.get_running_loop()
    queue: asyncio.Queue[Event] = asyncio.Queue(MAX_WAITING)

    def put(event: Event) -> None:
        # A reader that does not keep up loses the oldest: each event tells the state, not the difference.
        if queue.full():
            queue.get_nowait()
        queue.put_nowait(event)

    def hear(event: Event) -> None:
        loop.call_soon_threadsafe(put, event)

    stop = exchange.listen(topic, hear)
    sent = int(last_id) if last_id.isascii() and last_id.isdigit() and len(last_id) < 18 else 0
    try:
        yield "retry: 1000\n\n"
        missed = exchange.since(topic, sent) if sent else None
        if missed is None:
            name, data = await asyncio.to_thread(first)
            yield _text(Event(0, topic, name, data))
            if is_last(data):
                return
        for event in missed or ():
            sent = event.number
            yield _text(event)
            if is_last(event.data):
                return
        while not exchange.is_closed:
            try:
                event = await asyncio.wait_for(queue.get(), HEARTBEAT_S)
            except TimeoutError:
                yield ": still here\n\n"
                continue
            if event.name == "closing":
                return
            if event.number > sent:
                sent = event.number
                yield _text(event)
                if is_last(event.data):
                    return
    finally:
        stop()


def _text(event: Event) -> str:
    mark = f"id: {event.number}\n" if event.number else ""
    return f"{mark}event: {event.name}\ndata: {json.dumps(event.data, allow_nan=False)}\n\n"
