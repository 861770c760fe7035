"""REST of the 3D view: commands of the page to its view, and charts of the scan. Thin over `ProjectView`."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query

from app.view import charts
from app.view.commands import ViewCommand, ViewState
from app.view.project_view import ProjectView
from app.view.registry import ViewRegistry

ProjectId = Annotated[str, Path(pattern=r"^[A-Za-z0-9_-]{1,64}$")]


def view_router(registry: ViewRegistry, may_open: Callable[[str], object]) -> APIRouter:
    """Return the routes, to be included under `/api/v1`.

    may_open: raises EchoBaseError for a project that does not exist; called before a view is made. All routes are plain
    functions: FastAPI runs them in its thread pool, never on the event loop that also carries the view's WebSocket.
    """
    router = APIRouter(tags=["view"])

    def opened(project_id: str) -> ProjectView:
        may_open(project_id)
        return registry.get(project_id)

    @router.post("/projects/{project_id}/view")
    def command(project_id: ProjectId, body: ViewCommand) -> ViewState:
        """Change what the 3D view shows, or edit key points from it."""
        return opened(project_id).command(body)

    @router.get("/projects/{project_id}/view")
    def state(project_id: ProjectId, client: Annotated[int | None, Query(ge=0)] = None) -> ViewState:
        """Return what the 3D view shows."""
        return opened(project_id).state(client)

    @router.get("/projects/{project_id}/charts/deviation")
    def deviation(project_id: ProjectId) -> dict[str, Any]:
        """Return histograms of the measured deviation before and after the correction."""
        return charts.deviation_chart(opened(project_id).model)

    @router.get("/projects/{project_id}/charts/amplitude")
    def amplitude(project_id: ProjectId) -> dict[str, Any]:
        """Return the histogram of the amplitude in dB from the reference."""
        return charts.amplitude_chart(opened(project_id).model)

    @router.get("/projects/{project_id}/charts/cscan")
    def cscan(project_id: ProjectId, of: Literal["amplitude", "distance"] = "amplitude") -> dict[str, Any]:
        """Return a map of laws by poses."""
        return charts.c_scan(opened(project_id).model, of)

    @router.get("/projects/{project_id}/charts/bscan")
    def bscan(project_id: ProjectId, law: Annotated[int, Query(ge=1, le=4096)] = 1) -> dict[str, Any]:
        """Return the front wall of one law along the scan."""
        return charts.b_scan(opened(project_id).model, law)

    return router
