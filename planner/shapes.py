"""Shapes in CAD coordinates that people give: keep-out regions, the box and the brush of the inspection surface."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from planner.strict import NonNegativeMm, PositiveMm, Real, Strict, Xyz

MOST_POINTS = 1000
MOST_FACES = 200_000


class Box(Strict):
    """A box along the axes of `part`."""

    min_mm: Xyz
    max_mm: Xyz

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        if not all(a < b for a, b in zip(self.min_mm, self.max_mm, strict=True)):
            raise ValueError("min_mm must be smaller than max_mm in x, y and z")
        return self


class Brush(Strict):
    """A dab of the brush: what lies inside the sphere is painted, or erased from what was painted before."""

    centre_mm: Xyz
    radius_mm: Real = Field(gt=0.0, le=10_000.0)
    erase: bool = False


class KeepOutBase(Strict):
    """What every keep-out region says: its name, the margin around it, and whether the tool may fly over it."""

    name: str = Field("", max_length=40)
    """What it is, for people."""
    margin_mm: NonNegativeMm = 3.0
    """Distance that the TCP keeps from it while data are taken (mm)."""
    may_cross: bool = True
    """The tool may pass over it (a fastener). False: nothing of the nozzle ever comes above it (a clamp)."""
    height_mm: PositiveMm | None = None
    """How high it stands above the surface (mm): nozzle and wrist keep clear of that, wherever they go; null: not known."""


class SphereKeepOut(KeepOutBase):
    """What of the surface lies inside a sphere."""

    type: Literal["sphere"]
    centre_mm: Xyz
    radius_mm: PositiveMm


class DiscKeepOut(KeepOutBase):
    """A disc on the surface about a point, along its normal: a fastener."""

    type: Literal["disc"]
    centre_mm: Xyz
    radius_mm: PositiveMm


class BoxKeepOut(KeepOutBase, Box):
    """What of the surface lies inside a box: a bracket."""

    type: Literal["box"]


class PolygonKeepOut(KeepOutBase):
    """What of the surface lies inside a polygon, seen along its normal."""

    type: Literal["polygon"]
    points_mm: Annotated[tuple[Xyz, ...], Field(min_length=3, max_length=MOST_POINTS)]
    """Corners in order, about in one plane."""
    depth_mm: PositiveMm = 20.0
    """How far off the plane of the polygon the surface may lie (mm)."""


class FacesKeepOut(KeepOutBase):
    """Triangles of the part: rows of the mesh as read, from 0."""

    type: Literal["faces"]
    faces: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1, max_length=MOST_FACES)]


KeepOut = Annotated[
    SphereKeepOut | DiscKeepOut | BoxKeepOut | PolygonKeepOut | FacesKeepOut, Field(discriminator="type")
]
"""A region where no data are taken."""

__all__ = [
    "Box",
    "BoxKeepOut",
    "Brush",
    "DiscKeepOut",
    "FacesKeepOut",
    "KeepOut",
    "KeepOutBase",
    "PolygonKeepOut",
    "SphereKeepOut",
]
