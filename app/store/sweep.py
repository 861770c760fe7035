"""Keeps rows and blobs in step: drops what a crash left unnamed, reports what is named and gone."""

from dataclasses import dataclass

from sqlalchemy import select

from app.store.blobs import BlobStore
from app.store.database import Database
from app.store.tables import FileRow


@dataclass(frozen=True)
class Swept:
    """What a sweep found: temporary files and unnamed blobs removed, and SHA-256 of blobs that rows name but nobody has."""

    temporary: int
    unnamed: int
    missing: tuple[str, ...]


def sweep(db: Database, blobs: BlobStore) -> Swept:
    """Clean up at the start, before anything else writes."""
    temporary = 0
    for path in blobs.temporary.iterdir():
        if path.is_file():
            path.unlink(missing_ok=True)
            temporary += 1
    named = named_blobs(db)
    present = set(blobs.list())
    for sha256 in present - named:
        blobs.delete(sha256)
    return Swept(temporary, len(present - named), tuple(sorted(named - present)))


def collect(db: Database, blobs: BlobStore) -> int:
    """Delete the blobs that no row names; the caller makes sure that nobody is writing one."""
    unnamed = set(blobs.list()) - named_blobs(db)
    for sha256 in unnamed:
        blobs.delete(sha256)
    return len(unnamed)


def named_blobs(db: Database) -> set[str]:
    """Return the SHA-256 of every blob that a row names."""
    with db.read() as session:
        return set(session.scalars(select(FileRow.sha256).distinct()))
