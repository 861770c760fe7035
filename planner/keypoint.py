"""`KeyPoint`: a place on the inspection surface where the alignment scan must pass."""

from typing import Annotated

from pydantic import Field, TypeAdapter

from planner.setup import Mm, Strict


class KeyPoint(Strict):
    """One key point in `part` coordinates; snapped to the surface by the planner."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,31}$")]
    """Name shown to people."""
    x_mm: Mm
    y_mm: Mm
    z_mm: Mm

    def xyz(self) -> tuple[float, float, float]:
        """Return the position in `part` (mm)."""
        return (self.x_mm, self.y_mm, self.z_mm)


KeyPointList = TypeAdapter(list[KeyPoint])
