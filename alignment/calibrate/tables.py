"""Readings of a calibration from CSV files, columns by name."""

from pathlib import Path

import numpy as np

from alignment.readers.columns import Layout
from alignment.readers.delimited import read_columns
from planner.errors import fail
from planner.frames import Array


def read_table(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...] = (), name: str | None = None
) -> dict[str, Array]:
    """Return the named columns of a CSV file as float64 (n,); absent optional ones are left out, empty cells are NaN.

    name: what people call the file; default: its own name.
    Raises EchoBaseError: `calibration-file` naming the column that is missing, or as the reader of scans does.
    """
    shown = path.name if name is None else name

    def choose(present: list[str], _: str) -> Layout:
        names = {column.strip().lower(): column for column in present}
        missing = [column for column in required if column not in names]
        if missing:
            column_s = f"the column {missing[0]} is" if len(missing) == 1 else f"the columns {', '.join(missing)} are"
            raise fail(
                "calibration-file",
                f"{column_s} missing; the file has {', '.join(names)}.",
                f"The file needs the columns {', '.join(required)}"
                + (f"; it may have {', '.join(optional)}." if optional else "."),
                shown,
            )
        return Layout("readings", {key: names[key] for key in (*required, *optional) if key in names}, ())

    table = read_columns(path, shown, choose)[1]
    columns = {key: np.asarray(values.to_numpy(), dtype=np.float64) for key, values in table.items()}
    if len(columns[required[0]]) == 0:
        raise fail("calibration-file", "the file has a header but no readings.", "Record the readings again.", shown)
    return columns
