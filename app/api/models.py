"""What the routes take and give, with an example each. Files that DESIGN fixes (setup, key points) are not wrapped."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from planner.setup import Mm, Pose


class Body(BaseModel):
    """A request body: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)


class Answer(BaseModel):
    """An answer."""

    model_config = ConfigDict(use_attribute_docstrings=True, from_attributes=True)


class NewProject(Body):
    """A project to make."""

    name: str = Field(examples=["Skin panel 7"])
    sample: Literal["aerofoil", "flat-plate"] | None = None
    """Start with a sample part and its cell."""


class ProjectChange(Body):
    """What can be changed of a project."""

    name: str = Field(examples=["Skin panel 7, left"])


class Project(Answer):
    """A project."""

    id: str = Field(examples=["5f1c0a9b2d3e4f5a6b7c"])
    name: str = Field(examples=["Skin panel 7"])
    version: int
    """Counts the changes of the project itself; its ETag."""
    created: str = Field(examples=["2026-03-01T08:00:00.000Z"])
    changed: str = Field(examples=["2026-03-01T09:30:00.000Z"])


class PartInfo(Answer):
    """The part in force, or what is known of it."""

    version: int
    name: str = Field(examples=["panel.step"])
    unit: str = Field(examples=["mm"])
    sha256: str
    """Of the file as uploaded."""
    bytes: int
    triangles: int
    extents_mm: list[float] = Field(examples=[[150.0, 100.0, 10.0]])
    centre_mm: list[float] | None = Field(None, examples=[[75.0, 50.0, 0.0]])
    """Middle of its bounds in CAD coordinates."""
    size_if: dict[str, list[float]]
    """Its size in mm if the numbers of the file were meant in each unit: a check of the unit."""
    chord_error_mm: float | None
    """Estimated distance of the triangles from the true surface; null if unknown."""
    notes: list[str]


class Point(Body):
    """A point in CAD coordinates (mm)."""

    x_mm: Mm
    y_mm: Mm
    z_mm: Mm


class Surface(Body):
    """How the inspection surface is chosen: flooded from these points to the creases; none: the largest one."""

    seeds: list[Point] = Field(default=[], max_length=64)


Share = Annotated[float, Field(ge=0.0, lt=1.0)]


class Rehearsal(Body):
    """A run on the simulated scanner: where the real part hides, and what goes wrong on the way."""

    offset: Pose = Pose()
    """Hidden `T_base_basecorr`."""
    spring_back_mm: float = Field(0.0, ge=-100.0, le=100.0)
    """Largest displacement of the surface along its normal."""
    seed: int = Field(0, ge=0, le=2**31 - 1)
    path: Literal["alignment", "inspection", "corrected"] = "alignment"
    outliers: Share = 0.0
    dropouts: Share = 0.0
    latency_ms: float = Field(0.0, ge=-1000.0, le=1000.0)


Which = Annotated[int, Field(ge=1)]


def _once(numbers: list[int] | None) -> list[int] | None:
    if numbers is not None and len(set(numbers)) != len(numbers):
        raise ValueError("a scan is named twice")
    return numbers


class OtherPlan(Body):
    """Another project of the same part whose scans are aligned together with this one's."""

    project: str = Field(max_length=40, examples=["5f1c0a9b2d3e4f5a6b7c"])
    scans: Annotated[list[Which] | None, AfterValidator(_once)] = Field(None, min_length=1, max_length=64)
    """Numbers of its scans; null: the newest one of its alignment path."""


class AlignmentRequest(Body):
    """How to align."""

    scans: Annotated[list[int] | None, AfterValidator(_once)] = Field(None, min_length=1, max_length=64)
    """Numbers of the scans; null: the newest one of the alignment path."""
    method: Literal["map", "keypoints"] = "map"
    edges: bool | None = None
    """Null: wherever the scan crosses them."""
    non_rigid: bool = False
    base: Literal["nominal", "corrected"] | None = None
    """BASE that was active, for files that cannot say; null: as said with the upload."""
    together: list[OtherPlan] = Field([], max_length=15)
    """Other projects of this part, each with its own surface and scans: all scans together determine one correction, which
    every one of the projects gets as its newest alignment."""


class Acceptance(Body):
    """Who takes a result over, and why."""

    name: str = Field(examples=["A. Inspector"])
    reason: str = Field(examples=["Root-side residual explained by the known form error; confirmed with the gauge."])


class AssessmentRequest(Body):
    """Which inspection scan to judge. Passes may be split over several scans."""

    scan: int | None = Field(None, ge=1)
    """Number of the inspection scan; null: the newest."""
    scans: Annotated[list[Which] | None, AfterValidator(_once)] = Field(None, min_length=1, max_length=64)
    """Instead of `scan`: all scans that make up the inspection."""
    before: Which | Annotated[list[Which], AfterValidator(_once), Field(max_length=64)] | None = None
    """Number or numbers of the one from before the correction."""
    base: Literal["nominal", "corrected"] | None = None
    """BASE that was active, for files that cannot say; null: as said with the upload."""
    before_base: Literal["nominal", "corrected"] | None = None
    """The same for the scans from before."""

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if self.scan is not None and self.scans is not None:
            raise ValueError("give scan or scans, not both")
        return self

    def numbers(self) -> list[int] | None:
        """Return the scans of the inspection; None: the newest."""
        return self.scans if self.scans is not None else None if self.scan is None else [self.scan]

    def before_numbers(self) -> list[int]:
        """Return the scans from before."""
        return [self.before] if isinstance(self.before, int) else list(self.before or ())


class Scan(Answer):
    """A scan."""

    number: int
    origin: Literal["uploaded", "simulated"]
    base: str | None
    """BASE that was active, where the file cannot say."""
    path: str | None
    """Path it was taken on, if known."""
    files: list[dict[str, Any]] = Field(examples=[[{"name": "scan.csv", "bytes": 1048576, "sha256": "…"}]])
    detail: dict[str, Any]
    created: str


class Job(Answer):
    """A piece of slow work."""

    id: str
    project_id: str
    kind: Literal["plan", "suggest", "simulate", "alignment", "assessment"]
    state: Literal["queued", "running", "done", "failed", "cancelled"]
    fraction: float
    text: str
    result: dict[str, Any] | None
    """What it made, as `{"number": n}`."""
    issues: list[dict[str, Any]]
    error: dict[str, Any] | None = None
    """For a failed job, the same as in an error answer."""
    created: str
    changed: str


class PlanInfo(BaseModel):
    """plan.json, whether it is still of the inputs in force, and which programs can be had."""

    model_config = ConfigDict(extra="allow")
    number: int
    verdict: str
    stale: bool
    stale_because: list[str]
    programs: dict[str, Any]
    created: str


class AlignmentInfo(BaseModel):
    """correction.json, whether it is still of the inputs in force, and whether its program can be had."""

    model_config = ConfigDict(extra="allow")
    number: int
    verdict: Literal["pass", "partial", "fail"]
    stale: bool
    stale_because: list[str]
    accepted: dict[str, Any] | None
    program: dict[str, Any]
    created: str
