"""The 3D view behind a proxy of the same shape as the real one, around a model in memory: no project, no store."""

import asyncio
import contextlib
import importlib.resources
import socket
import threading

import uvicorn
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from fastapi.responses import HTMLResponse
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from app.view.loopback import KEY_HEADER, USER_HEADER
from app.view.registry import ViewRegistry
from app.view.routes import view_router

SHIM = (
    "<script>document.hasFocus=()=>!document.hidden;</script>"
    "<style>[data-testid='floating-panel'],.mantine-Notifications-root{display:none!important}</style>"
)


def bare_app(registry: ViewRegistry) -> FastAPI:
    """Return the application."""
    app = FastAPI()
    app.include_router(view_router(registry, lambda _: None), prefix="/api/v1")
    client = importlib.resources.files("viser").joinpath("client/build/index.html").read_text(encoding="utf-8")

    @app.get("/view/{pid}/")
    def page(pid: str) -> HTMLResponse:
        return HTMLResponse(client.replace("</head>", SHIM + "</head>", 1))

    @app.websocket("/view/{pid}")
    async def relay(ws: WebSocket, pid: str) -> None:
        view = await asyncio.to_thread(registry.get, pid)
        headers = {KEY_HEADER: registry.key, USER_HEADER: "tester"}
        async with connect(
            f"ws://127.0.0.1:{view.port}/",
            subprotocols=ws.scope["subprotocols"],
            compression=None,
            max_size=None,
            proxy=None,
            additional_headers=headers,
        ) as up:
            await ws.accept(subprotocol=up.subprotocol)

            async def down() -> None:
                async for message in up:
                    await ws.send_bytes(message)

            async def upwards() -> None:
                while True:
                    await up.send(await ws.receive_bytes())

            tasks = [asyncio.create_task(down()), asyncio.create_task(upwards())]
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in tasks:
                task.cancel()
                with contextlib.suppress(
                    asyncio.CancelledError, ConnectionClosed, WebSocketDisconnect, RuntimeError, KeyError
                ):
                    await task

    return app


class Running:
    """uvicorn in a thread on a free port."""

    def __init__(self, app: FastAPI, port: int = 0) -> None:
        self.socket = socket.socket()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(("127.0.0.1", port))
        # Listening before uvicorn runs: a browser that is quicker waits instead of being refused.
        self.socket.listen(128)
        self.port = self.socket.getsockname()[1]
        config = uvicorn.Config(
            app, log_level="warning", ws_per_message_deflate=False, ws_max_size=2**26, timeout_graceful_shutdown=1
        )
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [self.socket]}, daemon=True)
        self.thread.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def stop(self) -> None:
        self.server.should_exit = True
        self.thread.join(timeout=10)
        self.socket.close()
