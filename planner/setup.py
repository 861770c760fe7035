"""`Setup`: the cell and the procedure, as a person types them. One pydantic model; unit and bounds on every field.

Every field is optional and its default is the paper's cell. Unknown fields are refused.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from planner.frames import Frame, Transform
from planner.shapes import Box, Brush, KeepOut
from planner.strict import Deg, Mm, NonNegativeMm, PositiveMm, Real, Strict, Whole, Xyz

__all__ = [
    "Alignment",
    "Base",
    "Couplant",
    "Deg",
    "Dof",
    "Fixture",
    "Inspection",
    "Limits",
    "Mm",
    "NonNegativeMm",
    "Pose",
    "PositiveMm",
    "Probe",
    "Setup",
    "Signals",
    "Strict",
    "TiltLoss",
    "Tolerances",
    "Tool",
]

Dof = Literal["x", "y", "z", "a", "b", "c"]
# Fields that the page edits in the 3D view, not in the form of the cell.
_IN_VIEW = {"x-step": "surface"}


class Pose(Strict):
    """A frame as KUKA writes it: X Y Z in mm, A B C in degrees."""

    x_mm: Mm = 0.0
    y_mm: Mm = 0.0
    z_mm: Mm = 0.0
    a_deg: Deg = 0.0
    b_deg: Deg = 0.0
    c_deg: Deg = 0.0

    def xyzabc(self) -> tuple[float, float, float, float, float, float]:
        """Return X Y Z (mm) A B C (deg)."""
        return (self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.c_deg)

    def transform(self, dst: Frame, src: Frame) -> Transform:
        """Return the frame as `T_dst_src`."""
        return Transform.from_xyzabc(dst, src, self.xyzabc())

    @classmethod
    def of(cls, transform: Transform) -> Self:
        """Return the pose of a transform, unrounded."""
        x, y, z, a, b, c = (float(v) for v in transform.xyzabc)
        return cls(x_mm=x, y_mm=y, z_mm=z, a_deg=a, b_deg=b, c_deg=c)


class TiltLoss(Strict):
    """Quadratic amplitude loss k alpha^2 (dB, alpha in deg) per axis; fitted by a tilt calibration."""

    b: Real = Field(2.0, ge=0.0, le=100.0)
    """Loss per deg^2 for a turn B about the TCP y axis, which tilts the array axis (dB/deg^2)."""
    c: Real = Field(1.0, ge=0.0, le=100.0)
    """Loss per deg^2 for a turn C about the TCP x axis, the array axis (dB/deg^2)."""


class Probe(Strict):
    """The ultrasonic probe: a linear array, or a single crystal (`elements` 1)."""

    elements: Whole = Field(64, ge=1, le=4096)
    """Number of elements."""
    pitch_mm: Real = Field(0.6, gt=0.0, le=50.0)
    """Element pitch (mm)."""
    aperture_elements: Whole = Field(15, ge=1, le=4096)
    """Elements of one focal law's aperture."""
    frequency_mhz: Real = Field(5.0, gt=0.0, le=200.0)
    """Centre frequency (MHz)."""
    elevation_mm: Real = Field(9.0, gt=0.0, le=200.0)
    """Element length across the array (mm)."""
    beam_width_mm: Real = Field(3.0, gt=0.0, le=100.0)
    """-6 dB beam width at the standoff (mm)."""
    reversed: bool = False
    """Law 1 at the positive end of the array axis."""
    face_offset_mm: Real = Field(0.0, ge=-500.0, le=500.0)
    """How far the law origins lie behind the TCP along the beam (mm)."""
    tilt_loss_db_per_deg2: TiltLoss = TiltLoss()

    @model_validator(mode="after")
    def _aperture_fits(self) -> Self:
        if self.elements > 1 and self.aperture_elements > self.elements:
            raise ValueError("aperture_elements must not exceed elements")
        return self

    @property
    def laws(self) -> int:
        """Number of focal laws: elements - aperture + 1, or 1 for a single crystal."""
        return 1 if self.elements == 1 else self.elements - self.aperture_elements + 1

    @property
    def swath_mm(self) -> float:
        """Width swept by one pass (mm): laws x pitch; the beam width for a single crystal."""
        return self.beam_width_mm if self.elements == 1 else self.laws * self.pitch_mm


