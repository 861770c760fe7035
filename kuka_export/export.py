"""Build, write, prove. A program with a fault is never handed out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from kuka_export.build import build_program
from kuka_export.check import check_files
from kuka_export.language.library import load
from kuka_export.options import DEFAULT_OPTIONS, ProgramOptions
from kuka_export.program import KrlProgram
from kuka_export.proof import Proof, prove
from kuka_export.writer import write_program
from planner.errors import EchoBaseError, fail
from planner.frames import Transform
from planner.issues import Issue, errors_in
from planner.setup import Setup
from planner.toolpath import ToolPath

Verdict = Literal["pass", "partial", "fail"]


@dataclass(frozen=True, eq=False)
class Export:
    """A proven program: file name -> bytes, its proof, warnings, and the manifest (JSON fields)."""

    program: KrlProgram
    files: dict[str, bytes]
    proof: Proof
    issues: tuple[Issue, ...]
    manifest: dict[str, Any]


def export(
    path: ToolPath,
    setup: Setup,
    name: str,
    label: str = "",
    *,
    T_base_basecorr: Transform | None = None,
    options: ProgramOptions = DEFAULT_OPTIONS,
    notes: Sequence[str] = (),
    centroid_base_mm: ArrayLike | None = None,
    verdict: Verdict | None = None,
    acceptance: str = "",
) -> Export:
    """Return the proven program of a decimated path; arguments as `build_program`.

    `verdict` of the alignment: `fail` is refused, `partial` needs `acceptance` (who and why), which then stands in the
    main module and the manifest. Raises EchoBaseError rather than hand out a program with a fault.
    """
    if verdict == "fail":
        raise fail(
            "correction-failed",
            "The alignment failed; there is no corrected program.",
            "Read its issues, scan again, align again.",
            "correction",
        )
    if verdict == "partial" and not acceptance.strip():
        raise fail(
            "correction-not-accepted",
            "The alignment is partial and nobody accepted it.",
            "Accept it with a name and a reason.",
            "correction",
        )
    accepted = (f"ACCEPTANCE: {acceptance}",) if acceptance.strip() else ()
    program = build_program(
        path,
        setup,
        name,
        label,
        T_base_basecorr=T_base_basecorr,
        options=options,
        notes=(*accepted, *notes),
        centroid_base_mm=centroid_base_mm,
    )
    files = write_program(program)
    library = load(files)
    proof = prove(program, files, library)
    if not proof.ok:
        raise EchoBaseError(*proof.issues)
    found = check_files(files, program.profile, library)
    if errors_in(found):
        raise EchoBaseError(*errors_in(found))
    return Export(program, files, proof, program.issues, manifest(program, files, proof, acceptance))


def manifest(program: KrlProgram, files: dict[str, bytes], proof: Proof, acceptance: str = "") -> dict[str, Any]:
    """Return what the program is, in numbers: files with size and SHA-256, differences, base, tool, limits and use."""
    offset, frame = program.base_offset, program.base_frame
    loads: list[dict[str, Any]] = [
        {
            "main": load.main,
            "modules": list(load.modules),
            "bytes": sum(
                len(files[f]) for m in (load.main, *load.modules) for f in (f"{m}.src", f"{m}.dat") if f in files
            ),
        }
        for load in program.loads
    ]
    longest = max(data.count(b"\n") for data in files.values())
    return {
        "program": program.name,
        "kind": program.kind,
        "corrected": offset is not None or program.name != program.stem,
        "controller": program.profile,
        "label": program.label,
        "poses": proof.poses,
        "passes": proof.passes,
        "files": {name: {"bytes": len(data), "sha256": proof.sha256[name]} for name, data in files.items()},
        "bytes": proof.bytes,
        "largest_difference": {"mm": proof.largest_mm, "deg": proof.largest_deg},
        "base": {
            "number": program.base_number,
            "written": None if frame is None else [float(v) for v in frame],
            "composed": None if offset is None else [float(v) for v in offset],
        },
        "tool": {"number": program.tool_number},
        "signal": {"style": program.signal, "data_output": program.data_output, "wait_input": program.wait_input},
        "loads": loads,
        "limits": {
            **program.limits,
            "used_bytes": max(load["bytes"] for load in loads),
            "used_lines": longest,
            "used_modules": max(len(load["modules"]) + 1 for load in loads),
        },
        "acceptance": acceptance,
        "issues": [i.to_json() for i in program.issues],
    }
