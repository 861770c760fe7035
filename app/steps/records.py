"""The record of an inspection as a file of the plan's folder."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from app.inputs import read_json, validation_failure
from app.report.record import Record

NAME = "record.json"


def record_from(data: Any, where: str = NAME) -> Record:
    """Return the validated record; raise EchoBaseError with one issue per bad field."""
    try:
        return Record.model_validate(data)
    except ValidationError as error:
        raise validation_failure(error, where, Record) from error


def read_record(path: Path) -> Record:
    """Return the record of a file."""
    return record_from(read_json(path), path.name)


def record_of(folder: Path, given: Record | None) -> Record:
    """Return the record given, else that of the plan's folder, else an empty one."""
    if given is not None:
        return given
    path = folder / NAME
    return read_record(path) if path.is_file() else Record()
