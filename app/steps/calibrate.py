"""A calibration with its report: what the command and the page call."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from alignment.calibrate import Calibration, calibrate
from alignment.calibrate.result import Kind, Target
from planner.setup import Setup

if TYPE_CHECKING:
    from app.report.package import Report


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """What was found, from which files (name, SHA-256), in a cell believed to be `setup`."""

    found: Calibration
    setup: Setup
    inputs: tuple[tuple[str, str], ...]

    @cached_property
    def report(self) -> "Report":
        """The same as a report, with its drawing."""
        from app.report.calibration import calibration_report  # noqa: PLC0415 - drawing is slow to import

        return calibration_report(self.found, self.setup, self.inputs)

    @property
    def content(self) -> dict[str, Any]:
        """What the command prints as JSON."""
        return {"ok": self.found.observable, **self.found.to_json()}

    @property
    def figure_svg(self) -> str:
        """The drawing."""
        return self.report.figures[self.found.kind]


def run_calibration(
    kind: Kind,
    files: Sequence[Path],
    setup: Setup,
    target: Target = "plane",
    radius_mm: float | None = None,
    names: Sequence[str] | None = None,
) -> CalibrationResult:
    """Return the calibration of files; names: what people call them. Raises EchoBaseError."""
    labels = [path.name for path in files] if names is None else list(names)
    found = calibrate(kind, list(files), setup, target, radius_mm, labels)
    return CalibrationResult(found, setup, tuple(zip(labels, map(_sha256, files), strict=True)))


def in_child(folder: Path, options: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Calibrate inside `planner.sandbox.run_limited`: no arrays, and what the REST route answers.

    folder holds `options["files"]`, called `options["names"]`; kind, setup, target and radius_mm as for `run_calibration`.
    """
    setup = Setup.model_validate(options["setup"])
    paths = [folder / file for file in options["files"]]
    made = run_calibration(options["kind"], paths, setup, options["target"], options["radius_mm"], options["names"])
    inputs = [{"name": name, "sha256": sha256} for name, sha256 in made.inputs]
    report = made.report.html().decode()
    return {}, {**made.content, "inputs": inputs, "figure_svg": made.figure_svg, "report_html": report}


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
