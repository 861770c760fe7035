"""STEP through Open CASCADE (cascadio): as fine as the budget allows, and nothing it complained about."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import fail

# The tolerance asked of the mesher and the largest gap it leaves: measured on spheres, 1.74 times.
CHORD_PER_TOLERANCE = 1.74
FINEST_MM = 0.006
TOLERANCES_MM = (FINEST_MM, 0.012, 0.025, 0.05, 0.1, 0.2, 0.4, 1.0, 3.0)
TURN_RAD = 0.12
# Of a GLB of large meshes: half a vertex with its normal, three indices.
BYTES_PER_TRIANGLE = 30.0
_COMPLAINT = re.compile(r"\bERR\b|\bFails?\b|\bError\b|exception|Unresolved", re.IGNORECASE)
_UNITS = {"": "m", ".CENTI.": "cm", ".MILLI.": "mm"}


def parse(source: Path, options: dict[str, Any]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return vertices (v, 3) and faces (f, 3) in mm of a STEP file, and the tolerance used. Runs in the sandbox.

    options: name, max_triangles. Two coarse passes tell how their number grows with a finer tolerance; the finest one of
    `TOLERANCES_MM` that fits is used.
    """
    import cascadio  # noqa: PLC0415  a second of imports that only STEP needs

    from planner.cad.mesh_files import glb_mesh  # noqa: PLC0415

    name = str(options["name"])
    data = source.read_bytes()
    if b"END-ISO-10303-21" not in data[-4096:]:
        raise fail(
            "part-truncated", "The STEP file has no end mark: it is cut short.", "Export or copy it again.", name
        )

    def mesh(tolerance_mm: float, turn_rad: float) -> bytes:
        glb = cascadio.load(data, file_type="step", tol_linear=tolerance_mm, tol_angular=turn_rad)
        if not glb:
            raise fail(
                "part-damaged", "The STEP file holds no solid or surface that can be read.", "Export it again.", name
            )
        return glb

    coarse = glb_mesh(mesh(1.0, 0.5), name)
    tolerance = _tolerance(mesh, _diagonal_mm(coarse["vertices"]), int(options["max_triangles"]))
    arrays = glb_mesh(mesh(tolerance, TURN_RAD if tolerance < 0.1 else 0.3), name)
    arrays["vertices"] = arrays["vertices"] * 1000.0
    return arrays, {"kind": "STEP", "tolerance_mm": tolerance, "file_unit": file_unit(data)}


def complaint(console: str) -> str | None:
    """Return the first line in which Open CASCADE says that something in the file could not be read; None: no such line."""
    lines = (line.strip() for line in console.splitlines())
    return next((line for line in lines if _COMPLAINT.search(line)), None)


def file_unit(data: bytes) -> str | None:
    """Return the length unit a STEP file declares (`mm`, `cm`, `m`, `inch`), or None if it is another, several, or not found.

    It is the one assigned to the shapes (GLOBAL_UNIT_ASSIGNED_CONTEXT): a file in inches also holds the millimetre they are
    defined by.
    """
    text = data.decode("latin-1")
    lengths = {
        number: _unit_of(entity)
        for number, entity in re.findall(r"#(\d+)\s*=\s*\(([^;]*LENGTH_UNIT\s*\(\s*\)[^;]*)\)\s*;", text)
    }
    assigned = re.findall(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)", text)
    used = {number for refs in assigned for number in re.findall(r"#(\d+)", refs)} & lengths.keys()
    units = {lengths[number] for number in used or lengths}
    return units.pop() if len(units) == 1 else None


def _unit_of(entity: str) -> str | None:
    if "CONVERSION_BASED_UNIT" in entity:
        return "inch" if re.search(r"CONVERSION_BASED_UNIT\s*\(\s*'INCH", entity, re.IGNORECASE) else None
    si = re.search(r"SI_UNIT\s*\(\s*(\$|\.\w+\.)\s*,\s*\.METRE\.\s*\)", entity)
    return _UNITS.get(si.group(1).replace("$", "")) if si else None


def _diagonal_mm(vertices_m: NDArray[np.float64]) -> float:
    return float(1000.0 * np.linalg.norm(np.ptp(vertices_m, axis=0)))


def _tolerance(mesh: Callable[[float, float], bytes], diagonal_mm: float, max_triangles: int) -> float:
    """Return the finest tolerance (mm) that is expected to stay within so many triangles. No clock: same file, same mesh."""
    tried = [(max(diagonal_mm / share, FINEST_MM), turn) for share, turn in ((2000.0, 0.5), (8000.0, 0.25))]
    before, after = (len(mesh(tolerance, turn)) / BYTES_PER_TRIANGLE for tolerance, turn in tried)
    # Triangles per halving of the tolerance: at most double, on a doubly curved surface.
    power = float(np.clip(np.log(max(after / before, 1.0)) / np.log(4.0), 0.1, 1.0))
    reached = tried[1][0]
    for tolerance in TOLERANCES_MM:
        if after * (reached / tolerance) ** power <= max_triangles:
            return tolerance
    return TOLERANCES_MM[-1]