class Couplant(Strict):
    """Water (or what carries the sound) between probe and part."""

    temperature_c: Real = Field(20.0, ge=0.0, le=95.0)
    """Couplant temperature (deg C)."""
    sound_speed_m_s: Real | None = Field(None, ge=300.0, le=7000.0)
    """Measured speed of sound (m/s); null: of pure water at the temperature (Marczak 1997)."""
    delay_us: Real = Field(0.0, ge=-1000.0, le=1000.0)
    """Constant two-way delay to subtract from every time of flight (us)."""


class Signals(Strict):
    """Digital signals between robot and acquisition."""

    data_output: Whole | None = Field(1, ge=1, le=8192)
    """$OUT that is TRUE while data are taken; null: none."""
    wait_input: Whole | None = Field(None, ge=1, le=8192)
    """$IN to wait for before each pass; null: none."""


class Tool(Strict):
    """The tool as taught on the controller, and the envelope of its nozzle."""

    number: Whole = Field(1, ge=1, le=32)
    """TOOL_DATA index."""
    beam_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = "z"
    """Axis of the taught tool along which the beam leaves."""
    array_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = "x"
    """Axis of the taught tool along which the array lies."""
    nozzle_radius_mm: NonNegativeMm = 20.0
    nozzle_length_mm: NonNegativeMm = 120.0
    tcp: Pose = Pose()
    """T_flange_tcp: the numbers of TOOL_DATA[number]."""

    @model_validator(mode="after")
    def _axes_differ(self) -> Self:
        if self.beam_axis[-1] == self.array_axis[-1]:
            raise ValueError("beam_axis and array_axis must be different axes")
        return self


class Base(Pose):
    """Nominal $BASE: T_world_base, the numbers of BASE_DATA[number]. All zeros: an untaught base."""

    number: Whole = Field(1, ge=1, le=32)
    """BASE_DATA index."""
    corrected_number: Whole | None = Field(None, ge=1, le=32)
    """BASE_DATA index of the corrected base; null: the same."""

    @property
    def is_taught(self) -> bool:
        """True unless all six numbers are zero."""
        return any(v != 0.0 for v in self.xyzabc())


class Fixture(Strict):
    """Prior of the part's placement: independent normal deviations per axis of base, about the surface centroid."""

    sigma_mm: Real = Field(2.0, gt=0.0, le=1000.0)
    """Standard deviation of each displacement (mm)."""
    sigma_deg: Real = Field(0.5, gt=0.0, le=45.0)
    """Standard deviation of each rotation (deg)."""


class Tolerances(Strict):
    """What the inspection procedure accepts."""

    tilt_deg: Real = Field(1.0, gt=0.0, le=45.0)
    """Largest angle between beam and surface normal (deg)."""
    loss_db: Real = Field(2.0, gt=0.0, le=60.0)
    """Largest amplitude change from the reference (dB)."""
    standoff_mm: Real = Field(1.5, gt=0.0, le=100.0)
    """Largest standoff error (mm)."""
    position_mm: Real = Field(0.1, gt=0.0, le=100.0)
    """One-sigma motion of the surface up to which a direction counts as measured (mm)."""
    angle_deg: Real = Field(0.05, gt=0.0, le=45.0)
    """One-sigma turn of the surface up to which a direction counts as measured (deg)."""


class Alignment(Strict):
    """The alignment scan and its evaluation."""

    coverage: Real = Field(0.25, gt=0.0, le=1.0)
    """Share of the inspection surface that a suggested alignment scan covers."""
    standoff_mm: Real | None = Field(None, gt=0.0, le=1000.0)
    """Standoff of the alignment scan (mm); null: the inspection's."""
    scan_speed_mm_s: Real = Field(50.0, gt=0.0, le=2000.0)
    edges: bool = True
    """Let the alignment scan cross free edges."""
    edge_overrun_mm: Real = Field(8.0, ge=0.0, le=200.0)
    """How far the alignment scan runs past a free edge (mm)."""
    point_model: Literal["perpendicular", "axial"] = "perpendicular"
    """Where an echo puts its point: along the surface normal, or along the beam."""
    search_radius_mm: PositiveMm = 10.0
    """Radius around a key point in which readings are used (mm)."""
    min_amplitude_pct: Real = Field(20.0, ge=0.0, le=1000.0)
    """Key points whose mean amplitude is below this are rejected (%FSH)."""
    min_normal_dot: Real = Field(0.98, ge=0.0, le=1.0)
    """Key points whose fitted plane turns from the CAD normal by more than its arc cosine are rejected."""
    lock: tuple[Dof, ...] = ()
    """Degrees of freedom to keep at their nominal value."""


