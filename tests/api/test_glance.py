"""What the beginning of a scan says is said at upload: refused in a sentence, nothing kept; all the rest is taken."""

import gzip

import pytest

from tests.api.conftest import error_of, new_project

TABLE = b"# a comment\n\nX_mm,law,tof_us\n1,2,3\n"
HOPELESS = {
    "empty.csv": (b"", ("scan-empty", "file-missing")),
    "blank.csv": (b"\n\n# only a comment\n", ("scan-empty",)),
    "photo.jpg": (b"\xff\xd8\xff\xe0\x00\x10JFIF", ("scan-format",)),
    "letter.pdf": (b"%PDF-1.7\n", ("scan-format",)),
    "sheet.csv": (b"PK\x03\x04\x14\x00\x00\x00", ("scan-format",)),
    "none.parquet": (TABLE, ("scan-format",)),
    "none.h5": (TABLE, ("scan-format",)),
    "none.ply": (TABLE, ("scan-format",)),
    "other.csv": (b"name,price\nbolt,3\n", ("column-missing",)),
    "german.csv": (b"x_mm;law;tof_us\n1,5;2;3\n", ("csv-separator",)),
    "tabs.csv": (b"x_mm\tlaw\n1\t2\n", ("csv-separator",)),
    "wide.csv": ("x_mm,law\n1,2\n".encode("utf-16"), ("csv-encoding",)),
    "broken.csv.gz": (b"\x1f\x8b" + b"nonsense" * 4, ("scan-unreadable",)),
    "none": (b"{}", ("scan-format",)),
}
TAKEN = {
    "scan.csv": TABLE,
    "bom.csv": b"\xef\xbb\xbfx_mm,law\n1,2\n",
    "scan.csv.gz": gzip.compress(TABLE),
    # A comment longer than what is looked at hides the header: that is for the reader.
    "long.csv": b"#" + b"c" * 100_000 + b"\n" + TABLE,
    "cloud.xyz": b"1 2 3\n4 5 6\n",
    "cloud.txt": b"// x y z\n1\t2\t3\n",
    "block.h5": b"\0" * 512 + b"\x89HDF\r\n\x1a\n" + b"\0" * 64,
    "cloud.pcd": b"# comment\nVERSION .7\nFIELDS x y z\n",
    "unnamed": TABLE.removeprefix(b"# a comment\n\n"),
}


@pytest.fixture(scope="module")
def address(client):
    return new_project(client, part=None)


@pytest.mark.parametrize("name", HOPELESS)
def test_what_can_be_no_scan_is_refused_and_nothing_is_kept(client, server, address, name):
    content, codes = HOPELESS[name]
    before = {p for p in (server.data / "blobs").rglob("*") if p.is_file()}
    kept = client.get(f"{address}/scans").json()
    error = error_of(client.post(f"{address}/scans", files={"file": (name, content)}), 422)
    assert error["code"] in codes
    assert error["remedy"]
    assert client.get(f"{address}/scans").json() == kept
    assert {p for p in (server.data / "blobs").rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", TAKEN)
def test_what_could_be_one_is_taken_as_it_came(client, address, name):
    made = client.post(f"{address}/scans", files={"file": (name, TAKEN[name])})
    assert made.status_code == 201, made.text
    assert client.get(f"{made.headers['Location']}/files/0").content == TAKEN[name]


def test_of_a_pair_the_wrong_one_is_named(client, address):
    pair = [("file", ("poses.csv", b"t_s,x_mm\n")), ("file", ("notes.csv", b"who,when\nme,now\n"))]
    error = error_of(client.post(f"{address}/scans", files=pair), 422)
    assert error["where"] == "notes.csv"
