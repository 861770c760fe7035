"""`read_part`: a CAD file becomes a `Part`, or one clear sentence."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.cad.clean import Cleaned, clean
from planner.cad.formats import HEAD_BYTES, Format, format_of
from planner.cad.size import expect_size, expect_unit
from planner.cad.step import CHORD_PER_TOLERANCE, FINEST_MM, complaint
from planner.errors import EchoBaseError, fail
from planner.frames import Array
from planner.memory import READ_BYTES, expect_memory
from planner.part import Part, Provenance
from planner.sandbox import SandboxLimits, run_limited
from planner.surface.topology import Index
from planner.units import mm_per

PARSERS: dict[Format, str] = {
    "stl": "planner.cad.stl:parse",
    "step": "planner.cad.step:parse",
    "obj": "planner.cad.mesh_files:parse_obj",
    "ply": "planner.cad.mesh_files:parse_ply",
    "glb": "planner.cad.mesh_files:parse_glb",
}
# Triangles of a STEP file, and what is tried where these take too much memory or time.
STEP_BUDGETS = (200_000, 40_000, 8_000)
STEP_LIMITS = SandboxLimits(memory_mb=4096, cpu_s=120, wall_s=90.0)


def read_part(source: Path, name: str, unit: str | None, limits: SandboxLimits | None = None) -> Part:
    """Return the part of a STEP, STL, OBJ, PLY or GLB file.

    name: the file's name as people know it (its extension tells the format; it is never opened). unit: `mm`, `cm`, `m` or
    `inch` for STL, OBJ and PLY, which carry none; None for STEP and GLB. limits: of the child process that parses.
    Vertices are merged, triangles are wound outward where bodies are closed; `provenance.notes` says what was done.
    STEP is meshed to a chord error of 0.01 mm or, where that exceeds the budget, as fine as it allows, with a note.

    Raises EchoBaseError: `part-missing`, `part-format`, `part-mismatch`, `part-empty`, `part-truncated`, `part-damaged`,
    `part-not-a-mesh`, `part-too-big`, `part-memory`, `part-size`, `part-far`, `unit-missing`, `unit-unknown`,
    `unit-contradicts`, `step-messages` and those of `planner.sandbox.run_limited`.
    """
    shown = Path(name.replace("\\", "/")).name or name
    digest, head, size = _fingerprint(source, shown)
    kind = format_of(shown, head, size)
    arrays, meta = _parse(source, kind, shown, limits)
    vertices, faces = _triangles(arrays, shown)
    expect_memory(len(faces), READ_BYTES, "Reading a part of", shown)
    scale = 1.0 if kind == "step" else None
    own = expect_unit(kind, unit, meta.get("file_unit"), np.ptp(vertices, axis=0), shown)
    vertices = vertices * (mm_per(own) if scale is None else scale)
    expect_size(vertices.min(axis=0), vertices.max(axis=0), own, kind, shown)
    cleaned = clean(vertices, faces)
    if not len(cleaned.faces):
        raise fail("part-empty", "No triangle of the file has an area.", "Export the part again, as a mesh.", shown)
    notes = (*_step_notes(meta), *cleaned.notes, *_body_notes(cleaned))
    chord = CHORD_PER_TOLERANCE * float(meta["tolerance_mm"]) if "tolerance_mm" in meta else float("nan")
    provenance = Provenance(shown, digest, own, notes)
    facts = {"kind": meta["kind"], "bodies": cleaned.bodies, "closed_bodies": cleaned.closed_bodies}
    return Part(cleaned.vertices, cleaned.faces, provenance, chord, facts)


def _fingerprint(source: Path, name: str) -> tuple[str, bytes, int]:
    """Return SHA-256, first bytes and size of the file."""
    try:
        with source.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            size = file.tell()
            file.seek(0)
            return digest, file.read(HEAD_BYTES), size
    except OSError as error:
        words = (error.strerror or str(error)).lower()
        raise fail("part-missing", f"The file cannot be opened: {words}.", "Check the path.", name) from error


def _parse(
    source: Path, kind: Format, name: str, limits: SandboxLimits | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    options: dict[str, Any] = {"name": name}
    if kind != "step":
        return _named(source, kind, options, limits)
    last: EchoBaseError | None = None
    for triangles in STEP_BUDGETS:
        options["max_triangles"] = triangles
        try:
            arrays, meta = _named(source, kind, options, limits or STEP_LIMITS)
        except EchoBaseError as error:
            if error.issues[0].code not in ("reader-memory", "reader-time"):
                raise
            last = error
            continue
        said = complaint(meta["console"])
        if said:
            raise fail(
                "step-messages",
                f"Open CASCADE could not read all of the file and said: {said[:200]}",
                "A damaged STEP file can become a different part: export it again.",
                name,
            )
        return arrays, meta
    raise last or AssertionError


def _named(
    source: Path, kind: Format, options: dict[str, Any], limits: SandboxLimits | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run the parser; errors of the sandbox name the stored file, people know another name."""
    try:
        return run_limited(PARSERS[kind], source, options, limits)
    except EchoBaseError as error:
        raise EchoBaseError(*(replace(issue, where=options["name"]) for issue in error.issues)) from None


def _triangles(arrays: dict[str, Any], name: str) -> tuple[Array, Index]:
    """Return vertices and faces, checked: any at all, finite, indices in range."""
    if "corners" in arrays:
        vertices = np.asarray(arrays["corners"], dtype=np.float64).reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int64).reshape(-1, 3)
    else:
        vertices = np.asarray(arrays["vertices"], dtype=np.float64)
        faces = np.asarray(arrays["faces"], dtype=np.int64)
    if not len(faces):
        raise fail("part-empty", "The file holds no triangles.", "Export the part again, as a mesh.", name)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise fail("part-damaged", "A triangle refers to a vertex that is not in the file.", "Export it again.", name)
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise fail("part-damaged", f"{bad} vertices of the file are not finite numbers.", "Export it again.", name)
    return vertices, faces


def _step_notes(meta: dict[str, Any]) -> tuple[str, ...]:
    tolerance = meta.get("tolerance_mm")
    if tolerance is None or tolerance <= FINEST_MM:
        return ()
    chord = CHORD_PER_TOLERANCE * tolerance
    return (f"STEP was meshed to a chord error of {chord:.3g} mm instead of 0.01 mm, to stay within the budget.",)


def _body_notes(cleaned: Cleaned) -> tuple[str, ...]:
    notes = []
    if cleaned.bodies > 1:
        notes.append(f"The part consists of {cleaned.bodies} bodies that do not touch.")
    if cleaned.closed_bodies < cleaned.bodies:
        notes.append(
            f"{cleaned.bodies - cleaned.closed_bodies} of {cleaned.bodies} bodies are open: sheets, or with gaps."
        )
    return tuple(notes)
