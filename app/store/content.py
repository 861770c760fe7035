"""Reading and writing whole contents: digests that are checked, not believed."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from app.store.blobs import CHUNK, Blob, BlobStore, BlobWriter
from app.store.refusal import refuse

LARGEST_RESULT = 4 * 1024**3


def put_bytes(blobs: BlobStore, data: bytes) -> Blob:
    """Store bytes durably; return what identifies them."""
    with BlobWriter(blobs, LARGEST_RESULT) as writer:
        writer.write(data)
        return writer.finish()


def chunks(blobs: BlobStore, sha256: str) -> Iterator[bytes]:
    """Yield the content of a blob; raises Refusal 500 at its end if it is no longer what it was."""
    digest = hashlib.sha256()
    with blobs.open(sha256) as file:
        while data := file.read(CHUNK):
            digest.update(data)
            yield data
    if digest.hexdigest() != sha256:
        raise refuse(
            500, "file-damaged", f"the stored file {sha256[:12]} is damaged.", "Restore the data folder from a backup."
        )


def get_bytes(blobs: BlobStore, sha256: str) -> bytes:
    """Return the content of a blob, checked against its name."""
    return b"".join(chunks(blobs, sha256))


def canonical(value: Any) -> str:
    """Return the one JSON text of a value: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def digest_of(value: Any) -> str:
    """Return the SHA-256 of a value's canonical JSON."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def digest_of_files(files: Mapping[str, str] | Iterable[tuple[str, str]]) -> str:
    """Return the SHA-256 over (name, SHA-256) pairs, whatever their order."""
    return digest_of(sorted(dict(files).items()))
