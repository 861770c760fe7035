"""Downloads: always an attachment, never sniffed, with a name that any browser and any language can show."""

import io
import zipfile
from collections.abc import Mapping
from urllib.parse import quote

from fastapi import Response
from fastapi.responses import StreamingResponse

from app.store.blobs import BlobStore
from app.store.content import chunks
from app.store.names import safe_member


def disposition(name: str, kind: str = "attachment") -> str:
    """Return a Content-Disposition header (RFC 6266, RFC 8187): an ASCII name for all, the true one for those who can."""
    return f"{kind}; filename=\"{safe_member(name)}\"; filename*=UTF-8''{quote(name, safe='')}"


def attachment(content: bytes, name: str, media: str) -> Response:
    """Return bytes as a download."""
    return Response(
        content, media_type=media, headers={"Content-Disposition": disposition(name), "Cache-Control": "no-store"}
    )


def streamed(blobs: BlobStore, name: str, sha256: str, size: int) -> StreamingResponse:
    """Return a stored file as a download, piece by piece."""
    headers = {"Content-Disposition": disposition(name), "Content-Length": str(size), "Cache-Control": "no-store"}
    return StreamingResponse(chunks(blobs, sha256), media_type="application/octet-stream", headers=headers)


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP of names and contents; the same files give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content)
    return buffer.getvalue()