class Inspection(Strict):
    """The inspection raster."""

    strategy: Literal["geodesic", "plane"] = "geodesic"
    """How passes are laid: iso-lines of geodesic distance, or parallel planes."""
    direction: Literal["extent", "lowest_curvature", "drawn"] = "extent"
    """What the passes run along: the longest extent, the direction in which the surface bends least, or `guide`."""
    direction_deg: Deg = 0.0
    """Turn of the passes about the mean normal, from `direction` (deg)."""
    guide: Annotated[tuple[Xyz, ...], Field(max_length=200, json_schema_extra=_IN_VIEW)] = ()
    """Points of a line drawn on the surface (part, mm), for direction `drawn`: at least two."""
    step_mm: Real | None = Field(None, gt=0.0, le=1000.0)
    """Index step between passes (mm); null: (1 - overlap) x effective swath."""
    overlap: Real = Field(0.25, ge=0.0, lt=1.0)
    """Overlap of neighbouring passes as a share of the swath."""
    edge_margin_mm: NonNegativeMm = 5.0
    """Distance kept from the edges (mm, along the surface)."""
    point_spacing_mm: Real = Field(2.0, gt=0.0, le=100.0)
    """Acquisition spacing along a pass (mm)."""
    scan_speed_mm_s: Real = Field(100.0, gt=0.0, le=2000.0)
    box: Annotated[Box | None, Field(json_schema_extra=_IN_VIEW)] = None
    """Only what of the inspection surface lies inside this box (part, mm) is inspected."""
    paint: Annotated[tuple[Brush, ...], Field(max_length=500, json_schema_extra=_IN_VIEW)] = ()
    """Only what of the inspection surface is painted is inspected; in order, later dabs over earlier ones."""
    keep_outs: Annotated[tuple[KeepOut, ...], Field(max_length=500, json_schema_extra=_IN_VIEW)] = ()
    """Regions where no data are taken: fasteners, brackets, clamps."""

    @model_validator(mode="after")
    def _drawn_needs_a_line(self) -> Self:
        if self.direction == "drawn" and len(self.guide) < 2:
            raise ValueError("inspection.guide needs at least two points for direction drawn")
        return self


class Limits(Strict):
    """Largest correction that is ever exported: displacement of the surface centroid and total rotation."""

    correction_mm: Real = Field(15.0, gt=0.0, le=1000.0)
    correction_deg: Real = Field(3.5, gt=0.0, le=45.0)


class Setup(Strict):
    """`setup.json`, whole."""

    probe: Probe = Probe()
    couplant: Couplant = Couplant()
    standoff_mm: Real = Field(15.0, gt=0.0, le=1000.0)
    """Distance from the TCP to the surface along its normal (mm)."""
    reference_amplitude_pct: Real = Field(50.0, gt=0.0, le=1000.0)
    """Front-wall amplitude on a flat, well-aligned section (%FSH)."""
    signals: Signals = Signals()
    tool: Tool = Tool()
    base: Base = Base()
    placement: Pose = Pose()
    """T_base_partnom: where the program believes the CAD origin is, in base."""
    robot: str = Field("kuka-kr16-l6-2", pattern=r"^[a-z0-9][a-z0-9-]{0,63}$")
    """Name of a robot data file."""
    robot_root: Pose = Pose()
    """T_world_robroot."""
    controller: Literal["krc2", "krc4", "krc5"] = "krc4"
    program_name: str | None = Field(None, pattern=r"^[A-Z][A-Z0-9_]{0,12}$")
    """What the KRL programs are called, before `_AL` and `_IN`; null: from the part and the surface inspected."""
    fixture: Fixture = Fixture()
    tolerances: Tolerances = Tolerances()
    alignment: Alignment = Alignment()
    inspection: Inspection = Inspection()
    limits: Limits = Limits()

    @model_validator(mode="after")
    def _single_crystal_needs_a_step(self) -> Self:
        if self.probe.elements == 1 and self.inspection.step_mm is None:
            raise ValueError("inspection.step_mm is required for a single crystal (probe.elements 1)")
        return self

    @property
    def alignment_standoff_mm(self) -> float:
        """Standoff of the alignment scan (mm)."""
        given = self.alignment.standoff_mm
        return self.standoff_mm if given is None else given

    @property
    def T_world_base(self) -> Transform:
        """Nominal $BASE in world."""
        return self.base.transform("world", "base")

    @property
    def T_base_partnom(self) -> Transform:
        """CAD coordinates where the program believes the part is."""
        return self.placement.transform("base", "partnom")
