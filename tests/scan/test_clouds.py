"""Point clouds from PLY, PCD, XYZ and CSV."""

import struct

import numpy as np
import pytest
import trimesh

from alignment.readers import read_scan
from alignment.readers.formats import parser_of
from alignment.readers.lzf import lzf_decompress
from alignment.readers.sandboxed import parse
from alignment.scan import SurfacePoints
from planner.errors import EchoBaseError
from tests.scan.files import write_csv

POINTS = np.random.default_rng(0).uniform(-200, 200, (300, 3)).astype(np.float32).astype(np.float64)
PLY = b"ply\nformat ascii 1.0\nelement vertex %d\n"
PLY_XYZ = b"property float x\nproperty float y\nproperty float z\n"
AMPLITUDE = np.linspace(10, 90, 300)


def check(cloud: SurfacePoints, amplitude: bool = False) -> None:
    assert isinstance(cloud, SurfacePoints)
    np.testing.assert_allclose(cloud.points_scan, POINTS, atol=1e-4)
    if amplitude:
        np.testing.assert_allclose(cloud.amplitude_pct, AMPLITUDE, atol=1e-4)
    else:
        assert cloud.amplitude_pct is None


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_written_by_another_library(tmp_path, encoding) -> None:
    trimesh.PointCloud(POINTS).export(tmp_path / "cloud.ply", encoding=encoding)
    check(read_scan([tmp_path / "cloud.ply"]))


def test_ply_with_properties_faces_and_big_endian(tmp_path) -> None:
    head = (
        "ply\nformat binary_big_endian 1.0\ncomment by hand\nelement vertex 300\nproperty double x\nproperty double y\n"
        "property double z\nproperty uchar red\nproperty float amplitude_pct\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    body = b"".join(struct.pack(">dddBf", *p, 7, a) for p, a in zip(POINTS, AMPLITUDE, strict=True))
    (tmp_path / "cloud.ply").write_bytes(head.encode() + body + struct.pack(">Biii", 3, 0, 1, 2))
    check(read_scan([tmp_path / "cloud.ply"]), amplitude=True)


def pcd(kind: str, body: bytes) -> bytes:
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z Amplitudes TimeofFlight\nSIZE 4 4 4 4 4\n"
        f"TYPE F F F F F\nCOUNT 1 1 1 1 1\nWIDTH 302\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 302\nDATA {kind}\n"
    )
    return head.encode() + body


def table() -> np.ndarray:
    rows = np.column_stack([POINTS, AMPLITUDE, np.full(300, 20.0)])
    gated_out = np.full((1, 5), np.nan)
    return np.vstack([gated_out, rows, gated_out]).astype("<f4")


def literal_lzf(data: bytes) -> bytes:
    """LZF without any back reference."""
    return b"".join(bytes([len(data[i : i + 32]) - 1]) + data[i : i + 32] for i in range(0, len(data), 32))


def test_pcd_in_its_three_encodings_with_gated_out_rows(tmp_path) -> None:
    rows = table()
    columns = rows.T.tobytes()
    packed = literal_lzf(columns)
    bodies = {
        "ascii": "\n".join(" ".join(f"{v:.7g}" for v in row) for row in rows).encode(),
        "binary": rows.tobytes(),
        "binary_compressed": struct.pack("<II", len(packed), len(columns)) + packed,
    }
    for kind, body in bodies.items():
        (tmp_path / "cloud.pcd").write_bytes(pcd(kind, body))
        cloud = read_scan([tmp_path / "cloud.pcd"])
        check(cloud, amplitude=True)
        np.testing.assert_allclose(cloud.tof_us, 20.0)
        assert "2 of 302 points" in cloud.issues[0].message


def test_lzf_back_references() -> None:
    # "abc", then 9 bytes from 3 back (overlapping), then "x"; then a long run of 20 from 1 back.
    packed = bytes([2]) + b"abc" + bytes([(7 << 5) | 0, 9 - 9, 2]) + bytes([0]) + b"x" + bytes([7 << 5, 20 - 9, 0])
    assert lzf_decompress(packed, 33, "t") == b"abc" + b"abcabcabc" + b"x" + b"x" * 20
    for damaged in (packed[:-1], bytes([32, 5]), packed + b"\x00y"):
        with pytest.raises(EchoBaseError):
            lzf_decompress(damaged, 33, "t")


def test_xyz_and_csv(tmp_path) -> None:
    rows = np.column_stack([POINTS, AMPLITUDE])
    (tmp_path / "plain.xyz").write_text("\n".join(" ".join(f"{v:.6f}" for v in row[:3]) for row in rows))
    check(read_scan([tmp_path / "plain.xyz"]))
    (tmp_path / "four.txt").write_text("# laser\n" + "\n".join("\t".join(f"{v:.6f}" for v in row) for row in rows))
    check(read_scan([tmp_path / "four.txt"]), amplitude=True)
    named = dict(zip(("x_mm", "y_mm", "z_mm", "amplitude_pct"), rows.T, strict=True))
    check(read_scan([write_csv(tmp_path / "cloud.csv", named)]), amplitude=True)
    (tmp_path / "head.xyz").write_text("x y z\n" + "\n".join(" ".join(f"{v:.6f}" for v in row[:3]) for row in rows))
    check(read_scan([tmp_path / "head.xyz"]))


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("a.ply", PLY % 9 + b"property float x\n", "ply-malformed"),
        ("a.ply", PLY % 2 + PLY_XYZ + b"end_header\n1 2 3\n", "ply-short"),
        ("a.ply", PLY % 1 + PLY_XYZ[:34] + b"end_header\n1 2\n", "column-missing"),
        ("a.pcd", b"VERSION 0.7\nFIELDS x y z\nDATA ascii\n1 2 3\n", "pcd-malformed"),
        ("a.pcd", b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 9\nDATA binary\n1234", "pcd-short"),
        ("a.xyz", b"1 2 3 4 5 6\n", "xyz-columns"),
        ("a.xyz", b"1 2 3\n1 2\n", "xyz-columns"),
        ("a.xyz", b"1 2 3\n1 2 three\n", "cell-not-a-number"),
        ("a.xyz", b"", "scan-empty"),
        ("a.csv", b"x_mm,y_mm,z_mm\nnan,1,2\n", "points-all-lost"),
    ],
)  # fmt: skip
def test_clouds_that_are_wrong(tmp_path, name, content, code) -> None:
    (tmp_path / name).write_bytes(content)
    path = tmp_path / name
    with pytest.raises(EchoBaseError) as caught:
        parse(path, {"parser": parser_of(path, name), "name": name})
    assert [issue.code for issue in caught.value.issues] == [code]


def test_a_cloud_in_metres_is_refused(tmp_path) -> None:
    line = np.column_stack([np.linspace(0, 1.2, 600), np.zeros(600), np.zeros(600)])
    np.savetxt(tmp_path / "m.xyz", line)
    with pytest.raises(EchoBaseError, match="metres"):
        read_scan([tmp_path / "m.xyz"])
