"""The tables. Rows are what changes; file contents are blobs, named in `FileRow` by their SHA-256."""

from typing import Any

from sqlalchemy import JSON, BigInteger, ForeignKey, Index, Integer, String, Text, UniqueConstraint
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

INPUT_KINDS = ("part", "setup", "surface", "keypoints")
RESULT_KINDS = ("plan", "alignment", "assessment", "calibration")
JOB_STATES = ("queued", "running", "done", "failed", "cancelled")


class Base(DeclarativeBase):
    """Declarative base; `Base.metadata` is what the migrations must lead to."""

    type_annotation_map = {dict[str, Any]: JSON, list[Any]: JSON}  # noqa: RUF012 - SQLAlchemy's own protocol


def _project() -> Any:
    return mapped_column(String(20), ForeignKey("projects.id", ondelete="CASCADE"), index=True)


class ProjectRow(Base):
    """A project. `version` counts its edits: the ETag."""

    __tablename__ = "projects"
    id: Mapped[str] = mapped_column(String(20), primary_key=True)
    name: Mapped[str] = mapped_column(String(200))
    version: Mapped[int] = mapped_column(Integer)
    created: Mapped[str] = mapped_column(String(32))
    changed: Mapped[str] = mapped_column(String(32))


class InputRow(Base):
    """One version of an input; the highest is in force. `content` is its JSON text, or for a part its properties."""

    __tablename__ = "inputs"
    __table_args__ = (UniqueConstraint("project_id", "kind", "version"),)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    project_id: Mapped[str] = _project()
    kind: Mapped[str] = mapped_column(String(16))
    version: Mapped[int] = mapped_column(Integer)
    sha256: Mapped[str] = mapped_column(String(64))
    content: Mapped[str] = mapped_column(Text)
    created: Mapped[str] = mapped_column(String(32))


class ScanRow(Base):
    """An uploaded or simulated scan: one file, or poses and readings. Never changed."""

    __tablename__ = "scans"
    __table_args__ = (UniqueConstraint("project_id", "number"),)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    project_id: Mapped[str] = _project()
    number: Mapped[int] = mapped_column(Integer)
    sha256: Mapped[str] = mapped_column(String(64))
    """Digest over the names and digests of its files."""
    origin: Mapped[str] = mapped_column(String(16))
    base: Mapped[str | None] = mapped_column(String(16))
    path: Mapped[str | None] = mapped_column(String(16))
    detail: Mapped[dict[str, Any]]
    created: Mapped[str] = mapped_column(String(32))


class ResultRow(Base):
    """A plan, an alignment, an assessment or a calibration, with the digests of what it was made from."""

    __tablename__ = "results"
    __table_args__ = (UniqueConstraint("project_id", "kind", "number"),)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    project_id: Mapped[str] = _project()
    kind: Mapped[str] = mapped_column(String(16))
    number: Mapped[int] = mapped_column(Integer)
    sha256: Mapped[str] = mapped_column(String(64))
    """Digest over the names and digests of its files."""
    inputs: Mapped[dict[str, Any]]
    options: Mapped[dict[str, Any]]
    verdict: Mapped[str] = mapped_column(String(16))
    summary: Mapped[dict[str, Any]]
    accepted: Mapped[dict[str, Any] | None] = mapped_column(JSON)
    created: Mapped[str] = mapped_column(String(32))


class FileRow(Base):
    """A named file of something that owns it (`part:2`, `scan:1`, `plan:3`, `alignment:1`)."""

    __tablename__ = "files"
    __table_args__ = (UniqueConstraint("project_id", "owner", "name"),)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    project_id: Mapped[str] = _project()
    owner: Mapped[str] = mapped_column(String(40))
    name: Mapped[str] = mapped_column(String(700))
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    size: Mapped[int] = mapped_column(BigInteger)


class JobRow(Base):
    """A piece of slow work. `key` is the digest of everything it depends on: the same work is not done twice."""

    __tablename__ = "jobs"
    __table_args__ = (Index("jobs_key", "project_id", "key"), Index("jobs_state", "state"))
    id: Mapped[str] = mapped_column(String(20), primary_key=True)
    project_id: Mapped[str] = _project()
    kind: Mapped[str] = mapped_column(String(16))
    key: Mapped[str] = mapped_column(String(64))
    state: Mapped[str] = mapped_column(String(16))
    spec: Mapped[dict[str, Any]]
    attempts: Mapped[int] = mapped_column(Integer)
    result: Mapped[dict[str, Any] | None] = mapped_column(JSON)
    issues: Mapped[list[Any]]
    created: Mapped[str] = mapped_column(String(32))
    changed: Mapped[str] = mapped_column(String(32))


class JournalRow(Base):
    """One line of the append-only journal; `digest` covers the line and the digest before it. Outlives the project."""

    __tablename__ = "journal"
    __table_args__ = (UniqueConstraint("project_id", "number"),)
    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    project_id: Mapped[str] = mapped_column(String(20))
    number: Mapped[int] = mapped_column(Integer)
    at: Mapped[str] = mapped_column(String(32))
    action: Mapped[str] = mapped_column(String(40))
    detail: Mapped[dict[str, Any]]
    digest: Mapped[str] = mapped_column(String(64))
