"""Programs of a plan: their names, their export, and reading them back from a folder."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from app.plan import Artifacts, Plan
from kuka_export.check import check_files
from kuka_export.dense import dense_csv
from kuka_export.export import export
from kuka_export.names import program_stem
from kuka_export.options import DEFAULT_OPTIONS, ProgramOptions
from kuka_export.reader import KrlReading, read_program
from kuka_export.runsheet import run_sheet_html, run_sheet_text
from planner.errors import fail
from planner.frames import Transform
from planner.issues import Issue
from planner.setup import Setup
from planner.toolpath import ToolPath

FOLDER = {"alignment": "alignment", "inspection": "inspection", "corrected": "corrected"}


@dataclass(frozen=True)
class ExportedProgram:
    """The files of one program under its folder name, what the manifest says of them, and what there is to say."""

    files: Artifacts
    manifest: dict[str, Any]
    issues: tuple[Issue, ...]


def program_name(plan: Plan, kind: str) -> str:
    """Return the stem of a program's modules: of the setup, or different for different parts and surfaces.

    The corrected program keeps the name that the inspection of the plan was written under, for it calls the same modules.
    """
    if kind == "corrected":
        written = (plan.summary.get("inspection") or {}).get("program") or {}
        if isinstance(written.get("program"), str):
            return str(written["program"])
    ending = {"alignment": "AL", "inspection": "IN", "corrected": "IN"}[kind]
    surface, origin = plan.surface, plan.part.provenance
    place = " ".join(f"{v:.2f}" for v in (surface.area_mm2, *surface.centroid_part))
    return program_stem(Path(origin.name).stem, ending, f"{origin.sha256} {place}", plan.setup.program_name)


def export_path(
    plan: Plan,
    sent: ToolPath,
    dense: ToolPath,
    name: str,
    *,
    T_base_basecorr: Transform | None = None,
    notes: Sequence[str] = (),
    verdict: Literal["pass", "partial", "fail"] | None = None,
    acceptance: str = "",
    options: ProgramOptions = DEFAULT_OPTIONS,
) -> ExportedProgram:
    """Build, write and prove the program of a decimated path; raise EchoBaseError rather than hand out a faulty one.

    `dense` is the path before decimation, for the acquisition side. The files of a corrected program go to `corrected/`,
    the others to the folder of their kind: modules, manifest, dense poses and the run sheet.
    """
    setup = plan.setup
    done = export(
        sent,
        setup,
        name,
        plan.part.provenance.name,
        T_base_basecorr=T_base_basecorr,
        notes=notes,
        centroid_base_mm=setup.T_base_partnom.points(plan.surface.centroid_part),
        verdict=verdict,
        acceptance=acceptance,
        options=options,
    )
    extra = {
        "manifest.json": (json.dumps(done.manifest, indent=1, allow_nan=False) + "\n").encode(),
        "path.csv": dense_csv(dense, setup),
        "run_sheet.html": run_sheet_html(done.program, done.proof, setup).encode(),
        "run_sheet.txt": run_sheet_text(done.program, done.proof, setup).encode(),
    }
    folder = "corrected" if T_base_basecorr is not None else FOLDER[sent.kind]
    files = {f"{folder}/{file}": content for file, content in (done.files | extra).items()}
    return ExportedProgram(files, done.manifest, tuple(done.issues))


def findings(program: ExportedProgram) -> tuple[Issue, ...]:
    """Return what there is to say of a program's text as KRL, and of its export."""
    files = {PurePosixPath(n).name: content for n, content in program.files.items() if n.endswith((".src", ".dat"))}
    return (*program.issues, *check_files(files, program.manifest["controller"]))


def read_folder(folder: Path, kind: str) -> KrlReading:
    """Return what the program files in `folder/kind` make the robot do; raise EchoBaseError if there are none."""
    files = {p.name: p.read_bytes() for p in sorted((folder / FOLDER[kind]).glob("*")) if p.suffix in {".src", ".dat"}}
    if not files:
        needed = "echobase align" if kind == "corrected" else "echobase plan"
        raise fail("program-missing", f"'{folder}' holds no {kind} program.", f"Run `{needed}` first.", str(folder))
    return read_program(files)


def active_base(reading: KrlReading, setup: Setup) -> Transform:
    """Return the BASE a program runs in as `T_world_base`: what it assigns, or the controller's own with the offset composed.

    An untaught base is taken to be world, as everywhere else in the plan.
    """
    number = reading.base_number
    assigned = None if number is None else reading.base_data.get(number)
    T_world_base = Transform.from_xyzabc("world", "base", assigned) if assigned is not None else setup.T_world_base
    if reading.base_offset is None:
        return T_world_base
    return T_world_base @ Transform.from_xyzabc("base", "base", reading.base_offset)
