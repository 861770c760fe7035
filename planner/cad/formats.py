"""Which format a CAD file is in, by its name and by its first bytes; the two must agree."""

from pathlib import PurePosixPath
from typing import Literal

from planner.errors import EchoBaseError, fail

Format = Literal["stl", "step", "obj", "ply", "glb"]
SUFFIXES: dict[str, Format] = {
    ".stl": "stl",
    ".step": "step",
    ".stp": "step",
    ".obj": "obj",
    ".ply": "ply",
    ".glb": "glb",
}
WORDS: dict[str, str] = {"stl": "STL", "step": "STEP", "obj": "OBJ", "ply": "PLY", "glb": "GLB"}
# These carry their unit of length; the others are bare numbers.
WITH_UNIT: tuple[Format, ...] = ("step", "glb")
HEAD_BYTES = 1024
_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"PK\x03\x04", "a zip archive (or 3MF)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x89HDF", "an HDF5 file"),
    (b"PAR1", "a Parquet file"),
    (b"{", "a JSON file"),
    (b"version https://git-lfs", "a Git LFS pointer, not the file itself"),
)


def format_of(name: str, head: bytes, size: int) -> Format:
    """Return the format of a file called `name` that starts with `head` (up to 1 kB) and has `size` bytes.

    Raises EchoBaseError: `part-format` (not one we read), `part-empty` (0 bytes), `part-mismatch` (name and content differ).
    """
    suffix = PurePosixPath(name.replace("\\", "/")).suffix.lower()
    if suffix not in SUFFIXES:
        shown = f"'{suffix}' files" if suffix else "Files without an extension"
        raise fail(
            "part-format", f"{shown} are not read as CAD.", "Give STEP, STL, OBJ, PLY or GLB (a single file).", name
        )
    if size == 0:
        raise fail("part-empty", "The file has 0 bytes.", "Export or copy it again.", name)
    declared = SUFFIXES[suffix]
    found = _sniff(head)
    if found == declared or (found is None and declared in ("stl", "obj")):
        return declared
    raise mismatch(name, declared, WORDS.get(found or "", found))


def mismatch(name: str, declared: Format, found: str | None) -> EchoBaseError:
    """Return the error for a file whose content is not what its name says."""
    holds = f"holds {found}" if found else f"does not hold {WORDS[declared]} data"
    return fail(
        "part-mismatch",
        f"The file is named {WORDS[declared]} but {holds}.",
        "Export it again as CAD, or correct its name.",
        name,
    )


def _sniff(head: bytes) -> str | None:
    """Return a key of WORDS, or words for something else; None if it could be STL or OBJ."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.startswith(b"ISO-10303-21"):
        return "step"
    if head.startswith(b"glTF"):
        return "glb"
    if text.startswith((b"ply\n", b"ply\r")):
        return "ply"
    for magic, words in _OTHERS:
        if text.startswith(magic):
            return words
    low = text[:256].lower()
    if low.startswith(b"<"):
        return "a web page" if b"html" in low else "an XML file"
    return None
