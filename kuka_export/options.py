"""`ProgramOptions`: how a program moves and signals, where the setup leaves a choice."""

from typing import Annotated, Literal

from pydantic import Field

from planner.setup import Strict

Speed = Annotated[float, Field(gt=0.0)]


class ProgramOptions(Strict):
    """Settings of an export. None means: as the controller's profile says."""

    motion: Literal["lin", "spline"] | None = None
    """Scan passes as straight lines with blending, or as spline blocks."""
    signal: Literal["trigger", "pulse", "none"] = "trigger"
    """Data signal: $OUT on and off, a pulse at both ends, or comments only."""
    pulse_s: float = Field(0.1, ge=0.012, le=3.0)
    """Length of a pulse (s)."""
    approach_speed_mm_s: Speed = 100.0
    """Speed of approach, lead-in from above and retract (mm/s)."""
    link_speed_mm_s: Speed = 250.0
    """Speed between passes (mm/s)."""
    scan_speed_mm_s: Speed | None = None
    """Speed while taking data (mm/s); None: the setup's."""
    acceleration_m_s2: float = Field(0.5, gt=0.0, le=10.0)
    """$ACC.CP (m/s2)."""
    turning_speed_deg_s: float = Field(30.0, gt=0.0, le=400.0)
    """$VEL.ORI1 and $VEL.ORI2 (deg/s)."""
    turning_acceleration_deg_s2: float = Field(100.0, gt=0.0, le=4000.0)
    """$ACC.ORI1 and $ACC.ORI2 (deg/s2)."""
    blend_mm: float = Field(1.0, ge=0.0, le=50.0)
    """Largest $APO.CDIS (mm); never more than half the closest spacing."""
    orientation: Literal["VAR", "CONSTANT", "JOINT"] = "VAR"
    """$ORI_TYPE."""
    advance: int | None = Field(None, ge=1, le=5)
    """$ADVANCE."""
    home: bool = False
    """XHOME first and last. An untaught base starts there in any case."""
    adapted: bool = False
    """The poses themselves were adapted (non-rigid): the motion modules get names of their own."""
    segments: int | None = Field(None, ge=4, le=4096)
    """Segments per spline block."""
    module_lines: int | None = Field(None, ge=50, le=100_000)
    """Lines per module."""
    load_modules: int | None = Field(None, ge=3, le=999)
    """Modules in memory at once."""
    load_bytes: int | None = Field(None, ge=20_000, le=100_000_000)
    """Bytes in memory at once."""
    operator: str = ""
    """Who exports; a comment in the main module."""
    date: str = ""
    """Date of export; a comment in the main module."""


DEFAULT_OPTIONS = ProgramOptions()
