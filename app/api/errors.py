"""One error shape for everything: `{"error": {"code", "message", "remedy", "where"}}`, with `issues` if there are several."""

import logging
import secrets
from collections.abc import Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.inputs import NO_OBJECT
from app.store.refusal import Refusal
from planner.errors import EchoBaseError
from planner.issues import Issue

log = logging.getLogger(__name__)


class IssueBody(BaseModel):
    """One finding."""

    severity: str
    code: str
    message: str
    remedy: str
    where: str


class ErrorDetail(BaseModel):
    """What went wrong, where, and what to do about it."""

    code: str
    message: str
    remedy: str
    where: str
    issues: list[IssueBody] | None = None


class ErrorBody(BaseModel):
    """The body of every answer with a status of 400 or more."""

    error: ErrorDetail


STATUS_TEXT = {
    400: ("request-malformed", "the request is malformed.", "Correct it."),
    401: ("not-allowed", "this needs a login.", ""),
    403: ("not-allowed", "this is not allowed from here.", ""),
    404: ("address-unknown", "there is nothing at this address.", "See /docs for what there is."),
    405: ("method-unknown", "this address does not answer to this method.", "See the Allow header."),
    411: ("length-missing", "the request does not say how long it is.", "Send a Content-Length."),
    413: ("body-too-large", "the request is too large.", "Send a smaller one."),
    415: ("media-type-unknown", "this kind of content is not understood here.", "Send application/json."),
}


def error_body(issues: Sequence[Issue]) -> dict[str, Any]:
    """Return the error shape of some issues; the first error-level one speaks for them."""
    first = next((i for i in issues if i.severity == "error"), issues[0])
    body: dict[str, Any] = {key: value for key, value in first.to_json().items() if key != "severity"}
    if len(issues) > 1:
        body["issues"] = [issue.to_json() for issue in issues]
    return {"error": body}


def error_response(status: int, *issues: Issue, headers: dict[str, str] | None = None) -> JSONResponse:
    """Return an error as a response."""
    return JSONResponse(error_body(issues), status, {"Cache-Control": "no-store", **(headers or {})})


def for_status(status: int, where: str = "") -> Issue:
    """Return what there is to say about a bare status."""
    code, message, remedy = STATUS_TEXT.get(status, (f"http-{status}", f"the server answered {status}.", ""))
    return Issue("error", code, message, remedy, where)


def install(app: FastAPI) -> None:
    """Make the app speak the one error shape."""

    @app.exception_handler(EchoBaseError)
    async def _refused(_request: Request, error: EchoBaseError) -> JSONResponse:
        status = (
            error.status if isinstance(error, Refusal) else 412 if error.issues[0].code == "keypoints-changed" else 422
        )
        return error_response(status, *error.issues)

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        headers = dict(error.headers or {})
        if error.status_code == 405:
            headers["Allow"] = ", ".join(_allowed(app, request.url.path)) or headers.get("Allow", "")
        return error_response(error.status_code, for_status(error.status_code, request.url.path), headers=headers)

    @app.exception_handler(RequestValidationError)
    async def _invalid(_request: Request, error: RequestValidationError) -> JSONResponse:
        return error_response(422, *[_field(dict(e)) for e in error.errors()[:50]])

    app.add_middleware(Faults)


class Faults:
    """Pure ASGI: a fault of our own becomes an answer in the one shape, with a mark that finds it in the log."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Run the app; answer 500 if it raises before it answered."""
        started = False

        async def sender(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, sender)
        except ClientDisconnect:
            return
        except Exception as error:
            if scope["type"] != "http" or started:
                raise
            mark = secrets.token_hex(4)
            log.error("fault %s in %s %s", mark, scope["method"], scope["path"], exc_info=error)
            text = f"EchoBase has a fault of its own ({mark}); nothing was changed."
            issue = Issue("error", "internal", text, "Please report it with the server's log.")
            await error_response(500, issue)(scope, receive, send)


def _allowed(app: FastAPI, path: str) -> list[str]:
    """Return every method that some route of the path answers to: the router only knows the first."""
    found: set[str] = set()
    for method in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"):
        scope: dict[str, Any] = {"type": "http", "path": path, "method": method, "headers": [], "root_path": ""}
        if any(route.matches(scope)[0] is Match.FULL for route in app.router.routes):
            found.add(method)
    return sorted(found)


def _field(error: dict[str, Any]) -> Issue:
    place = ".".join(str(p) for p in error["loc"])
    message = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "json_invalid":
        return Issue("error", "not-json", "the body is not valid JSON.", "Correct it.", place)
    if error["type"] == "extra_forbidden":
        return Issue("error", "field-unknown", f"there is no field '{place}'.", "Correct the name or remove it.", place)
    if error["type"] in NO_OBJECT:
        text = f"{place}: a JSON object with its fields in {{ }} is needed."
        return Issue("error", "field-invalid", text, "Send it with Content-Type: application/json.", place)
    code = "field-missing" if error["type"] == "missing" else "field-invalid"
    return Issue("error", code, f"{place}: {message[:1].lower()}{message[1:300]}.", "Correct it.", place)


_DOCS = {
    403: "Wrong Host or Origin.",
    404: "There is no such thing.",
    409: "Not now: something before it is missing, stale or failed.",
    412: "It was changed meanwhile (`If-Match`).",
    413: "Too large.",
    422: "Understood and impossible; the issues say why.",
    507: "The disk is full; nothing was kept.",
}


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the error answers of a route for its OpenAPI entry."""
    return {s: {"model": ErrorBody, "description": _DOCS[s]} for s in (403, 422, *statuses)}
