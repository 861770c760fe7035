"""What a page may ask of the 3D view, and what it hears back."""

from typing import Annotated, Any, Literal

from pydantic import Field

from planner.setup import Strict

StepName = Literal["part", "cell", "surface", "keypoints", "paths", "programs", "scan", "alignment", "report"]
CameraName = Literal["iso", "front", "back", "left", "right", "top", "bottom", "surface"]
PickName = Literal["none", "keypoints", "surface", "paint", "erase", "keepout", "guide"]


class ProbeAt(Strict):
    """Put the probe somewhere on a path."""

    path: Literal["alignment", "inspection", "corrected"] = "alignment"
    at: float = Field(0.0, ge=0.0, le=1.0)
    """Share of the poses of the path, 0 at its start."""


class ViewCommand(Strict):
    """One request of a page; every field is optional and does one thing."""

    client: int | None = None
    """Number of the browser's own 3D view, so that only it changes; null: every view of the project."""
    step: StepName | None = None
    """Show what a step is about."""
    layers: dict[Annotated[str, Field(max_length=32)], bool] | None = None
    """Switch layers on or off."""
    camera: CameraName | None = None
    """Go to a standard view."""
    focus: Annotated[str, Field(max_length=32)] | None = None
    """Look at a key point."""
    pick: PickName | None = None
    """What a click in the view does."""
    brush_mm: float | None = Field(None, gt=0.0, le=10_000.0)
    """Radius of what a click paints, erases or keeps out, mm."""
    may_cross: bool | None = None
    """Whether the tool may pass over what a click keeps out."""
    scan_by: Literal["standoff", "amplitude"] | None = None
    """Quantity that colours the scan points."""
    probe: ProbeAt | None = None
    delete: Annotated[str, Field(max_length=32)] | None = None
    """Delete a key point."""
    clear: bool = False
    """Delete all key points."""
    undo: bool = False
    redo: bool = False
    who: Annotated[str, Field(max_length=80)] = ""
    """Name of the person, for the journal."""


class ViewState(Strict):
    """What one browser's view shows."""

    client: int | None = None
    step: str = "part"
    layers: dict[str, bool] = Field(default_factory=dict)
    titles: dict[str, str] = Field(default_factory=dict)
    pick: str = "none"
    legend: dict[str, Any] | None = None
    probe: dict[str, Any] | None = None
    undo: int = 0
    redo: int = 0
    keypoints: int = 0
    version: int = 0
    clients: int = 0
    insight: dict[str, Any] | None = None
    """What the key points of now are worth, as in the event `insight`; null while it is computed."""
    pick_ms: float | None = None
    """Time the server took for the last pick, ms."""
