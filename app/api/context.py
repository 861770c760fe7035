"""`Context`: what every route needs, made once per server."""

from dataclasses import dataclass
from typing import Annotated, Any, cast

from fastapi import Depends, Path
from fastapi.requests import HTTPConnection

from app.jobs.runner import JobRunner
from app.jobs.thinker import Thinker
from app.settings import ServerSettings
from app.store.store import Store


@dataclass(frozen=True, eq=False)
class Context:
    """Settings, store, jobs and 3D views of one server."""

    settings: ServerSettings
    store: Store
    runner: JobRunner
    views: Any
    """`app.view.registry.ViewRegistry`."""
    thinker: Thinker


def context_of(connection: HTTPConnection) -> Context:
    """Return the context of the running app."""
    return cast(Context, connection.app.state.context)


Ctx = Annotated[Context, Depends(context_of)]
ProjectId = Annotated[str, Path(description="Identifier of the project.", examples=["5f1c0a9b2d3e4f5a6b7c"])]
Number = Annotated[int, Path(ge=1, le=10**9, description="Number within the project, from 1.")]
