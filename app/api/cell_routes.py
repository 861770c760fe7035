"""Routes that help to state the cell: which robots there are, and BASE from touched points."""

from typing import Annotated

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, Field

from app.api.context import Ctx, ProjectId
from app.api.errors import documented
from app.api.models import Body, Point
from app.store import inputs, projects
from planner.base_fit import MIN_PAIRS, fit_base
from planner.robot import load_robot, robot_names
from planner.setup import Pose

router = APIRouter(tags=["inputs"])
MAX_PAIRS = 64


class RobotInfo(BaseModel):
    """A robot that a setup can name."""

    name: str = Field(examples=["kuka-kr16-l6-2"])
    title: str = Field(examples=["KUKA KR 16 L6-2"])
    reach_mm: float
    """Largest distance of the wrist centre from axis 1, arm stretched."""


class Pair(Body):
    """A point of the CAD and the place where the robot touched it."""

    cad: Point
    """In CAD coordinates."""
    touched: Point
    """In `$WORLD`, as the pendant shows it with BASE 0."""


class BaseFitRequest(Body):
    """Pairs of CAD point and touched point."""

    pairs: Annotated[list[Pair], Field(max_length=MAX_PAIRS)] = Field(
        examples=[
            [
                {"cad": {"x_mm": x, "y_mm": y, "z_mm": 10.0}, "touched": {"x_mm": 900.0 + x, "y_mm": y, "z_mm": 410.0}}
                for x, y in ((0.0, 0.0), (150.0, 0.0), (0.0, 100.0))
            ]
        ]
    )
    placement: Pose | None = None
    """Place of the CAD origin in BASE, `T_base_partnom`; null: as the setup in force says."""


class FittedPair(BaseModel):
    """How well one pair agrees."""

    residual_mm: float
    """Distance between the touched point and its CAD point in the fitted BASE."""
    left_out_mm: float | None
    """The same when this pair is left out of the fit; null for three pairs."""


class FittedBase(BaseModel):
    """The nominal BASE, `T_world_base`; nothing is put in force."""

    base: Pose
    pairs: list[FittedPair]
    rms_mm: float
    sigma_mm: float
    """Standard deviation of one coordinate of one touch that these residuals speak for."""
    issues: list[dict[str, str]]


@router.get("/robots", responses=documented())
def list_robots() -> list[RobotInfo]:
    """Return the robots that `setup.json` can name."""
    robots = (load_robot(name) for name in robot_names())
    return [RobotInfo(name=r.name, title=r.file.title, reach_mm=round(r.reach_mm, 1)) for r in robots]


@router.post("/projects/{project_id}/base-fit", responses=documented(404))
def fit(ctx: Ctx, project_id: ProjectId, body: BaseFitRequest) -> FittedBase:
    """Fit the nominal BASE to three or more pairs of CAD point and touched point. Put it in the setup to use it."""
    with ctx.store.db.read() as session:
        projects.get(session, project_id)
        setup = inputs.setup_in(session, project_id)
    placement = setup.placement if body.placement is None else body.placement
    cad = np.array([_xyz(p.cad) for p in body.pairs]).reshape(-1, 3)
    touched = np.array([_xyz(p.touched) for p in body.pairs]).reshape(-1, 3)
    made = fit_base(cad, touched, placement.transform("base", "partnom"))
    left_out = made.left_out_mm if len(cad) > MIN_PAIRS else np.full(len(cad), np.nan)
    return FittedBase(
        base=Pose.of(made.T_world_base),
        pairs=[
            FittedPair(residual_mm=float(r), left_out_mm=float(o) if np.isfinite(o) else None)
            for r, o in zip(made.residuals_mm, left_out, strict=True)
        ],
        rms_mm=made.rms_mm,
        sigma_mm=made.sigma_mm,
        issues=[dict(issue.to_json()) for issue in made.issues],
    )


def _xyz(point: Point) -> tuple[float, float, float]:
    return point.x_mm, point.y_mm, point.z_mm
