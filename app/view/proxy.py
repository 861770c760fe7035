"""Puts the 3D view on the server's own port: viser's client as a page, its WebSocket through to the loopback server."""

import asyncio
import contextlib
from pathlib import Path

import viser
import websockets
from fastapi import APIRouter, Response, WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect

from app.api.context import Context, Ctx, context_of
from app.security import CSP_VIEW
from app.store.names import clean_text, is_id
from app.store.projects import get
from app.view.loopback import KEY_HEADER, USER_HEADER
from planner.errors import EchoBaseError

router = APIRouter(include_in_schema=False)
CLIENT_HTML = Path(viser.__file__).parent / "client" / "build" / "index.html"
# viser reconnects only in a focused document, which a frame beside a form rarely is; its panels are replaced by our page.
# Its sorter of Gaussian splats, which EchoBase never shows, evaluates text and fails under the policy: not an error to report.
SHIM = """<script>document.hasFocus = () => !document.hidden;
addEventListener("unhandledrejection", (e) => { if (e.reason instanceof EvalError) e.preventDefault(); });</script>
<style>[data-testid="floating-panel"], .mantine-Notifications-root,
.mantine-Paper-root[style*="position: fixed"][style*="bottom: 0"]
{ display: none !important; }</style>
"""
NOT_FOUND, BAD_UPSTREAM = 4404, 4502


def client_page() -> bytes:
    """Return viser's client with the shim in its head; raises RuntimeError if this viser has no such place."""
    html = CLIENT_HTML.read_text(encoding="utf-8")
    head, mark, rest = html.partition("</head>")
    if not mark:
        raise RuntimeError("viser's client has no </head>: install the pinned version")
    return (head + SHIM + mark + rest).encode()


@router.get("/view/{project_id}/")
def view_page(ctx: Ctx, project_id: str) -> Response:
    """Return viser's client; it opens its WebSocket at this address without the last slash."""
    with ctx.store.db.read() as session:
        get(session, project_id)
    # no-cache: after an upgrade an old client would be refused by the new server.
    headers = {"Cache-Control": "no-cache", "Content-Security-Policy": CSP_VIEW}
    return Response(client_page(), media_type="text/html; charset=utf-8", headers=headers)


@router.websocket("/view/{project_id}")
async def view_socket(socket: WebSocket, project_id: str) -> None:
    """Pass a browser through to the view of its project. Host and Origin were checked before."""
    ctx = context_of(socket)
    try:
        port = await asyncio.to_thread(_port, ctx, project_id)
    except EchoBaseError:
        await socket.close(NOT_FOUND)
        return
    headers = {KEY_HEADER: ctx.views.key, USER_HEADER: _user(socket)}
    try:
        upstream = await connect(
            f"ws://127.0.0.1:{port}/", subprotocols=socket.scope["subprotocols"] or None, compression=None, max_size=None,
            ping_interval=None, proxy=None, additional_headers=headers,
        )  # fmt: skip
    except (OSError, websockets.WebSocketException):
        await socket.close(BAD_UPSTREAM)
        return
    async with upstream:
        await socket.accept(subprotocol=upstream.subprotocol)
        await _pass_through(socket, upstream)


def _port(ctx: Context, project_id: str) -> int:
    """Return the port of a project's view, made now if need be; raises Refusal 404 before anything is made."""
    with ctx.store.db.read() as session:
        get(session, project_id if is_id(project_id) else "")
    return int(ctx.views.get(project_id).port)


def _user(socket: WebSocket) -> str:
    """Return the name a person gave himself, for the others to see; ASCII, because it travels as a header."""
    try:
        name = clean_text(socket.cookies.get("echobase-name", ""), "name", 60)
    except EchoBaseError:
        return ""
    return name.encode("ascii", "replace").decode()


async def _pass_through(socket: WebSocket, upstream: ClientConnection) -> None:
    async def down() -> None:
        async for message in upstream:
            if isinstance(message, bytes):
                await socket.send_bytes(message)
            else:
                await socket.send_text(message)

    async def up() -> None:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("bytes")
            await upstream.send(data if data is not None else message["text"])

    pumps = [asyncio.create_task(down()), asyncio.create_task(up())]
    await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
    for pump in pumps:
        pump.cancel()
    # Either side may be gone already; there is nothing more to tell it.
    for pump in pumps:
        with contextlib.suppress(
            asyncio.CancelledError, websockets.ConnectionClosed, WebSocketDisconnect, RuntimeError, OSError
        ):
            await pump
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await socket.close()
