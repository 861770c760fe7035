"""A calibration with its report: what the command and the page call."""

import base64
import hashlib
import json
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
    def artifacts(self) -> dict[str, bytes]:
        """What is kept of it: the numbers, the patch of setup.json, the report, as files of a folder `calibration`."""
        texts = {"calibration.json": self.content, "patch.json": self.found.patch}
        named = {f"calibration/{name}": patch_text(content).encode() for name, content in texts.items()}
        return named | self.report.files("calibration")


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
    """Calibrate inside `planner.sandbox.run_limited`: no arrays; the answer, and its files as base64.

    folder holds `options["files"]`, called `options["names"]`; kind, setup, target and radius_mm as for `run_calibration`.
    """
    setup = Setup.model_validate(options["setup"])
    paths = [folder / file for file in options["files"]]
    made = run_calibration(options["kind"], paths, setup, options["target"], options["radius_mm"], options["names"])
    files = {name: base64.b64encode(content).decode() for name, content in made.artifacts.items()}
    return {}, {**made.content, "simulated": made.found.simulated, "files": files}


def patch_text(content: dict[str, Any]) -> str:
    """Return a patch of setup.json as its file holds it."""
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
