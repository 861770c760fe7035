"""What the routes of calibrations give."""

from typing import Any, Literal

from pydantic import Field

from app.api.errors import IssueBody
from app.api.models import Answer
from app.store.calibrations import Applied
from app.store.tables import ResultRow

Kind = Literal["tilt", "couplant", "tcp"]
Target = Literal["plane", "sphere"]


class CalibratedValue(Answer):
    """One value; null where a number is not known."""

    value: float | None
    sigma: float | None
    half_95: float | None
    """Half width of its 95 % interval."""
    unit: str
    status: Literal["measured", "weak", "held"]


class CalibrationInput(Answer):
    """One file as it came."""

    name: str
    sha256: str


class CalibrationInfo(Answer):
    """A calibration: what `echobase calibrate --json` prints, what it was made from, and whether it is in force."""

    number: int
    name: str = Field(examples=["tilt.csv"])
    """The names of its files."""
    ok: bool
    """At least one value is not held."""
    kind: Kind
    options: dict[str, Any] = Field(examples=[{"kind": "tcp", "target": "sphere", "radius_mm": 20.0}])
    estimates: dict[str, CalibratedValue]
    patch: dict[str, Any] = Field(examples=[{"probe": {"tilt_loss_db_per_deg2": {"b": 2.011, "c": 1.003}}}])
    """Fields of the setup to change; merge it and `PUT setup` with `If-Match`."""
    readings: int
    residual_rms: float
    residual_unit: str
    simulated: bool
    """The file says that no transducer took it; false where a file cannot say."""
    issues: list[IssueBody]
    inputs: list[CalibrationInput]
    setup_version: int
    """The version of the setup it was computed with; the patch is of that one (its ETag)."""
    current: bool
    """The setup in force is the one it was computed with, so that the patch may be merged into it."""
    applied: Applied
    """Whether the patch is in force: now; earlier, in a version since; never; nothing: it changes nothing."""
    report: str = Field(examples=["/api/v1/projects/5f1c0a9b2d3e4f5a6b7c/calibrations/1/report"])
    created: str


def calibration_info(row: ResultRow, applied: Applied, setup_sha256: str) -> CalibrationInfo:
    """Return what is known of a calibration; setup_sha256: of the setup in force."""
    made_from = row.inputs
    return CalibrationInfo(
        **row.summary,
        number=row.number,
        name=" + ".join(file["name"] for file in made_from["files"]),
        options=row.options,
        inputs=made_from["files"],
        setup_version=made_from["setup_version"],
        current=made_from["setup"] == setup_sha256,
        applied=applied,
        report=f"/api/v1/projects/{row.project_id}/calibrations/{row.number}/report",
        created=row.created,
    )
