"""Who may talk to the server: exact Host and Origin, for HTTP and WebSocket alike, and headers that keep browsers honest."""

import asyncio
import json
import re
from collections.abc import Iterable

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.errors import error_body, for_status
from app.settings import ServerSettings
from planner.issues import Issue

# The page, its charts and viser's client: nothing from outside, no plugins, no frames but our own.
CSP = (
    "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self' blob: data:; worker-src 'self' blob:; frame-src 'self'; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
# viser's client is one HTML file with its scripts inside, and compiles WebAssembly.
CSP_VIEW = CSP.replace("script-src 'self'", "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:")
# Documents that EchoBase made from data: nothing runs in them.
CSP_DOCUMENT = (
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; frame-ancestors 'self'"
)
HEADERS = {
    "content-security-policy": CSP,
    "x-content-type-options": "nosniff",
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
}
UPLOADS = re.compile(r"^/api/v1/projects/(?:[^/]+/(?:part|scans|calibrations/[^/]+)|import)$")
SAFE_METHODS = {"GET", "HEAD"}
# What is read and forgotten of a request that is refused while it still comes (bytes, s).
DRAIN_BYTES, DRAIN_S = 64 * 2**20, 5.0
FIRST_REFUSAL = 400


def allowed_names(settings: ServerSettings, port: int) -> tuple[frozenset[str], frozenset[str]]:
    """Return the exact Host values and Origins that the server answers to on a port."""
    loopback = ("127.0.0.1", "localhost", "[::1]")
    hosts = {f"{name}:{port}" for name in loopback} | set(settings.allowed_hosts)
    if port == 80:
        hosts |= set(loopback)
    origins = {f"http://{host}" for host in hosts} | {f"https://{host}" for host in settings.allowed_hosts}
    return frozenset(h.lower() for h in hosts), frozenset(o.lower() for o in origins | set(settings.allowed_origins))


class Guard:
    """Pure ASGI: refuses foreign Hosts and Origins before anything else runs, and adds the headers."""

    def __init__(self, app: ASGIApp, settings: ServerSettings, port: int | None = None) -> None:
        self.app, self.settings = app, settings
        self.port = settings.port if port is None else port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        # Asked for port 0, the system chose one: the socket knows it.
        server = scope.get("server") or (None, None)
        port = self.port or (server[1] if isinstance(server[1], int) else 0)
        hosts, origins = allowed_names(self.settings, port)
        headers = Headers(scope=scope)
        issue = _refusal(scope, headers, hosts, origins)
        if scope["type"] == "websocket":
            if issue is not None:
                await _close_websocket(receive, send)
                return
            await self.app(scope, receive, send)
            return
        body = _Body(receive, waits="expect" in headers)
        sender = _with_headers(_after_body(send, body))
        receive = body
        if issue is not None:
            await _answer(sender, 403, issue)
            return
        limited = _Limited(receive, self.settings.max_body_bytes) if not UPLOADS.match(scope["path"]) else None
        if limited is not None and limited.announced(headers):
            await _answer(sender, 413, for_status(413, scope["path"]))
            return
        await self.app(scope, limited or receive, sender)


def _refusal(scope: Scope, headers: Headers, hosts: frozenset[str], origins: frozenset[str]) -> Issue | None:
    given_hosts = headers.getlist("host")
    if len(given_hosts) != 1 or given_hosts[0].lower() not in hosts:
        remedy = "Use the address that the server printed, or name this one in ECHOBASE_ALLOWED_HOSTS."
        return Issue("error", "host-foreign", "this server does not answer to that name.", remedy, "Host")
    given = headers.getlist("origin")
    is_socket = scope["type"] == "websocket"
    foreign = Issue(
        "error", "origin-foreign", "pages of other origins may not call this server.", "Open its own page.", "Origin"
    )
    if given or is_socket:
        # A browser always says where a WebSocket comes from; who does not is no browser, or hides it.
        return None if len(given) == 1 and given[0].lower() in origins else foreign
    site = headers.get("sec-fetch-site")
    if site in (None, "same-origin", "none"):
        return None
    # A link or a bookmark on another site may open the page; nothing else of another site gets an answer.
    opens_page = headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"
    is_page = not scope["path"].startswith(("/api/", "/view/"))
    return None if scope["method"] in SAFE_METHODS and opens_page and is_page else foreign


class _Body:
    """A request's body as it is read; `drain` reads what is left of it.

    A refusal that comes while the client still sends is lost if the connection is closed on data that nobody read: the
    network then resets it, and the client sees a broken connection in place of the reason. `waits`: the client asked
    whether it may send at all, and sends nothing unless we read.
    """

    def __init__(self, receive: Receive, waits: bool) -> None:
        self._receive, self._done, self._waits = receive, False, waits

    async def __call__(self) -> Message:
        message = await self._receive()
        self._waits = False
        self._done = message["type"] != "http.request" or not message.get("more_body", False)
        return message

    async def drain(self) -> None:
        """Read and forget the rest, within bounds of size and time."""
        left = DRAIN_BYTES
        try:
            async with asyncio.timeout(DRAIN_S):
                while not self._done and not self._waits and left > 0:
                    left -= len((await self()).get("body", b""))
        except TimeoutError:
            return


def _after_body(send: Send, body: _Body) -> Send:
    """Return a send that reads what is left of the request before a refusal goes out."""

    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start" and message["status"] >= FIRST_REFUSAL:
            await body.drain()
        await send(message)

    return sender


class _Limited:
    """Counts the body of a request."""

    def __init__(self, receive: Receive, largest: int) -> None:
        self._receive, self._left = receive, largest

    def announced(self, headers: Headers) -> bool:
        """True if the request says itself that it is too large, or is not clear about it."""
        length = headers.get("content-length")
        return length is not None and (not length.isdigit() or int(length) > self._left)

    async def __call__(self) -> Message:
        message = await self._receive()
        self._left -= len(message.get("body", b""))
        if self._left < 0:
            raise HTTPException(413)
        return message


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
            if "server" in headers:
                del headers["server"]
        await send(message)

    return sender


async def _answer(send: Send, status: int, issue: Issue) -> None:
    body = json.dumps(error_body([issue])).encode()
    headers: Iterable[tuple[bytes, bytes]] = [
        (b"content-type", b"application/json"),
        (b"content-length", str(len(body)).encode()),
        (b"cache-control", b"no-store"),
        (b"connection", b"close"),
    ]
    await send({"type": "http.response.start", "status": status, "headers": list(headers)})
    await send({"type": "http.response.body", "body": body})


async def _close_websocket(receive: Receive, send: Send) -> None:
    await receive()
    # Before it is accepted, a close answers the handshake with 403.
    await send({"type": "websocket.close", "code": 1008, "reason": "forbidden"})
