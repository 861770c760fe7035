"""The record of a result: as the project's was when the result was made, or as it was last edited for that result.

The project's record is the one of results to come. Another piece's serial number, written down for the next result, must
not reach the report of this one.
"""

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.report.record import Record
from app.store.inputs import Input, current, put_in, version_of
from app.store.tables import InputRow, ResultRow

OF = {"alignment": "record-al", "assessment": "record-as"}
# What `inputs` of a result calls the version of the project's record when it was made (0: nobody had given one).
VERSION_KEY = "record"


def kind_of(row: ResultRow) -> str:
    """Return the kind of input under which the edits of a result's record are kept."""
    return f"{OF[row.kind]}-{row.number}"


def record_of(session: Session, row: ResultRow) -> Input:
    """Return the record of a result; version 0 as long as nobody edited it for this result."""
    own = current(session, row.project_id, kind_of(row))
    if own.is_given:
        return own
    version = _version_when_made(session, row)
    if version == 0:
        # A result made before anything was written down takes the first that was.
        version = min(1, current(session, row.project_id, "record").version)
    if version == 0:
        return own
    return Input(own.kind, 0, own.sha256, version_of(session, row.project_id, "record", version).content)


def record_in(session: Session, row: ResultRow) -> Record:
    """Return what people wrote down of what a result is about."""
    return Record.model_validate(record_of(session, row).content)


def edit(session: Session, row: ResultRow, content: Any, expected: int | None) -> tuple[Input, bool]:
    """Put a record in force for one result alone; the second value is False if nothing changed. Raises Refusal 412."""
    return put_in(session, row.project_id, kind_of(row), content, expected)


def copy(session: Session, row: ResultRow, made: ResultRow) -> None:
    """Give a result that is another one again the record that was edited for that one."""
    own = current(session, row.project_id, kind_of(row))
    if own.is_given:
        put_in(session, made.project_id, kind_of(made), own.content, None)


def _version_when_made(session: Session, row: ResultRow) -> int:
    version = row.inputs.get(VERSION_KEY)
    if isinstance(version, int):
        return version
    # Made by a version that did not note it: the clock tells.
    mine = select(InputRow.version).where(
        InputRow.project_id == row.project_id, InputRow.kind == "record", InputRow.created <= row.created
    )
    return session.scalars(mine.order_by(InputRow.version.desc()).limit(1)).first() or 0
