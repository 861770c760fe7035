"""`Record`: what only people know of an inspection: who, by which procedure, with which equipment, at which temperatures.

Every field is optional; what is empty prints as a blank to be filled in by hand. What EchoBase knows itself (CAD, probe,
laws, speeds, shares, hashes) is not asked for: the report computes it.
"""

from datetime import date, datetime
from typing import Annotated

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

Words = Annotated[str, Field(max_length=200)]
Celsius = Annotated[float | None, Field(ge=0.0, le=95.0)]
Db = Annotated[float | None, Field(ge=-120.0, le=120.0)]


class _Group(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, allow_inf_nan=False)


class PartRecord(_Group):
    """Which piece was inspected."""

    number: Words = ""
    """Part number."""
    serial: Words = ""
    """Serial number."""
    drawing: Words = ""
    """Drawing and its issue."""
    material: Words = ""
    thickness: Words = ""
    """Thickness or its range, with the unit."""
    curing_lot: Words = ""


class ProcedureRecord(_Group):
    """By which rules."""

    document: Words = ""
    """Procedure and its revision."""
    standard: Words = ""
    acceptance: Words = ""
    """Acceptance criteria."""


class EquipmentRecord(_Group):
    """With which equipment."""

    instrument: Words = ""
    """Ultrasonic set: maker and model."""
    instrument_serial: Words = ""
    instrument_due: date | None = None
    """Calibration due."""
    probe: Words = ""
    """Probe: maker and model."""
    probe_serial: Words = ""
    nozzle: Words = ""
    cable: Words = ""
    robot_serial: Words = ""
    controller_version: Words = ""
    """KUKA System Software."""


class SettingsRecord(_Group):
    """How the ultrasonic set was set."""

    law_file: Words = ""
    """Law file, with its hash if there is one."""
    focus: Words = ""
    gain_db: Db = None
    prf_hz: float | None = Field(None, gt=0.0, le=1e6)
    """Pulse repetition frequency."""
    filter: Words = ""
    averaging: Words = ""
    tcg: Words = ""
    """Time-corrected gain."""
    gates: Words = ""
    sampling_mhz: float | None = Field(None, gt=0.0, le=1e5)


class CouplantRecord(_Group):
    """The water."""

    additives: Words = ""
    temperature_start_c: Celsius = None
    temperature_end_c: Celsius = None
    flow: Words = ""


class CalibrationRecord(_Group):
    """What the readings rest on."""

    block: Words = ""
    """Reference block."""
    block_due: date | None = None
    """Calibration of the block due."""
    transfer_db: Db = None
    """Transfer correction."""
    sensitivity_before_db: Db = None
    """Check of the sensitivity before the scan."""
    sensitivity_after_db: Db = None
    """Check of the sensitivity after the scan."""
    tcp: Words = ""
    """Calibration of the TCP."""
    tcp_residual_mm: float | None = Field(None, ge=0.0, le=100.0)
    base: Words = ""
    """How the nominal BASE was found."""
    latency_ms: float | None = Field(None, ge=-1e4, le=1e4)
    """Delay of the poses behind the echoes."""


class PeopleRecord(_Group):
    """Who, and when."""

    operator: Words = ""
    operator_level: Words = ""
    """Qualification (EN 4179 / NAS 410)."""
    reviewer: Words = ""
    reviewer_level: Words = ""
    begun: AwareDatetime | None = None
    """Begin of the scan, with its time zone."""
    ended: AwareDatetime | None = None
    """End of the scan, with its time zone."""
    remarks: Annotated[str, Field(max_length=2000)] = ""


class Record(_Group):
    """`record.json`, whole."""

    part: PartRecord = PartRecord()
    procedure: ProcedureRecord = ProcedureRecord()
    equipment: EquipmentRecord = EquipmentRecord()
    settings: SettingsRecord = SettingsRecord()
    couplant: CouplantRecord = CouplantRecord()
    calibration: CalibrationRecord = CalibrationRecord()
    people: PeopleRecord = PeopleRecord()

    def text(self, place: str) -> str:
        """Return what stands at `group.field`, as text; empty if nothing does."""
        group, name = place.split(".")
        value = getattr(getattr(self, group), name)
        if value is None:
            return ""
        if isinstance(value, datetime):
            return value.isoformat(sep=" ", timespec="minutes")
        return f"{value:g}" if isinstance(value, float) else str(value).strip()
