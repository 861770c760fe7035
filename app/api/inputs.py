"""Routes of setup, inspection surface, key points and record: what two people may edit."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Query, Response

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented
from app.api.etags import IfMatch, expected, tag
from app.api.models import Surface
from app.inputs import keypoints_from
from app.report.record import Record
from app.store import inputs, projects
from planner.keypoint import KeyPoint, KeyPointList
from planner.setup import Setup

router = APIRouter(prefix="/projects/{project_id}", tags=["inputs"])
Version = Annotated[
    int | None,
    Query(ge=0, description="An earlier version instead of the one in force; 0: as it was before anybody gave one."),
]
MAX_KEYPOINTS = 10_000


@router.get("/setup", responses=documented(404))
def get_setup(ctx: Ctx, project_id: ProjectId, response: Response, version: Version = None) -> Setup:
    """Return the setup in force, every field filled in."""
    return Setup.model_validate(_read(ctx, project_id, "setup", response, version))


@router.put("/setup", responses=documented(404, 412))
def put_setup(ctx: Ctx, project_id: ProjectId, body: Setup, response: Response, if_match: IfMatch = None) -> Setup:
    """Replace the setup; every field is optional and defaults to the paper's cell."""
    row = inputs.put(ctx.store, project_id, "setup", body.model_dump(mode="json"), expected(if_match))
    tag(response, row.version)
    return body


@router.get("/surface", responses=documented(404))
def get_surface(ctx: Ctx, project_id: ProjectId, response: Response, version: Version = None) -> Surface:
    """Return how the inspection surface is chosen."""
    return Surface.model_validate(_read(ctx, project_id, "surface", response, version))


@router.put("/surface", responses=documented(404, 412))
def put_surface(
    ctx: Ctx, project_id: ProjectId, body: Surface, response: Response, if_match: IfMatch = None
) -> Surface:
    """Choose the inspection surface by points on it."""
    row = inputs.put(ctx.store, project_id, "surface", body.model_dump(mode="json"), expected(if_match))
    tag(response, row.version)
    return body


@router.get("/keypoints", responses=documented(404))
def get_keypoints(ctx: Ctx, project_id: ProjectId, response: Response, version: Version = None) -> list[KeyPoint]:
    """Return the key points in force (`keypoints.json`); an empty list if there are none."""
    return KeyPointList.validate_python(_read(ctx, project_id, "keypoints", response, version))


@router.put("/keypoints", responses=documented(404, 412))
def put_keypoints(
    ctx: Ctx,
    project_id: ProjectId,
    body: Annotated[
        list[KeyPoint],
        Body(max_length=MAX_KEYPOINTS, examples=[[{"id": "K1", "x_mm": 12.5, "y_mm": 40.0, "z_mm": 0.0}]]),
    ],
    response: Response,
    if_match: IfMatch = None,
) -> list[KeyPoint]:
    """Replace the key points. They are snapped to the surface when the paths are planned."""
    points = keypoints_from([p.model_dump() for p in body])
    row = inputs.put(
        ctx.store, project_id, "keypoints", KeyPointList.dump_python(points, mode="json"), expected(if_match)
    )
    tag(response, row.version)
    return points


@router.get("/record", responses=documented(404))
def get_record(ctx: Ctx, project_id: ProjectId, response: Response, version: Version = None) -> Record:
    """Return the record that results to come take over (`record.json`); empty fields print as blanks."""
    return Record.model_validate(_read(ctx, project_id, "record", response, version))


@router.put("/record", responses=documented(404, 412))
def put_record(ctx: Ctx, project_id: ProjectId, body: Record, response: Response, if_match: IfMatch = None) -> Record:
    """Replace the record of results to come. Each alignment and assessment keeps the one it was made with.

    Results made before anything was written down take the first record. A result's own is edited at its own address
    (`PUT alignments/{n}/record`, `PUT assessments/{n}/record`).
    """
    row = inputs.put(ctx.store, project_id, "record", body.model_dump(mode="json"), expected(if_match))
    tag(response, row.version)
    return body


def _read(ctx: Context, project_id: str, kind: str, response: Response, version: int | None) -> Any:
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = (
            inputs.version_of(session, project_id, kind, version)
            if version is not None
            else inputs.current(session, project_id, kind)
        )
    tag(response, row.version)
    return row.content
