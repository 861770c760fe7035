"""Point clouds from PLY, ASCII or binary. Runs inside the sandbox."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.readers.clouds import cloud_payload
from planner.errors import fail

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
HEADER_LIMIT = 100_000


def parse_ply(source: Path, name: str) -> dict[str, Any]:
    """Return the points payload (see `tables.payload`) of the vertices of a PLY file; faces and other elements are ignored."""
    with source.open("rb") as stream:
        head = stream.read(HEADER_LIMIT)
        end = head.find(b"end_header")
        if not head.startswith(b"ply") or end < 0:
            raise fail("ply-malformed", "the PLY header is missing or never ends.", "Export the cloud again.", name)
        body = head.index(b"\n", end) + 1
        lines = head[:end].decode("ascii", errors="replace").split("\n")
        kind, count, fields = _vertex_element([line.split() for line in lines], name)
        stream.seek(body)
        rows = (
            _ascii(stream.read(), count, fields, name)
            if kind == "ascii"
            else _binary(stream.read(), kind, count, fields, name)
        )
    return cloud_payload({field: rows[field] for field, _ in fields}, name)


def _vertex_element(lines: list[list[str]], name: str) -> tuple[str, int, list[tuple[str, str]]]:
    kind, count, fields, current = "", -1, [], ""
    for words in lines:
        match words:
            case ["format", form, *_]:
                kind = form
            case ["element", element, number]:
                if element == "vertex" and current:
                    raise fail("ply-order", "the vertices are not the first element.", "Export only the points.", name)
                current = element
                count = int(number) if element == "vertex" and number.isdigit() else count
            case ["property", "list", *_] if current == "vertex":
                raise fail("ply-list", "the vertices carry lists.", "Export plain points.", name)
            case ["property", form, field] if current == "vertex":
                if form not in TYPES:
                    raise fail(
                        "ply-type",
                        f"property '{field}' has the unknown type '{form}'.",
                        "Export the cloud again.",
                        name,
                    )
                fields.append((field, TYPES[form]))
    if kind not in ("ascii", "binary_little_endian", "binary_big_endian") or count < 0 or not fields:
        raise fail("ply-malformed", "the PLY header names no format or no vertices.", "Export the cloud again.", name)
    return kind, count, fields


def _binary(body: bytes, kind: str, count: int, fields: list[tuple[str, str]], name: str) -> NDArray[Any]:
    order = "<" if kind == "binary_little_endian" else ">"
    dtype = np.dtype([(field, order + form) for field, form in fields])
    if len(body) < count * dtype.itemsize:
        have = len(body) // dtype.itemsize
        raise fail("ply-short", f"the file ends after {have} of {count} points.", "Copy it again.", name)
    return np.frombuffer(body, dtype=dtype, count=count)


def _ascii(body: bytes, count: int, fields: list[tuple[str, str]], name: str) -> NDArray[Any]:
    try:
        table = np.array(body.decode("ascii").split(), dtype=np.float64)[: count * len(fields)]
    except ValueError as error:
        raise fail(
            "cell-not-a-number", f"a vertex is not made of numbers ({error}).", "Export it again.", name
        ) from error
    if len(table) < count * len(fields):
        have = len(table) // len(fields)
        raise fail("ply-short", f"the file ends after {have} of {count} points.", "Copy it again.", name)
    rows = np.zeros(count, dtype=[(field, "f8") for field, _ in fields])
    for i, (field, _) in enumerate(fields):
        rows[field] = table.reshape(count, -1)[:, i]
    return rows
