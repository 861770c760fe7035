"""Routes of the part: upload, and what is known of it."""

import asyncio
from typing import Annotated, cast

from fastapi import APIRouter, Query, Request, Response

from app.api.context import Ctx, ProjectId
from app.api.errors import documented
from app.api.etags import IfMatch, expected, tag
from app.api.models import PartInfo
from app.api.parts import info_of, keep_part
from app.api.receive import receive
from app.api.upload_body import choice, one_file, upload_body
from app.store import inputs, projects
from app.store.refusal import refuse
from planner.units import LENGTH_UNITS, LengthUnit

router = APIRouter(prefix="/projects/{project_id}", tags=["part"])

UPLOAD_BODY = upload_body(
    one_file("STEP, STL, OBJ, PLY or GLB."), {"unit": choice("mm", "cm", "m", "inch", example="mm")}
)


@router.put("/part", responses=documented(404, 412, 413, 507), openapi_extra=UPLOAD_BODY)
async def put_part(
    ctx: Ctx,
    project_id: ProjectId,
    request: Request,
    response: Response,
    unit: Annotated[
        str | None, Query(description="mm, cm, m or inch; needed for STL, OBJ and PLY.", examples=["mm"])
    ] = None,
    name: Annotated[str | None, Query(description="File name, for a bare body.", examples=["panel.step"])] = None,
    if_match: IfMatch = None,
) -> PartInfo:
    """Upload the CAD of the part: a form with `file` and `unit`, or the bare file with `?name=panel.stl&unit=mm`.

    The file is read in a process of its own; what cannot be read, or has no unit, changes nothing.
    """
    with ctx.store.busy():
        await asyncio.to_thread(_check, ctx, project_id, if_match)
        received = await receive(request, ctx.store, ctx.settings.max_part_bytes, 1, "part", name)
        shown, blob = received.files[0]
        given = _unit(received.fields.get("unit") or unit)
        row = await asyncio.to_thread(keep_part, ctx.store, project_id, blob, shown, given, expected(if_match))
    tag(response, row.version)
    return info_of(row)


@router.get("/part", responses=documented(404))
def get_part(ctx: Ctx, project_id: ProjectId, response: Response) -> PartInfo:
    """Return what is known of the part in force."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        row = inputs.current(session, project_id, "part")
    if not row.is_given:
        raise refuse(404, "part-missing", "the project has no part yet.", "Upload one.", "part")
    tag(response, row.version)
    return info_of(row)


def _check(ctx: Ctx, project_id: str, if_match: str | None) -> None:
    """Refuse before the upload what would be refused after it."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        projects.check_version("part", inputs.current(session, project_id, "part").version, expected(if_match))


def _unit(text: str | None) -> LengthUnit | None:
    if not text:
        return None
    if text not in LENGTH_UNITS:
        raise refuse(
            422, "unit-unknown", f"there is no unit '{text[:20]}'.", f"Use one of {', '.join(LENGTH_UNITS)}.", "unit"
        )
    return cast(LengthUnit, text)
