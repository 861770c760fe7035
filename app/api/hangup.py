"""Work that ends when nobody waits for its answer any more."""

import asyncio
import threading
from collections.abc import Callable
from typing import TypeVar

from fastapi import Request

T = TypeVar("T")


async def while_awaited(request: Request, work: Callable[[threading.Event], T]) -> T:
    """Return what `work(stop)` answers in a thread; `stop` is set when the client hangs up or the server ends.

    The body of the request must have been read: what its stream says next is that the client is gone. Work that is asked
    to stop raises; its answer has nobody to go to.
    """
    stop = threading.Event()
    working = asyncio.ensure_future(asyncio.to_thread(work, stop))
    gone = asyncio.ensure_future(_hung_up(request))
    try:
        await asyncio.wait({working, gone}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        stop.set()
        gone.cancel()
        # What it uses is given free by the caller: it must have ended.
        await asyncio.wait({working})
    return working.result()


async def _hung_up(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
