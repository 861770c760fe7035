"""Point clouds from plain text: `x y z [amplitude tof]` a line, with or without a header. Runs inside the sandbox."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from alignment.readers.clouds import cloud_payload
from alignment.readers.delimited import parse_csv
from planner.errors import fail

NAMES = ("x_mm", "y_mm", "z_mm", "amplitude_pct", "tof_us")


def parse_xyz(source: Path, name: str) -> dict[str, Any]:
    """Return the points payload (see `tables.payload`) of a text file of points in mm.

    Columns are separated by blanks, tabs or commas. Without a header the fourth and fifth column are amplitude (%FSH)
    and time of flight (us); more columns are not accepted, since nobody can know what they are.
    """
    with source.open("rb") as stream:
        head = stream.read(65_536).decode("utf-8-sig", errors="replace")
    first = next((line for line in head.splitlines() if line.strip() and not line.lstrip().startswith(("#", "//"))), "")
    words = first.replace(",", " ").split()
    if not words:
        raise fail("scan-empty", "the file is empty.", "Export the cloud again.", name)
    if not _number(words[0]):
        if "," in first:
            return parse_csv(source, name)
        return cloud_payload(dict(zip(words, _table(source, len(words), 1, name).T, strict=True)), name)
    if not 3 <= len(words) <= len(NAMES):
        raise fail(
            "xyz-columns",
            f"the lines have {len(words)} numbers and no header says what they are.",
            "Write x y z, or add a header line with column names.",
            name,
        )
    return cloud_payload(dict(zip(NAMES, _table(source, len(words), 0, name).T, strict=False)), name)


def _number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _table(source: Path, width: int, headers: int, name: str) -> np.ndarray:
    lines = pl.read_csv(
        source, has_header=False, new_columns=["line"], separator="\x01", quote_char=None, schema_overrides=[pl.String]
    ).get_column("line")
    lines = lines.str.strip_chars()
    lines = lines.filter(~(lines.str.starts_with("#") | lines.str.starts_with("//") | (lines == "")))[headers:]
    cells = lines.str.replace_all(r"[,\s]+", " ").str.split(" ")
    short = cells.list.len() != width
    if bool(short.any()):
        row = int(short.arg_max() or 0)
        raise fail(
            "xyz-columns",
            f"point {row + 1} does not have {width} numbers: '{lines[row][:60]}'.",
            "Write one point a line.",
            name,
        )
    values = cells.explode().cast(pl.Float64, strict=False)
    if values.null_count():
        row = int(values.is_null().arg_max() or 0) // width
        raise fail(
            "cell-not-a-number", f"point {row + 1}: '{lines[row][:60]}' is not made of numbers.", "Write numbers.", name
        )
    return values.to_numpy().reshape(-1, width)
