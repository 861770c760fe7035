"""The server: one app, one port, one process."""

import contextlib
import ipaddress
import logging
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import plotly
import uvicorn
from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.responses import FileResponse, HTMLResponse
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from app.api import (
    archive_routes,
    batch_routes,
    calibration_routes,
    cell_routes,
    errors,
    inputs,
    job_routes,
    part,
    projects,
    report_routes,
    result_routes,
    samples,
    scan_routes,
    state_routes,
    together_routes,
    work,
)
from app.api.context import Context
from app.api.docs_page import docs_page
from app.api.project_model import StoreModel
from app.jobs.dask_slot import DaskSlot, connect
from app.jobs.runner import JobRunner
from app.jobs.slot import ProcessSlot, Slot
from app.jobs.thinker import Thinker
from app.scratch import temporary_files_in
from app.security import Guard
from app.settings import ServerSettings
from app.store.projects import get
from app.store.refusal import refuse
from app.store.store import VERSION, Store, open_store
from app.view import proxy
from app.view.registry import ViewRegistry
from app.view.routes import view_router

log = logging.getLogger(__name__)
PREFIX = "/api/v1"
DESCRIPTION = (
    "Plan robotic ultrasonic inspections from CAD, find the real part with the ultrasound itself, export the corrected KRL "
    "program. All lengths are mm, all angles degrees."
)
# Beside the packages in a checkout, inside the package in an installed wheel.
STATIC_PLACES = (Path(__file__).parents[1] / "static", Path(__file__).parent / "_static")
WS_MAX_BYTES = 64 * 1024 * 1024


def create_app(settings: ServerSettings) -> FastAPI:
    """Return the app; its store is opened, its jobs start and its views close with its lifespan."""

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        context = open_context(settings)
        app.state.context = context
        context.runner.start()
        try:
            yield
        finally:
            context.store.exchange.close()
            # The thinker first: the views wait for what they asked it.
            context.thinker.close()
            context.views.close_all()
            context.runner.stop()
            context.store.close()

    app = FastAPI(
        title="EchoBase", version=VERSION, description=DESCRIPTION, lifespan=lifespan, docs_url=None, redoc_url=None,
        openapi_url="/openapi.json", redirect_slashes=False, separate_input_output_schemas=False,
    )  # fmt: skip
    errors.install(app)
    app.add_middleware(Guard, settings=settings)
    # `import` would else be taken for a project's identifier.
    for module in (
        archive_routes,
        samples,
        projects,
        part,
        inputs,
        cell_routes,
        calibration_routes,
        work,
        scan_routes,
        report_routes,
        result_routes,
        state_routes,
        together_routes,
        batch_routes,
        job_routes,
    ):
        app.include_router(module.router, prefix=PREFIX)
    app.include_router(_views(app), prefix=PREFIX)
    app.include_router(proxy.router)
    app.include_router(_pages())
    return app


def open_context(settings: ServerSettings) -> Context:
    """Open store, jobs and views."""
    store = open_store(settings)
    if store.swept.missing:
        log.error("%d stored files are missing: restore the data folder from a backup", len(store.swept.missing))
    try:
        runner = JobRunner(store, _slots(settings))
    except BaseException:
        store.close()
        raise
    thinker = Thinker()
    views = ViewRegistry(lambda project_id: StoreModel(store, project_id, thinker))
    return Context(settings, store, runner, views, thinker)


def _slots(settings: ServerSettings) -> Any:
    if not settings.scheduler:
        return ProcessSlot
    client = connect(settings.scheduler)

    def make() -> Slot:
        return DaskSlot(client)

    return make


class _LateViews:
    """The view's routes are made before the lifespan that opens the registry."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    def __getattr__(self, name: str) -> Any:
        return getattr(self._app.state.context.views, name)


def _views(app: FastAPI) -> APIRouter:
    def may_open(project_id: str) -> None:
        store: Store = app.state.context.store
        with store.db.read() as session:
            get(session, project_id)

    return view_router(_LateViews(app), may_open)  # type: ignore[arg-type]


class _Files(StaticFiles):
    """The page's own files: always asked for again, answered with 304 when they are the same."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = "no-cache"
        return response


