"""Readings, poses, echoes or points from Parquet. Runs inside the sandbox."""

from pathlib import Path
from typing import Any

import polars as pl

from alignment.readers.columns import layout
from alignment.readers.tables import payload
from planner.errors import fail


def parse_parquet(source: Path, name: str) -> dict[str, Any]:
    """Return the payload (see `tables.payload`) of a Parquet file."""
    try:
        schema = pl.read_parquet_schema(source)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise fail("parquet-unreadable", f"not a Parquet file ({_first(error)}).", "Export it again.", name) from error
    found = layout(list(schema), name)
    for key, spelled in found.spelled.items():
        if not (schema[spelled].is_numeric() or schema[spelled] == pl.Null):
            raise fail(
                "cell-not-a-number",
                f"column '{key}' holds {schema[spelled]}, not numbers.",
                "Store it as a floating point column.",
                name,
            )
    try:
        frame = pl.read_parquet(source, columns=list(found.spelled.values()))
    except (pl.exceptions.PolarsError, OSError) as error:
        raise fail("parquet-unreadable", f"the file is damaged ({_first(error)}).", "Copy it again.", name) from error
    columns = {key: frame.get_column(spelled).cast(pl.Float64) for key, spelled in found.spelled.items()}
    return payload(found, columns, name)


def _first(error: Exception) -> str:
    return (str(error).splitlines() or [""])[0]
