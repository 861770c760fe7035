"""Base of every settings model, and numbers with their bounds."""

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field


def _number(value: Any) -> Any:
    if isinstance(value, bool | str):
        raise ValueError("a number is needed, without quotes")
    return value


Real = Annotated[float, BeforeValidator(_number)]
"""A number. `true` and "15" are none."""
Whole = Annotated[int, BeforeValidator(_number)]
Mm = Annotated[Real, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Deg = Annotated[Real, Field(ge=-360.0, le=360.0, allow_inf_nan=False)]
PositiveMm = Annotated[Real, Field(gt=0.0, le=1e5, allow_inf_nan=False)]
NonNegativeMm = Annotated[Real, Field(ge=0.0, le=1e5, allow_inf_nan=False)]
Xyz = tuple[Mm, Mm, Mm]
"""A point in `part`, mm."""


class Strict(BaseModel):
    """Base of every settings model: frozen, and an unknown field is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, allow_inf_nan=False)