def _pages() -> APIRouter:
    router = APIRouter(include_in_schema=False)
    folder = next((p for p in STATIC_PLACES if p.is_dir()), STATIC_PLACES[0])
    plotly_js = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"

    @router.get("/")
    def page() -> Response:
        """Return the page."""
        index = folder / "index.html"
        if not index.is_file():
            raise refuse(
                404,
                "page-missing",
                "this installation came without its page.",
                "Install EchoBase anew; REST works: /docs.",
            )
        return FileResponse(index, media_type="text/html; charset=utf-8", headers={"Cache-Control": "no-cache"})

    @router.get("/vendor/plotly.min.js")
    def plotly_script() -> Response:
        """Return plotly's script from the installed package."""
        return FileResponse(plotly_js, media_type="text/javascript", headers={"Cache-Control": "public, max-age=3600"})

    @router.get("/docs")
    def docs(request: Request) -> HTMLResponse:
        """Return the API as a page."""
        base = str(request.base_url).rstrip("/")
        return HTMLResponse(docs_page(request.app.openapi(), base), headers={"Cache-Control": "no-cache"})

    if folder.is_dir():
        router.mount("/static", _Files(directory=folder), name="static")
    return router


class _Server(uvicorn.Server):
    """Ends the event streams as soon as it is told to stop, so that stopping takes no longer than the work in hand."""

    def handle_exit(self, sig: int, frame: Any) -> None:
        context = getattr(getattr(self.config.app, "state", None), "context", None)
        if context is not None:
            context.store.exchange.close()
        super().handle_exit(sig, frame)


def serve(host: str | None = None, port: int | None = None, data: Path | None = None) -> int:
    """Run the server until it is stopped; arguments go before `ECHOBASE_*`. Returns the exit status."""
    given = {key: value for key, value in {"host": host, "port": port, "data": data}.items() if value is not None}
    settings = ServerSettings(**given)  # type: ignore[arg-type]
    _require_safe_address(settings)
    listener = _listen(settings)
    settings = settings.model_copy(update={"port": listener.getsockname()[1]})
    app = create_app(settings)
    config = uvicorn.Config(
        app, workers=1, ws="websockets-sansio", ws_max_size=WS_MAX_BYTES, ws_per_message_deflate=False, log_level="warning",
        server_header=False, timeout_graceful_shutdown=5, proxy_headers=False,
    )  # fmt: skip
    shown = f"[{settings.host}]" if ":" in settings.host else settings.host
    sys.stdout.write(
        f"EchoBase {VERSION}: http://{shown}:{settings.port}/  (data in {settings.data.resolve()}; stop with Ctrl+C)\n"
    )
    sys.stdout.flush()
    server = _Server(config)
    with temporary_files_in(settings.scratch()):
        server.run(sockets=[listener])
    return 0 if server.started else 1


def _require_safe_address(settings: ServerSettings) -> None:
    if settings.is_loopback or settings.allowed_hosts:
        return
    raise refuse(
        409, "address-open", f"{settings.host} can be reached by others, and EchoBase has no accounts.",
        "Put a proxy that checks who comes in front, and name the exact host[:port] of browsers in ECHOBASE_ALLOWED_HOSTS.",
        "--host",
    )  # fmt: skip


def _listen(settings: ServerSettings) -> socket.socket:
    try:
        family = socket.AF_INET6 if ipaddress.ip_address(settings.host).version == 6 else socket.AF_INET
    except ValueError:
        family = socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
    except OSError as error:
        listener.close()
        raise refuse(
            409, "port-taken", f"nothing can listen on {settings.host}:{settings.port} ({error.strerror}).",
            "Stop what uses it, or choose another --port.", "--port",
        ) from error  # fmt: skip
    listener.listen(256)
    return listener
