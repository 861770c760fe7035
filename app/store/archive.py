"""A project as one ZIP that an engineer can keep: readable names, a manifest with every digest, the journal."""

import zipfile
from collections.abc import Iterator
from typing import IO, Any, cast

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.store.blobs import BlobStore
from app.store.content import canonical, chunks, digest_of
from app.store.journal import lines
from app.store.names import now, safe_member
from app.store.projects import get
from app.store.store import VERSION
from app.store.tables import FileRow, InputRow, ResultRow, ScanRow

FORMAT = 1
MANIFEST = "project.json"


class _Pipe:
    """A file that can only be written; what was written is taken out from time to time."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def write(self, data: bytes) -> int:
        self._parts.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing is held back."""

    def take(self) -> bytes:
        """Return and forget what was written."""
        data = b"".join(self._parts)
        self._parts.clear()
        return data


def archive(blobs: BlobStore, manifest: dict[str, Any]) -> Iterator[bytes]:
    """Yield the ZIP of a project piece by piece; no file is ever whole in memory.

    A damaged blob raises in the middle: the ZIP then has no directory and no reader takes it for whole.
    """
    pipe = _Pipe()
    with zipfile.ZipFile(cast(IO[bytes], pipe), "w", zipfile.ZIP_DEFLATED, compresslevel=1) as out:
        out.writestr(_member(MANIFEST), canonical(manifest))
        for entry in manifest["files"]:
            info = _member(entry["member"])
            with out.open(info, "w", force_zip64=True) as member:
                for data in chunks(blobs, entry["sha256"]):
                    member.write(data)
                    if piece := pipe.take():
                        yield piece
            if piece := pipe.take():
                yield piece
    yield pipe.take()


def _member(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info


def manifest_of(session: Session, project_id: str) -> dict[str, Any]:
    """Return everything the database knows of a project, and where its files stand in the ZIP."""
    project = get(session, project_id)
    files = session.scalars(
        select(FileRow).where(FileRow.project_id == project_id).order_by(FileRow.owner, FileRow.name)
    )
    content = {
        "format": FORMAT,
        "echobase": VERSION,
        "exported": now(),
        "project": {"id": project.id, "name": project.name, "created": project.created},
        "inputs": _rows(session, InputRow, project_id, ("kind", "version", "sha256", "content", "created")),
        "scans": _rows(session, ScanRow, project_id, ("number", "sha256", "origin", "base", "path", "detail", "created")),
        "results": _rows(
            session, ResultRow, project_id,
            ("kind", "number", "sha256", "inputs", "options", "verdict", "summary", "accepted", "created"),
        ),
        "files": _members(list(files)),
        "journal": [_line(row) for row in lines(session, project_id)],
    }  # fmt: skip
    return {**content, "digest": digest_of(content)}


def _rows(session: Session, table: Any, project_id: str, columns: tuple[str, ...]) -> list[dict[str, Any]]:
    rows = session.scalars(select(table).where(table.project_id == project_id).order_by(table.id))
    return [{column: getattr(row, column) for column in columns} for row in rows]


def _line(row: Any) -> dict[str, Any]:
    return {"number": row.number, "at": row.at, "action": row.action, "detail": row.detail, "digest": row.digest}


def _members(files: list[FileRow]) -> list[dict[str, Any]]:
    """Return the files with a member name each: what people read, made harmless and unique."""
    taken = {MANIFEST}
    listed = []
    for row in files:
        folder = row.owner.replace(":", "-")
        parts = [safe_member(part) for part in row.name.split("/")]
        member, count = "/".join([folder, *parts]), 1
        while member.lower() in taken:
            count += 1
            member = "/".join([folder, *parts[:-1], f"{count}-{parts[-1]}"])
        taken.add(member.lower())
        listed.append({"owner": row.owner, "name": row.name, "member": member, "sha256": row.sha256, "size": row.size})
    return listed
