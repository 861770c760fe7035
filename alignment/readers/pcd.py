"""Point clouds from PCD 0.7: ascii, binary, binary_compressed. Runs inside the sandbox."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.readers.clouds import cloud_payload
from alignment.readers.lzf import lzf_decompress
from planner.errors import fail

HEADER_LIMIT = 100_000
LETTER = {"I": "i", "U": "u", "F": "f"}


def parse_pcd(source: Path, name: str) -> dict[str, Any]:
    """Return the points payload (see `tables.payload`) of a PCD file; rows of NaN (gated out) are left out."""
    raw = source.read_bytes()
    at = raw.find(b"\nDATA ", 0, HEADER_LIMIT)
    end = raw.find(b"\n", at + 1)
    if at < 0 or end < 0:
        raise fail("pcd-malformed", "the PCD header has no DATA line.", "Export the cloud again.", name)
    header = {}
    for line in raw[: end + 1].decode("ascii", errors="replace").splitlines():
        words = line.split()
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    dtype, columns, count = _dtype(header, name)
    body, kind = raw[end + 1 :], header["DATA"][0].lower()
    rows: Any
    if kind == "ascii":
        rows = _ascii(body, columns, count, name)
    elif kind == "binary":
        rows = _frombuffer(body, dtype, count, name)
    elif kind == "binary_compressed":
        rows = _compressed(body, dtype, count, name)
    else:
        raise fail("pcd-malformed", f"DATA {kind} is not known.", "Export as ascii, binary or binary_compressed.", name)
    plain = {field: rows[field] for field in dtype.names or () if rows[field].ndim == 1}
    return cloud_payload(plain, name)


def _dtype(header: dict[str, list[str]], name: str) -> tuple[np.dtype[Any], list[tuple[str, int]], int]:
    try:
        fields, sizes, types = header["FIELDS"], header["SIZE"], header["TYPE"]
        counts = [int(word) for word in header.get("COUNT", ["1"] * len(fields))]
        size = header["WIDTH"] + header["HEIGHT"] if "POINTS" not in header else header["POINTS"]
        total = int(np.prod([int(word) for word in size]))
        form = []
        for i, field in enumerate(fields):
            unique = field if field not in ("_", "") else f"_{i}"
            code = f"<{LETTER[types[i]]}{int(sizes[i])}"
            form.append((unique, code) if counts[i] == 1 else (unique, code, (counts[i],)))
        return np.dtype(form), [(entry[0], counts[i]) for i, entry in enumerate(form)], total
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise fail(
            "pcd-malformed", f"the PCD header is incomplete ({error}).", "Export the cloud again.", name
        ) from error


def _frombuffer(body: bytes, dtype: np.dtype[Any], count: int, name: str) -> NDArray[Any]:
    if len(body) < count * dtype.itemsize:
        have = len(body) // dtype.itemsize
        raise fail("pcd-short", f"the file ends after {have} of {count} points.", "Copy it again.", name)
    return np.frombuffer(body, dtype=dtype, count=count)


def _compressed(body: bytes, dtype: np.dtype[Any], count: int, name: str) -> NDArray[Any]:
    """Fields one after the other (not point by point), as one LZF block after its two sizes."""
    packed, plain = (int(v) for v in np.frombuffer(body[:8], dtype="<u4")) if len(body) >= 8 else (0, 0)
    if plain != count * dtype.itemsize or len(body) < 8 + packed:
        raise fail("pcd-short", "the compressed block does not have the size of its points.", "Copy it again.", name)
    data = lzf_decompress(body[8 : 8 + packed], plain, name)
    rows, offset = np.zeros(count, dtype=dtype), 0
    for field in dtype.names or ():
        base, shape = (dtype[field].base, dtype[field].shape)
        width = base.itemsize * int(np.prod(shape, dtype=np.int64))
        rows[field] = np.frombuffer(data, dtype=base, count=count * (width // base.itemsize), offset=offset).reshape(
            count, *shape
        )
        offset += count * width
    return rows


def _ascii(body: bytes, columns: list[tuple[str, int]], count: int, name: str) -> dict[str, Any]:
    width = sum(number for _, number in columns)
    try:
        table = np.array(body.decode("ascii").split(), dtype=np.float64)
    except ValueError as error:
        raise fail(
            "cell-not-a-number", f"a point is not made of numbers ({error}).", "Export it again.", name
        ) from error
    if len(table) < count * width:
        raise fail("pcd-short", f"the file ends after {len(table) // width} of {count} points.", "Copy it again.", name)
    table, out, at = table[: count * width].reshape(count, width), {}, 0
    for field, number in columns:
        out[field] = table[:, at] if number == 1 else table[:, at : at + number]
        at += number
    return out
