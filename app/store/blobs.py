"""Immutable files named by their SHA-256, on a local disk (durably) or on any object store that fsspec speaks."""

import hashlib
import os
import shutil
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol
from urllib.parse import unquote, urlparse

import fsspec

from app.store.refusal import refuse

CHUNK = 1024 * 1024
LINK_FROM_BYTES = 8 * CHUNK


@dataclass(frozen=True)
class Blob:
    """What identifies a stored file: its SHA-256 (hex) and its size in bytes."""

    sha256: str
    size: int


class BlobStore(Protocol):
    """Where blobs live."""

    temporary: Path
    """Local folder for files in the making; on a local store in the file system of the blobs."""

    def adopt(self, path: Path, blob: Blob) -> None:
        """Take over a complete, flushed local file; on return it is durable."""

    def open(self, sha256: str) -> IO[bytes]:
        """Open a blob for reading; raises Refusal 500 if it is not there."""

    def exists(self, sha256: str) -> bool:
        """True if the blob is there."""

    def copy_to(self, sha256: str, target: Path) -> None:
        """Make the content available as a local file."""

    def delete(self, sha256: str) -> None:
        """Remove a blob; nothing happens if it is not there."""

    def list(self) -> Iterator[str]:
        """Yield the SHA-256 of every blob."""


class BlobWriter:
    """Writes one blob: a temporary file, its digest computed on the way. Leave the `with` block unfinished to drop it."""

    def __init__(self, store: BlobStore, largest: int, min_free: int = 0, what: str = "file") -> None:
        self._store, self._largest, self._min_free, self._what = store, largest, min_free, what
        self._digest, self.size = hashlib.sha256(), 0
        handle, name = tempfile.mkstemp(dir=store.temporary, prefix="new-")
        self._file, self.path = os.fdopen(handle, "wb", buffering=0), Path(name)

    def __enter__(self) -> "BlobWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self.path.unlink(missing_ok=True)

    def write(self, data: bytes) -> None:
        """Append bytes; raises Refusal 413 beyond the largest size and 507 on a full disk."""
        self.size += len(data)
        if self.size > self._largest:
            limit = f"{self._largest / CHUNK:.0f} MiB" if self._largest >= CHUNK else f"{self._largest} bytes"
            raise refuse(
                413,
                "file-too-large",
                f"the {self._what} is larger than {limit}.",
                "Send a smaller one, or raise the limit.",
            )
        try:
            if shutil.disk_usage(self._store.temporary).free - len(data) < self._min_free:
                raise OSError(28, "No space left on device")
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            raise _disk_refusal(error) from error
        self._digest.update(data)

    def finish(self) -> Blob:
        """Make the blob durable: flushed, named, its folder flushed. Only then a row may speak of it."""
        blob = Blob(self._digest.hexdigest(), self.size)
        try:
            os.fsync(self._file.fileno())
            self._file.close()
            self._store.adopt(self.path, blob)
        except OSError as error:
            raise _disk_refusal(error) from error
        return blob


class LocalBlobs:
    """Blobs in a folder: `ab/abcdef...`; temporary files in `tmp/` of the same file system, so that a rename is atomic."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.temporary = root / "tmp"
        self.temporary.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()

    def path(self, sha256: str) -> Path:
        """Return where a blob is kept."""
        if len(sha256) != 64 or not set(sha256) <= set("0123456789abcdef"):
            raise ValueError("not a SHA-256")
        return self.root / sha256[:2] / sha256

    def adopt(self, path: Path, blob: Blob) -> None:
        """Rename the file to its place and flush the folders that name it."""
        target = self.path(blob.sha256)
        if not target.parent.exists():
            target.parent.mkdir(exist_ok=True)
            sync_folder(self.root)
        with self._lock:
            if not target.exists() or target.stat().st_size != blob.size:
                os.replace(path, target)
        # Also when it was there: whoever put it may not have flushed the folder yet.
        sync_folder(target.parent)

    def open(self, sha256: str) -> IO[bytes]:
        """Open a blob for reading."""
        try:
            return self.path(sha256).open("rb")
        except FileNotFoundError as error:
            raise _lost(sha256) from error

    def exists(self, sha256: str) -> bool:
        """True if the blob is there."""
        return self.path(sha256).exists()

    def copy_to(self, sha256: str, target: Path) -> None:
        """Copy a small blob, link a large one (scans, CAD: only ever read)."""
        source = self.path(sha256)
        try:
            if source.stat().st_size >= LINK_FROM_BYTES:
                try:
                    os.link(source, target)
                    return
                except OSError:
                    pass  # another file system: copy
            shutil.copyfile(source, target)
        except FileNotFoundError as error:
            raise _lost(sha256) from error

    def delete(self, sha256: str) -> None:
        """Remove a blob."""
        self.path(sha256).unlink(missing_ok=True)

    def list(self) -> Iterator[str]:
        """Yield the SHA-256 of every blob."""
        for folder in self.root.iterdir():
            if len(folder.name) == 2 and folder.is_dir():
                yield from (p.name for p in folder.iterdir() if len(p.name) == 64)


class RemoteBlobs:
    """Blobs on an object store. A finished put is durable there; files in the making stay local."""

    def __init__(self, url: str) -> None:
        self._fs, self._root = fsspec.core.url_to_fs(url)
        self.temporary = Path(tempfile.mkdtemp(prefix="echobase-"))

    def _name(self, sha256: str) -> str:
        return f"{self._root.rstrip('/')}/{sha256[:2]}/{sha256}"

    def adopt(self, path: Path, blob: Blob) -> None:
        """Upload the file; an object of the same name has the same content."""
        self._fs.makedirs(self._name(blob.sha256).rsplit("/", 1)[0], exist_ok=True)
        self._fs.put_file(str(path), self._name(blob.sha256))

    def open(self, sha256: str) -> IO[bytes]:
        """Open a blob for reading."""
        try:
            return self._fs.open(self._name(sha256), "rb")
        except FileNotFoundError as error:
            raise _lost(sha256) from error

    def exists(self, sha256: str) -> bool:
        """True if the blob is there."""
        return bool(self._fs.exists(self._name(sha256)))

    def copy_to(self, sha256: str, target: Path) -> None:
        """Download the content."""
        try:
            self._fs.get_file(self._name(sha256), str(target))
        except FileNotFoundError as error:
            raise _lost(sha256) from error

    def delete(self, sha256: str) -> None:
        """Remove a blob."""
        if self.exists(sha256):
            self._fs.rm_file(self._name(sha256))

    def list(self) -> Iterator[str]:
        """Yield the SHA-256 of every blob."""
        for name in self._fs.find(self._root):
            last = str(name).rsplit("/", 1)[-1]
            if len(last) == 64:
                yield last


def open_blobs(url: str) -> BlobStore:
    """Return the store behind a URL: file:///folder, or what fsspec knows (s3://, gs://, abfs://, memory://)."""
    parsed = urlparse(url)
    if parsed.scheme in ("", "file"):
        return LocalBlobs(Path(unquote(parsed.path)))
    return RemoteBlobs(url)


def sync_folder(folder: Path) -> None:
    """Flush a folder: only then a rename in it outlives a power cut."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _disk_refusal(error: OSError) -> Exception:
    if error.errno in (28, 122):  # ENOSPC, EDQUOT
        return refuse(507, "disk-full", "the disk is full; nothing was kept.", "Free some space and try again.")
    return error


def _lost(sha256: str) -> Exception:
    return refuse(
        500, "file-lost", f"the stored file {sha256[:12]} is missing.", "Restore the data folder from a backup."
    )
