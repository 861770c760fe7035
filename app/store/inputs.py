"""Inputs of a project: part, setup, surface seeds, key points, record. Every version is kept; the highest is in force."""

import json
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.report.record import Record
from app.store.blobs import Blob
from app.store.content import canonical, digest_of
from app.store.journal import note
from app.store.names import now
from app.store.projects import check_version, get, touch
from app.store.refusal import not_found
from app.store.store import Store
from app.store.tables import FileRow, InputRow
from planner.keypoint import KeyPoint, KeyPointList
from planner.setup import Setup

Seeds = list[tuple[float, float, float]]


@dataclass(frozen=True)
class Input:
    """An input in force: version 0 and the default content if nobody gave one."""

    kind: str
    version: int
    sha256: str
    content: Any

    @property
    def is_given(self) -> bool:
        """True if somebody gave it."""
        return self.version > 0


def defaults() -> dict[str, Any]:
    """Return the content of every input that nobody gave."""
    return {
        "part": None,
        "setup": Setup().model_dump(mode="json"),
        "surface": {"seeds": []},
        "keypoints": [],
        "record": Record().model_dump(mode="json"),
    }


def current(session: Session, project_id: str, kind: str) -> Input:
    """Return the input in force. Of a result's own record (`record-al-3`, `store.result_records`) what was edited."""
    newest = select(InputRow).where(InputRow.project_id == project_id, InputRow.kind == kind)
    row = session.scalars(newest.order_by(InputRow.version.desc()).limit(1)).first()
    if row is None:
        return _default(kind)
    return Input(kind, row.version, row.sha256, json.loads(row.content))


def _default(kind: str) -> Input:
    content = defaults()[kind.partition("-")[0]]
    return Input(kind, 0, "" if content is None else digest_of(content), content)


def version_of(session: Session, project_id: str, kind: str, version: int) -> Input:
    """Return an earlier version of an input, 0 what it was before anybody gave one; raises Refusal 404."""
    if version == 0:
        return _default(kind)
    found = select(InputRow).where(
        InputRow.project_id == project_id, InputRow.kind == kind, InputRow.version == version
    )
    row = session.scalars(found).first()
    if row is None:
        raise not_found(f"{kind} version", version)
    return Input(kind, row.version, row.sha256, json.loads(row.content))


def recent(session: Session, project_id: str, kind: str, limit: int) -> list[Input]:
    """Return the last versions of an input, oldest first."""
    newest = select(InputRow).where(InputRow.project_id == project_id, InputRow.kind == kind)
    rows = list(session.scalars(newest.order_by(InputRow.version.desc()).limit(limit)))
    return [Input(kind, row.version, row.sha256, json.loads(row.content)) for row in reversed(rows)]


def versions_since(session: Session, project_id: str, kind: str, version: int) -> list[Input]:
    """Return the versions of an input after `version`, oldest first."""
    later = select(InputRow).where(InputRow.project_id == project_id, InputRow.kind == kind, InputRow.version > version)
    rows = session.scalars(later.order_by(InputRow.version))
    return [Input(kind, row.version, row.sha256, json.loads(row.content)) for row in rows]


def put(store: Store, project_id: str, kind: str, content: Any, expected: int | None = None, who: str = "") -> Input:
    """Put a new content in force; the same content again changes nothing. Raises Refusal 404, 412."""
    with store.db.write() as session:
        given, changed = put_in(session, project_id, kind, content, expected, who)
    if changed:
        store.tell(project_id, kind, version=given.version, who=who)
    return given


def put_in(
    session: Session, project_id: str, kind: str, content: Any, expected: int | None, who: str = ""
) -> tuple[Input, bool]:
    """Do what `put` does inside a transaction; the second value is False if nothing changed."""
    get(session, project_id)
    before = current(session, project_id, kind)
    check_version(kind, before.version, expected)
    sha256 = digest_of(content)
    if before.is_given and before.sha256 == sha256:
        return before, False
    after = Input(kind, before.version + 1, sha256, content)
    _add(session, project_id, after, who)
    return after, True


def put_part(
    store: Store, project_id: str, part: dict[str, Any], files: dict[str, Blob], expected: int | None
) -> Input:
    """Put a part in force. `files`: the upload under `source`, and what was read from it (`part.npz`)."""
    with store.db.write() as session:
        get(session, project_id)
        before = current(session, project_id, "part")
        check_version("part", before.version, expected)
        # The name is not part of the digest: the same bytes in the same unit are the same part.
        sha256 = digest_of({"file": files["source"].sha256, "unit": part["unit"]})
        after = Input("part", before.version + 1, sha256, part)
        _add(session, project_id, after, "")
        add_files(session, project_id, f"part:{after.version}", files)
    store.tell(project_id, "part", version=after.version)
    return after


def _add(session: Session, project_id: str, value: Input, who: str) -> None:
    text = canonical(value.content)
    row = {"project_id": project_id, "kind": value.kind, "version": value.version, "sha256": value.sha256}
    session.add(InputRow(**row, content=text, created=now()))
    note(session, project_id, f"{value.kind}-set", version=value.version, sha256=value.sha256, who=who)
    touch(session, project_id)


def add_files(session: Session, project_id: str, owner: str, files: dict[str, Blob]) -> None:
    """Name blobs as files of an owner."""
    for name, blob in sorted(files.items()):
        session.add(FileRow(project_id=project_id, owner=owner, name=name, sha256=blob.sha256, size=blob.size))


def files_of(session: Session, project_id: str, owner: str) -> dict[str, FileRow]:
    """Return the files of an owner by name."""
    rows = session.scalars(select(FileRow).where(FileRow.project_id == project_id, FileRow.owner == owner))
    return {row.name: row for row in rows}


def setup_in(session: Session, project_id: str) -> Setup:
    """Return the settings in force."""
    return Setup.model_validate(current(session, project_id, "setup").content)


def keypoints_in(session: Session, project_id: str) -> list[KeyPoint]:
    """Return the key points in force."""
    return KeyPointList.validate_python(current(session, project_id, "keypoints").content)


def seeds_in(session: Session, project_id: str) -> Seeds:
    """Return the points from which the inspection surface is flooded (part, mm)."""
    seeds = current(session, project_id, "surface").content["seeds"]
    return [(s["x_mm"], s["y_mm"], s["z_mm"]) for s in seeds]
