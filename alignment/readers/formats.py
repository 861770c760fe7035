"""Which parser reads which file: by the suffix of its name, else by its first bytes."""

from pathlib import Path

from planner.errors import fail

CSV = "delimited:parse_csv"
PARQUET = "columnar:parse_parquet"
HDF5 = "hdf5:parse_hdf5"
PLY = "ply:parse_ply"
PCD = "pcd:parse_pcd"
XYZ = "xyz:parse_xyz"

BY_SUFFIX = {
    ".csv": CSV,
    ".csv.gz": CSV,
    ".parquet": PARQUET,
    ".pq": PARQUET,
    ".h5": HDF5,
    ".hdf5": HDF5,
    ".hdf": HDF5,
    ".ply": PLY,
    ".pcd": PCD,
    ".xyz": XYZ,
    ".asc": XYZ,
    ".txt": XYZ,
}
BY_MAGIC = (
    (b"PAR1", PARQUET),
    (b"\x89HDF\r\n\x1a\n", HDF5),
    (b"ply", PLY),
    (b"# .PCD", PCD),
    (b"VERSION", PCD),
    (b"\x1f\x8b", CSV),
)


def parser_of(path: Path, name: str) -> str:
    """Return `"module:function"` of the parser, a module of this package, for a file; fail if the format is unknown."""
    lower = name.lower()
    for suffix in sorted(BY_SUFFIX, key=len, reverse=True):
        if lower.endswith(suffix):
            return BY_SUFFIX[suffix]
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
    except OSError as error:
        raise fail(
            "scan-unreadable", f"the file cannot be opened ({error.strerror}).", "Check the path.", name
        ) from error
    for magic, parser in BY_MAGIC:
        if head.startswith(magic):
            return parser
    if b"," in head.split(b"\n", 1)[0] and b"\0" not in head and head.lstrip()[:1] not in (b"{", b"["):
        return CSV
    known = ", ".join(sorted(BY_SUFFIX))
    raise fail("scan-format", "the format is not known.", f"EchoBase reads {known}.", name)
