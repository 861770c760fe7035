"""project.json of an archive: what may stand in it, and whether it agrees with itself."""

import json
from collections import defaultdict
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.report.record import Record
from app.store.content import digest_of, digest_of_files
from app.store.names import is_relative_name, shown_file_name
from app.store.refusal import refuse
from planner.keypoint import KeyPointList
from planner.setup import Setup

MAX_MEMBERS = 20_000
Sha = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Stamp = Annotated[str, Field(max_length=32)]
Count = Annotated[int, Field(ge=1, le=10**9)]
Owner = Annotated[str, Field(pattern=r"^(part|scan|plan|alignment|assessment|calibration):[0-9]{1,9}$")]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _ProjectPart(_Strict):
    id: str = Field(max_length=40)
    name: str = Field(max_length=400)
    created: Stamp


class _InputPart(_Strict):
    kind: Annotated[str, Field(pattern=r"^(part|setup|surface|keypoints|record(-a[ls]-[0-9]{1,6})?)$")]
    version: Count
    sha256: Sha
    content: str
    created: Stamp


class _ScanPart(_Strict):
    number: Count
    sha256: Sha
    origin: Literal["uploaded", "simulated"]
    base: Literal["nominal", "corrected"] | None
    path: Literal["alignment", "inspection", "corrected"] | None
    detail: dict[str, Any]
    created: Stamp


class _ResultPart(_Strict):
    kind: Literal["plan", "alignment", "assessment", "calibration"]
    number: Count
    sha256: Sha
    inputs: dict[str, Any]
    options: dict[str, Any]
    verdict: Literal["pass", "partial", "fail"]
    summary: dict[str, Any]
    accepted: dict[str, Any] | None
    created: Stamp


class FilePart(_Strict):
    owner: Owner
    name: str = Field(min_length=1, max_length=700)
    member: str = Field(min_length=1, max_length=1000)
    sha256: Sha
    size: int = Field(ge=0)


class _LinePart(_Strict):
    number: Count
    at: Stamp
    action: str = Field(max_length=40)
    detail: dict[str, Any]
    digest: Sha


class Manifest(_Strict):
    """project.json of an archive."""

    format: Literal[1]
    echobase: str = Field(max_length=100)
    exported: Stamp
    project: _ProjectPart
    inputs: list[_InputPart]
    scans: list[_ScanPart]
    results: list[_ResultPart]
    files: list[FilePart] = Field(max_length=MAX_MEMBERS)
    journal: list[_LinePart]
    digest: Sha


def check_consistent(manifest: Manifest) -> None:
    """Raise Refusal 422 unless every digest of the manifest follows from what it names and every content is legal."""
    files: dict[str, dict[str, str]] = defaultdict(dict)
    for entry in manifest.files:
        kind = entry.owner.split(":")[0]
        harmless = shown_file_name(entry.name) == entry.name if kind == "scan" else is_relative_name(entry.name)
        if not harmless or entry.name in files[entry.owner]:
            raise unusable("the archive names a file that EchoBase would not make.")
        files[entry.owner][entry.name] = entry.sha256
    for row in manifest.inputs:
        try:
            content = json.loads(row.content)
            sound = _input_digest(row, content, files) == row.sha256
        except (ValidationError, ValueError, KeyError, TypeError, RecursionError):
            sound = False
        if not sound:
            raise unusable(f"version {row.version} of the {row.kind} is not what its digest says.")
    for scan in manifest.scans:
        named = files[f"scan:{scan.number}"] | ({"base": scan.base} if scan.base else {})
        if digest_of_files(named) != scan.sha256:
            raise unusable(f"scan {scan.number} is not what its digest says.")
    for result in manifest.results:
        if digest_of_files(files[f"{result.kind}:{result.number}"]) != result.sha256:
            raise unusable(f"{result.kind} {result.number} is not what its digest says.")


def _input_digest(row: _InputPart, content: Any, files: dict[str, dict[str, str]]) -> str:
    if row.kind == "part":
        needed = {"name", "unit", "given_unit", "sha256", "bytes", "triangles", "extents_mm", "chord_error_mm", "notes"}
        if not needed <= set(content) <= needed | {"centre_mm"}:
            raise ValueError("not a part")
        return digest_of({"file": files[f"part:{row.version}"]["source"], "unit": content["unit"]})
    if row.kind == "setup":
        Setup.model_validate(content)
    elif row.kind.startswith("record"):
        Record.model_validate(content)
    elif row.kind == "keypoints":
        KeyPointList.validate_python(content)
    else:
        for seed in content["seeds"]:
            (float(seed[axis]) for axis in ("x_mm", "y_mm", "z_mm"))
    return digest_of(content)


def unusable(message: str) -> Exception:
    """Return the refusal of an archive."""
    return refuse(422, "archive-unusable", message, "Export the project again and import that file.", "file")
