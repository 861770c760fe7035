"""STL, binary and ASCII, read strictly: what the file declares is what comes out, or an error says so."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import fail

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
HEADER_BYTES, COUNT_BYTES = 80, 4
MAX_TRIANGLES = 10_000_000
_VERTEX = re.compile(rb"vertex[ \t]+([^\s]+)[ \t]+([^\s]+)[ \t]+([^\s]+)")


def parse(source: Path, options: dict[str, Any]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return `{"corners": (f, 3, 3) float64}` in the file's unit. Runs in the sandbox."""
    name = str(options["name"])
    data = source.read_bytes()
    start = HEADER_BYTES + COUNT_BYTES
    count = int.from_bytes(data[HEADER_BYTES:start], "little") if len(data) >= start else -1
    expected = start + RECORD.itemsize * count
    if count >= 0 and len(data) == expected:
        _check_count(count, name)
        corners = np.frombuffer(data, RECORD, count, start)["corners"].astype(np.float64)
        return {"corners": corners}, {"kind": "binary STL"}
    if data.lstrip()[:5].lower() == b"solid":
        return {"corners": _ascii(data, name)}, {"kind": "ASCII STL"}
    if 0 <= count <= MAX_TRIANGLES and len(data) < expected and _plausible(data):
        raise fail(
            "part-truncated",
            f"The file declares {count} triangles ({expected} bytes) but has {len(data)} bytes: it is cut short.",
            "Export or copy it again.",
            name,
        )
    raise fail(
        "part-not-a-mesh",
        "The file is not an STL mesh: its length does not fit the number of triangles it declares, and it is not ASCII STL.",
        "Export it again as STL, or give STEP.",
        name,
    )


def _check_count(count: int, name: str) -> None:
    if count == 0:
        raise fail("part-empty", "The file holds no triangles.", "Export the part again, as a mesh.", name)
    if count > MAX_TRIANGLES:
        raise fail(
            "part-too-big",
            f"The file holds {count} triangles; at most {MAX_TRIANGLES} are read.",
            "Export it coarser, or give STEP.",
            name,
        )


def _plausible(data: bytes) -> bool:
    """Return whether the first triangles are finite numbers of sane size, as in an STL that was cut short."""
    start = HEADER_BYTES + COUNT_BYTES
    whole = min((len(data) - start) // RECORD.itemsize, 100)
    if whole < 1:
        return True
    corners = np.frombuffer(data, RECORD, whole, start)["corners"]
    return bool(np.isfinite(corners).all() and (np.abs(corners) < 1e7).all())


def _ascii(data: bytes, name: str) -> NDArray[np.float64]:
    low = data.lower()
    facets, ends, solids = low.count(b"facet normal"), low.count(b"endfacet"), low.count(b"endsolid")
    found = _VERTEX.findall(low)
    if facets == 0 and not found:
        if solids:
            raise fail("part-empty", "The file holds no triangles.", "Export the part again, as a mesh.", name)
        raise fail("part-not-a-mesh", "The file begins like ASCII STL but holds no facets.", "Export it again.", name)
    if solids == 0 or facets != ends or len(found) != 3 * facets:
        raise fail(
            "part-truncated",
            f"The file begins {facets} facets, ends {ends}, holds {len(found)} vertices and "
            f"{'is' if solids else 'is not'} closed by 'endsolid': it is cut short or damaged.",
            "Export or copy it again.",
            name,
        )
    _check_count(facets, name)
    try:
        return np.array(found, dtype="S40").astype(np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise fail(
            "part-damaged", f"A vertex of the file is not a number ({error}).", "Export it again.", name
        ) from error
