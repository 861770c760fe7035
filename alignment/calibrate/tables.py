"""Readings of a calibration from CSV files, columns by name."""

from pathlib import Path

import numpy as np
import polars as pl

from planner.errors import fail
from planner.frames import Array

MAX_ROWS = 5_000_000


def read_table(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...] = (), name: str | None = None
) -> dict[str, Array]:
    """Return the named columns of a CSV file as float64 (n,); absent optional ones are left out, empty cells are NaN.

    name: what people call the file; default: its own name.
    Raises EchoBaseError `calibration-file` naming the column or the file.
    """
    shown = path.name if name is None else name
    try:
        table = pl.read_csv(path, infer_schema_length=None, comment_prefix="#", n_rows=MAX_ROWS)
    except (pl.exceptions.PolarsError, OSError, ValueError) as error:
        raise fail(
            "calibration-file",
            "The file cannot be read as CSV.",
            "Save it as CSV in UTF-8 with a header, commas between columns and points in numbers.",
            shown,
        ) from error
    names = {column.strip().lower(): column for column in table.columns}
    missing = [column for column in required if column not in names]
    if missing:
        raise fail(
            "calibration-file",
            f"The column {', '.join(missing)} is missing.",
            f"The file needs the columns {', '.join(required)}"
            + (f"; it may have {', '.join(optional)}." if optional else "."),
            shown,
        )
    columns = {}
    for column in (*required, *optional):
        if column not in names:
            continue
        try:
            columns[column] = np.asarray(table[names[column]].cast(pl.Float64).fill_null(float("nan")).to_numpy())
        except pl.exceptions.PolarsError as error:
            raise fail(
                "calibration-file", f"Column {column} holds something that is no number.", "Correct it.", shown
            ) from error
    if table.height == 0:
        raise fail("calibration-file", "The file has no rows.", "Record the readings again.", shown)
    return columns
