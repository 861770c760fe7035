"""Base of every settings model, and numbers with their bounds."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Mm = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Deg = Annotated[float, Field(ge=-360.0, le=360.0, allow_inf_nan=False)]
PositiveMm = Annotated[float, Field(gt=0.0, le=1e5, allow_inf_nan=False)]
NonNegativeMm = Annotated[float, Field(ge=0.0, le=1e5, allow_inf_nan=False)]
Xyz = tuple[Mm, Mm, Mm]
"""A point in `part`, mm."""


class Strict(BaseModel):
    """Base of every settings model: frozen, and an unknown field is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, allow_inf_nan=False)
