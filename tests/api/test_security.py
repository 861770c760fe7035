"""Who may talk to the server: every route, HTTP and WebSocket, against foreign hosts, origins and pages."""

import asyncio
import re

import httpx
import pytest
import websockets
from fastapi.routing import iter_route_contexts
from starlette.routing import WebSocketRoute

from app.server import create_app, serve
from app.settings import ServerSettings
from planner.errors import EchoBaseError
from tests.api.conftest import error_of, new_project

EVIL = "https://evil.example"


def routes() -> list[tuple[str, str]]:
    """Every (method, path) of the app, WebSockets as WS, with something plausible for its parameters."""
    found = set()
    for context in iter_route_contexts(create_app(ServerSettings()).router.routes):
        path = re.sub(r"\{(\w+)(?::\w+)?\}", lambda m: "1" if m[1] in ("number", "place") else "0" * 20, context.path)
        if isinstance(context.original_route, WebSocketRoute) or not context.methods:
            found.add(("WS" if "view" in path else "GET", path))
        else:
            found |= {(method, path) for method in context.methods}
    return sorted(found)


def foreign(url: str) -> list[dict[str, str]]:
    return [
        {"Origin": EVIL},
        {"Origin": "null"},
        {"Origin": ""},
        {"Origin": url.replace("http", "https")},
        {"Origin": url + ".evil.example"},
        {"Origin": url[:-1]},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
        {"Host": url.removeprefix("http://") + ".evil.example"},
        {"Host": "evil.example", "Origin": url},
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"},
        {"Sec-Fetch-Site": "same-site"},
    ]


def test_no_route_answers_a_stranger(client, server):
    checked = 0
    for method, path in routes():
        if method == "WS":
            continue
        for headers in foreign(server.url):
            if "cross-site" in headers.values() and path == "/" and method == "GET":
                continue
            answer = client.request(method, path, headers=headers)
            assert answer.status_code == 403, (method, path, headers)
            checked += 1
    assert checked > 500


def test_no_websocket_answers_a_stranger(client, server):
    project = new_project(client, part=None).rsplit("/", 1)[-1]
    url = server.url.replace("http", "ws") + f"/view/{project}"

    async def shake(origin: str | None, host: str | None = None) -> int:
        try:
            headers = {} if host is None else {"Host": host}
            async with websockets.connect(url, origin=origin, additional_headers=headers, proxy=None):
                return 101
        except websockets.InvalidStatus as refused:
            return refused.response.status_code
        except websockets.ConnectionClosed:
            return 0

    for origin in (EVIL, "null", None, server.url.replace("http", "https"), server.url + "0"):
        assert asyncio.run(shake(origin)) == 403, origin


def test_a_websocket_of_our_own_page_reaches_the_view_and_an_unknown_project_does_not(client, server):
    viser = pytest.importorskip("viser")
    project = new_project(client, part=None).rsplit("/", 1)[-1]
    protocol = [websockets.Subprotocol(f"viser-v{viser.__version__}")]

    async def first(name: str) -> bytes | int:
        url = server.url.replace("http", "ws") + f"/view/{name}"
        try:
            async with websockets.connect(
                url, origin=server.url, subprotocols=protocol, proxy=None, max_size=None
            ) as socket:
                assert socket.subprotocol == protocol[0]
                return await asyncio.wait_for(socket.recv(), 20)
        except websockets.InvalidStatus as refused:
            return refused.response.status_code

    assert len(asyncio.run(first(project))) > 0
    assert asyncio.run(first("0" * 20)) == 403
    assert asyncio.run(first("..%2f..%2fetc")) == 403


def test_a_link_from_elsewhere_opens_the_page_and_nothing_else(client):
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert client.get("/docs", headers=link).status_code == 200
    error_of(client.get("/api/v1/projects", headers=link), 403)
    framed = link | {"Sec-Fetch-Dest": "iframe"}
    error_of(client.get("/docs", headers=framed), 403)


def test_every_answer_carries_the_headers(client):
    for answer in (client.get("/docs"), client.get("/api/v1/health"), client.get("/nothing"),
                   client.get("/", headers={"Origin": EVIL}), client.get("/vendor/plotly.min.js")):  # fmt: skip
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'self'" in policy
        assert "unsafe-inline" not in policy.split("script-src")[1].split(";")[0]
        assert "server" not in answer.headers
        assert not re.search(r"https?:", policy)


def test_json_routes_take_json_only(client):
    # A form of another site cannot set this content type without asking first.
    answer = client.post("/api/v1/projects", content=b'{"name": "x"}', headers={"Content-Type": "text/plain"})
    error_of(answer, 422)


def test_an_open_address_needs_names(tmp_path):
    with pytest.raises(EchoBaseError, match="ECHOBASE_ALLOWED_HOSTS"):
        serve("0.0.0.0", 0, tmp_path)
    with pytest.raises(ValueError, match="exact name"):
        ServerSettings(allowed_hosts="*.example")


@pytest.mark.parametrize("path", ["/static/../pyproject.toml", "/static/%2e%2e/pyproject.toml", "/static/..%2fpyproject.toml",
                                  "/static//etc/passwd", "/vendor/../../etc/passwd", "/view/../api"])  # fmt: skip
def test_paths_do_not_climb(server, path):
    with httpx.Client() as raw:
        request = raw.build_request("GET", server.url)
        request.url = request.url.copy_with(raw_path=path.encode())
        answer = raw.send(request)
    assert answer.status_code == 404
    assert b"[project]" not in answer.content
