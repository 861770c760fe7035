"""A sample part and its cell, in one click."""

import hashlib
from functools import cache
from typing import Any

from fastapi import APIRouter
from pydantic import Field

from app.api.context import Context, Ctx, ProjectId
from app.api.errors import documented
from app.api.models import Body
from app.api.parts import keep_part
from app.samples import NAMES, sample
from app.store import inputs, projects
from app.store.blobs import CHUNK

router = APIRouter(tags=["projects"])


class SampleChoice(Body):
    """Which sample."""

    part: str = Field(examples=["aerofoil"])


@router.get("/samples", responses=documented())
def list_samples() -> list[dict[str, Any]]:
    """Return the sample parts: SHA-256 of the CAD file, and an offset to hide it at for a rehearsal (mm, deg)."""
    keys = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    return [
        {"name": n, "sha256": _sha256(n), "hidden_offset": dict(zip(keys, sample(n).hidden_offset, strict=True))}
        for n in NAMES
    ]


@cache
def _sha256(name: str) -> str:
    return hashlib.sha256(sample(name).source.read_bytes()).hexdigest()


@router.post("/projects/{project_id}/sample", responses=documented(404))
def use_sample(ctx: Ctx, project_id: ProjectId, body: SampleChoice) -> dict[str, Any]:
    """Put a sample part and its cell in force."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
    fill_with_sample(ctx, project_id, body.part)
    return {"part": body.part}


def fill_with_sample(ctx: Context, project_id: str, name: str) -> None:
    """Give a project a sample's part and setup; key points and seeds of another part go."""
    chosen = sample(name)
    with ctx.store.busy():
        with chosen.source.open("rb") as file, ctx.store.writer(ctx.settings.max_part_bytes, "part") as writer:
            while data := file.read(CHUNK):
                writer.write(data)
            blob = writer.finish()
        keep_part(ctx.store, project_id, blob, chosen.source.name, None, None)
    inputs.put(ctx.store, project_id, "setup", chosen.setup.model_dump(mode="json"))
    for kind in ("surface", "keypoints"):
        if _is_given(ctx, project_id, kind):
            inputs.put(ctx.store, project_id, kind, inputs.defaults()[kind])


def _is_given(ctx: Context, project_id: str, kind: str) -> bool:
    with ctx.store.db.read() as session:
        return inputs.current(session, project_id, kind).is_given
