"""A glance at an uploaded scan: what its first bytes say is refused at once, while the person still has the file at hand."""

import csv
import tempfile
import zlib
from pathlib import Path

from alignment.readers.columns import ALL_NAMES, layout
from alignment.readers.formats import HDF5, PARQUET, PCD, PLY, XYZ, parser_of
from app.store.blobs import Blob, BlobStore
from planner.errors import EchoBaseError, fail

HEAD_BYTES = 65_536
# What a file of each binary or headed kind begins with, or has near its beginning.
MARKS = {
    PARQUET: ("Parquet", lambda head: head.startswith(b"PAR1")),
    # A user block may come first; its size is a power of two from 512.
    HDF5: ("HDF5", lambda head: b"\x89HDF\r\n\x1a\n" in head),
    PLY: ("PLY", lambda head: head.startswith(b"ply")),
    PCD: ("PCD", lambda head: b"FIELDS" in head),
}
REMEDY = "Export the scan with the columns of docs/scan-formats.md: x_mm .. c_deg, law, tof_us, amplitude_pct."


def glance(blobs: BlobStore, name: str, blob: Blob) -> None:
    """Raise EchoBaseError if a file can be no scan: empty, of no known format, not what its name says, no table of one.

    Everything else is for the reader, which sees the whole file; nothing that it would take is refused here.
    """
    if not blob.size:
        raise fail("scan-empty", "the file is empty.", "Export the scan again.", name)
    with blobs.open(blob.sha256) as stream:
        head = stream.read(HEAD_BYTES)
    with tempfile.TemporaryDirectory(prefix="echobase-glance-") as folder:
        (Path(folder) / "head").write_bytes(head)
        parser = parser_of(Path(folder) / "head", name)
    if parser in MARKS:
        word, holds = MARKS[parser]
        if not holds(head):
            text = f"the name says {word}, but the file is none."
            raise fail("scan-format", text, "Send it under the name it was written with, or export it again.", name)
        return
    _text(head, name, parser)


def _text(head: bytes, name: str, parser: str) -> None:
    if head.startswith(b"\x1f\x8b"):
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, HEAD_BYTES)
        except zlib.error as error:
            raise fail(
                "scan-unreadable", f"the compressed file is damaged ({error}).", "Copy it again.", name
            ) from error
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise fail("csv-encoding", "the text is UTF-16.", "Save it as UTF-8 CSV.", name)
    if b"\0" in head:
        raise fail("scan-format", "the name says a table of text, but the file is none.", REMEDY, name)
    lines = (line.strip() for line in head.decode("utf-8-sig", errors="replace").splitlines())
    first = next((line for line in lines if line and not line.startswith(("#", "//"))), "")
    if not first and len(head) < HEAD_BYTES:
        raise fail("scan-empty", "there is no line of a table in the file.", "Export the scan again.", name)
    if parser != XYZ and first:
        _columns(first, name)


def _columns(header: str, name: str) -> None:
    """Raise EchoBaseError if no column of a CSV is one that a scan may have; one alone is enough to leave it to the reader."""
    cells = next(csv.reader([header]))
    if not ALL_NAMES & {cell.strip().lower() for cell in cells}:
        if other := _other_separator(header, name):
            raise other
        layout([cell for cell in cells if cell.strip()], name)


def _other_separator(header: str, name: str) -> EchoBaseError | None:
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if header.count(separator) > header.count(","):
            text = f"the columns are separated by {word}."
            remedy = "Save the file with commas between the columns and a decimal point."
            return fail("csv-separator", text, remedy, name)
    return None
