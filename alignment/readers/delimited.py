"""Readings, poses, echoes or points from CSV text (`.csv`, `.csv.gz`, `.xyz` with a header). Runs inside the sandbox."""

import csv
import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl

from alignment.readers.columns import Layout, layout
from alignment.readers.tables import payload
from planner.errors import EchoBaseError, fail

HEADER_BYTES = 65_536
CUT_REMEDY = "The file seems cut short: export or copy it again whole."


def parse_csv(source: Path, name: str) -> dict[str, Any]:
    """Return the payload (see `tables.payload`) of a comma-separated file with a header line."""
    return payload(*read_columns(source, name, layout), name)


def read_columns(
    source: Path, name: str, choose: Callable[[list[str], str], Layout]
) -> tuple[Layout, dict[str, pl.Series]]:
    """Return the columns that `choose` (of the names in the header, and the file's) takes, float64, empty cells null.

    Raises EchoBaseError with line and column of what is no number, or not there because the file was cut.
    """
    header_line, skip = _header(source, name)
    columns = next(csv.reader([header_line]))
    found = choose([column for column in columns if column.strip()], name)
    table = _columns(source, name, columns, found, skip)
    if any(column.len() and column[-1] is None for column in table.values()):
        _refuse_cut(source, name, columns)
    return found, table


def _header(source: Path, name: str) -> tuple[str, int]:
    """Return the header line and the number of lines before it (comments, blank lines)."""
    with source.open("rb") as raw:
        gzipped = raw.read(2) == b"\x1f\x8b"
    try:
        with gzip.open(source, "rb") if gzipped else source.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except (OSError, EOFError) as error:
        raise _damaged(name, error) from error
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise fail("csv-encoding", "the text is UTF-16.", "Save it as UTF-8 CSV.", name)
    text = head.decode("utf-8-sig", errors="replace")
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if line.strip() and not line.lstrip().startswith("#"):
            _check_separators(line, lines[number + 1] if number + 1 < len(lines) else "", name)
            return line, number
    raise fail("scan-empty", "the file is empty.", "Export the scan again with one header line and its readings.", name)


def _damaged(name: str, error: Exception) -> EchoBaseError:
    return fail("scan-unreadable", f"the compressed file is damaged or cut short ({error}).", "Copy it again.", name)


def _refuse_cut(source: Path, name: str, columns: list[str]) -> None:
    """Refuse a file whose last row ends before its last column; a lost echo at the end keeps its commas."""
    number, last = 0, b""
    with source.open("rb") as raw:
        gzipped = raw.read(2) == b"\x1f\x8b"
    with gzip.open(source, "rb") if gzipped else source.open("rb") as stream:
        for at, line in enumerate(stream, start=1):
            if line.strip() and not line.lstrip().startswith(b"#"):
                number, last = at, line
    cells = next(csv.reader([last.decode("utf-8-sig", errors="replace").strip()]))
    if len(cells) < len(columns):
        ends = columns[len(cells) - 1].strip()
        raise fail(
            "csv-cut",
            f"line {number}, the last one, has {len(cells)} of {len(columns)} cells and ends in column '{ends}'.",
            CUT_REMEDY,
            name,
        )


def _check_separators(header: str, first_row: str, name: str) -> None:
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if header.count(separator) > header.count(","):
            comma = " and a decimal comma" if "," in first_row else ""
            raise fail(
                "csv-separator",
                f"the columns are separated by {word}{comma}.",
                "Save the file with commas between the columns and a decimal point.",
                name,
            )
    if "," in header and first_row.count(",") == 2 * header.count(",") + 1:
        raise fail(
            "csv-decimal-comma",
            "the first row has twice as many cells as the header: the numbers use a decimal comma.",
            "Save the file with a decimal point.",
            name,
        )


def _columns(source: Path, name: str, columns: list[str], found: Layout, skip: int) -> dict[str, Any]:
    wanted = list(found.spelled.values())
    options: dict[str, Any] = {
        "columns": wanted,
        "skip_lines": skip,
        "encoding": "utf8",
    }
    numbers = dict.fromkeys(wanted, pl.Float64)
    try:
        try:
            frame = pl.read_csv(source, schema_overrides=numbers, **options)
        except pl.exceptions.ComputeError:
            # Comments between the rows are rare, and looking for them takes as long as reading.
            options["comment_prefix"] = "#"
            frame = pl.read_csv(source, schema_overrides=numbers, **options)
    except pl.exceptions.NoDataError as error:
        raise fail("scan-empty", "the file has a header but no readings.", "Export the scan again.", name) from error
    except pl.exceptions.PolarsError as error:
        raise _cell_error(source, name, wanted, options, skip, error) from error
    except OSError as error:
        raise _damaged(name, error) from error
    return {key: frame.get_column(spelled) for key, spelled in found.spelled.items()}


def _cell_error(
    source: Path, name: str, wanted: list[str], options: dict[str, Any], skip: int, error: Exception
) -> EchoBaseError:
    """Find the first cell that is not a number (read again as text), for the message."""
    try:
        text = pl.read_csv(
            source, schema_overrides=dict.fromkeys(wanted, pl.String), truncate_ragged_lines=True, **options
        )
    except pl.exceptions.PolarsError:
        reason = str(error).splitlines()[0]
        return fail(
            "csv-malformed", f"the table cannot be read ({reason}).", "Every row needs one cell per column.", name
        )
    worst: tuple[int, str, str] | None = None
    for column in wanted:
        cells = text.get_column(column).str.strip_chars()
        bad = (cells != "") & cells.is_not_null() & cells.cast(pl.Float64, strict=False).is_null()
        row = bad.arg_max() if bool(bad.any()) else None
        if row is not None and (worst is None or row < worst[0]):
            worst = (int(row), column, str(cells[row]))
    if worst is None:
        return fail(
            "csv-malformed",
            "rows have more or fewer cells than the header.",
            "Every row needs one cell per column; look for text with commas in it.",
            name,
        )
    row, column, cell = worst
    return fail(
        "cell-not-a-number",
        f"row {row + skip + 2}, column '{column.strip()}': '{cell[:40]}' is not a number.",
        "Write a number with a decimal point, or leave the cell empty where the echo was lost.",
        name,
    )
