"""CAD files in every format, whole and damaged. Meshes are written by trimesh or by hand, never by the code under test."""

import io
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from planner.cad import load_part, read_part, save_part
from planner.cad.step import complaint, file_unit
from planner.errors import EchoBaseError
from planner.surface.select import inspection_surface
from sample_parts.make_samples import aerofoil_point, aerofoil_uv

SAMPLES = Path(__file__).parents[2] / "sample_parts"
PLATE = SAMPLES / "flat-plate" / "flat-plate.step"


def mesh() -> trimesh.Trimesh:
    part = trimesh.creation.cylinder(40.0, 25.0, sections=48)
    part.apply_translation([100, -20, 7])
    return part


def write(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def volume(part) -> float:
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def refusal(path: Path, unit: str | None = "mm", name: str | None = None):
    with pytest.raises(EchoBaseError) as error:
        read_part(path, name or path.name, unit)
    (issue,) = error.value.issues
    assert issue.where == (name or path.name)
    assert issue.remedy
    return issue


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "ply", "glb"])
def test_every_format_gives_the_same_part(tmp_path, kind):
    source = mesh()
    if kind == "glb":
        source.apply_scale(0.001)
    path = write(tmp_path, f"part.{kind.split('_')[0]}", source.export(file_type=kind))
    part = read_part(path, path.name, None if kind == "glb" else "mm")
    assert part.vertices.dtype == np.float64
    assert len(part.faces) == len(mesh().faces)
    assert len(part.vertices) == len(mesh().vertices)
    assert volume(part) == pytest.approx(mesh().volume, rel=1e-5)
    assert np.abs(part.vertices.min(axis=0) - mesh().bounds[0]).max() < 1e-3
    assert part.meta["closed_bodies"] == 1
    assert len(part.provenance.sha256) == 64


@pytest.mark.parametrize("unit, factor", [("mm", 1), ("cm", 10), ("m", 1000), ("inch", 25.4)])
def test_the_unit_scales(tmp_path, unit, factor):
    source = mesh()
    source.apply_scale(1 / factor)
    path = write(tmp_path, "part.stl", source.export(file_type="stl"))
    assert read_part(path, "part.stl", unit).extents_mm == pytest.approx(mesh().extents, rel=1e-5)


def test_step_plate_and_aerofoil_are_their_true_surfaces():
    plate = read_part(PLATE, "plate.step", None)
    assert plate.extents_mm == pytest.approx([150, 100, 10], abs=1e-4)
    assert (len(plate.vertices), len(plate.faces)) == (8, 12)
    assert plate.provenance.unit == "mm"
    assert volume(plate) == pytest.approx(150e3, rel=1e-6)
    skin = read_part(SAMPLES / "aerofoil" / "aerofoil.step", "aerofoil.step", "mm")
    outer = inspection_surface(skin)
    u, v = aerofoil_uv(outer.vertices[:, 0], outer.vertices[:, 1])
    assert np.abs(outer.vertices - aerofoil_point(u, v)).max() < 2e-4
    assert (outer.mean_normal_part[2], outer.area_mm2) == pytest.approx((0.997, 531_566.0), rel=1e-4)
    stl = read_part(SAMPLES / "aerofoil" / "aerofoil.stl", "aerofoil.stl", "mm")
    assert inspection_surface(stl).area_mm2 == pytest.approx(outer.area_mm2, rel=1e-5)
    assert skin.chord_error_mm < 0.011
    assert skin.meta["bodies"] == skin.meta["closed_bodies"] == 1


def test_step_in_metres_and_inches_has_the_same_size(tmp_path):
    text = PLATE.read_text()
    metre = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )"
    assert metre in text
    centi = write(tmp_path, "cm.step", text.replace(metre, metre.replace(".MILLI.", ".CENTI.")))
    part = read_part(centi, "cm.step", "cm")
    assert part.extents_mm == pytest.approx([1500, 1000, 100], abs=1e-3)
    assert refusal(centi, "mm").code == "unit-contradicts"
    assert refusal(PLATE, "inch").code == "unit-contradicts"
    assert file_unit(b"#1=(CONVERSION_BASED_UNIT('INCH',#2)LENGTH_UNIT()NAMED_UNIT(#3));") == "inch"
    # An inch is defined by a millimetre, which the file then holds too, and first.
    inch = (
        f"( CONVERSION_BASED_UNIT('INCH',#99002) LENGTH_UNIT() NAMED_UNIT(#99001) );\n#99000 = {metre};\n"
        "#99001 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n"
        "#99002 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#99000)"
    )
    inches = write(tmp_path, "inch.step", text.replace(metre, inch))
    assert read_part(inches, "inch.step", "inch").extents_mm == pytest.approx([3810, 2540, 254], abs=1e-3)
    assert refusal(inches, "mm").code == "unit-contradicts"
    assert file_unit(inches.read_text().replace("DATA;", f"DATA;\n#98000 = {metre};", 1).encode()) == "inch"


def test_a_missing_unit_lists_the_size_in_each():
    issue = refusal(SAMPLES / "aerofoil" / "aerofoil.stl", None)
    assert issue.code == "unit-missing"
    for text in ("1500 x 400.4 x 58.97 mm if in mm", "15 x 4.004 x 0.5897 m if in cm", "if in m;", "if in inch"):
        assert text in issue.message


def test_a_unit_wrong_by_a_thousand_is_named(tmp_path):
    big = refusal(SAMPLES / "flat-plate" / "flat-plate.stl", "m")
    assert (big.code, "wrong by 1000" in big.message) == ("part-size", True)
    path = write(tmp_path, "m.stl", mesh().apply_scale(0.001).export(file_type="stl"))
    small = refusal(path, "mm")
    assert (small.code, "wrong by 1000" in small.message) == ("part-size", True)
    glb = write(tmp_path, "mm.glb", mesh().export(file_type="glb"))
    assert "wrong by 1000" in refusal(glb, None).message


STL = mesh().export(file_type="stl")
ASCII = mesh().export(file_type="stl_ascii")
ASCII = ASCII.encode() if isinstance(ASCII, str) else ASCII


@pytest.mark.parametrize(
    "name, data, code",
    [
        ("a.stl", b"", "part-empty"),
        ("a.stl", STL[:-1], "part-truncated"),
        ("a.stl", STL[: len(STL) // 3], "part-truncated"),
        ("a.stl", STL + b"x", "part-not-a-mesh"),
        ("a.stl", bytes(80) + bytes(4), "part-empty"),
        ("a.stl", b"solid a\nendsolid a\n", "part-empty"),
        ("a.stl", ASCII[: len(ASCII) // 2], "part-truncated"),
        ("a.stl", ASCII.replace(b"endsolid", b""), "part-truncated"),
        ("a.stl", ASCII.replace(b"vertex ", b"vertex x", 1), "part-damaged"),
        ("a.stl", b"x_mm,y_mm,z_mm\n1,2,3\n" * 50, "part-not-a-mesh"),
        ("a.stl", b"<!DOCTYPE html><html><body>Not found</body></html>", "part-mismatch"),
        ("a.stl", PLATE.read_bytes(), "part-mismatch"),
        ("a.step", STL, "part-mismatch"),
        ("a.glb", STL, "part-mismatch"),
        ("a.ply", b"PK\x03\x04" + bytes(200), "part-mismatch"),
        ("a.3mf", b"PK\x03\x04", "part-format"),
        ("a", STL, "part-format"),
        ("a.obj", b"# nothing\n", "part-empty"),
        ("a.obj", b"v 0 0 0\nv 9 0 0\nv 0 9 0\n", "part-empty"),
        ("a.obj", b"v 0 0 0\nv 9 0 nan\nv 0 9 0\nf 1 2 3\n", "part-damaged"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "part-empty"),
        ("a.step", PLATE.read_bytes()[:9000], "part-truncated"),
        ("a.glb", b"glTF" + struct.pack("<II", 2, 900) + bytes(20), "part-truncated"),
    ],
)
def test_what_is_not_a_part_is_one_clear_sentence(tmp_path, name, data, code):
    assert refusal(write(tmp_path, name, data), None if name.endswith(("glb", "step")) else "mm").code == code


def test_nan_in_a_binary_stl_is_refused(tmp_path):
    data = bytearray(STL)
    data[84 + 12 : 84 + 16] = struct.pack("<f", float("nan"))
    assert refusal(write(tmp_path, "a.stl", bytes(data))).code == "part-damaged"


def test_a_missing_file_and_an_unknown_unit(tmp_path):
    assert refusal(tmp_path / "none.stl").code == "part-missing"
    assert refusal(write(tmp_path, "a.stl", STL), "furlong").code == "unit-unknown"


def test_what_open_cascade_complains_about_is_not_a_part(tmp_path):
    assert (
        complaint("all well\n*** ERR StepReaderData *** Pour Entite #12\n")
        == "*** ERR StepReaderData *** Pour Entite #12"
    )
    assert complaint("Transferring 1 roots\n") is None
    broken = PLATE.read_text().replace("CARTESIAN_POINT('',(0.,0.,0.))", "CARTESIAN_POINT('',(0.,abc,0.))")
    assert broken != PLATE.read_text()
    assert refusal(write(tmp_path, "a.step", broken), None).code in ("step-messages", "part-damaged", "reader-crash")


def test_inside_out_and_mixed_winding_are_set_right_and_said(tmp_path):
    inverted, mixed = mesh(), mesh()
    inverted.invert()
    part = read_part(write(tmp_path, "i.stl", inverted.export(file_type="stl")), "i.stl", "mm")
    assert volume(part) == pytest.approx(mesh().volume, rel=1e-5)
    assert any("inside out" in note for note in part.provenance.notes)
    mixed.faces[::3] = mixed.faces[::3, ::-1]
    part = read_part(write(tmp_path, "m.stl", mixed.export(file_type="stl")), "m.stl", "mm")
    assert volume(part) == pytest.approx(mesh().volume, rel=1e-5)
    assert any("against their neighbours" in note for note in part.provenance.notes)


def test_a_cavity_stays_a_cavity(tmp_path):
    hollow = trimesh.creation.box((60, 60, 60))
    void = trimesh.creation.icosphere(2, 20.0)
    void.invert()
    both = trimesh.util.concatenate([hollow, void])
    part = read_part(write(tmp_path, "h.stl", both.export(file_type="stl")), "h.stl", "mm")
    assert volume(part) == pytest.approx(60**3 - abs(void.volume), rel=1e-5)
    assert part.meta["bodies"] == 2


def test_double_and_degenerate_triangles_go_with_a_note(tmp_path):
    source = mesh()
    corners = np.concatenate([source.triangles, source.triangles[:5], source.triangles[:2, [0, 0, 1]]])
    soup = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners), process=False)
    part = read_part(write(tmp_path, "d.stl", soup.export(file_type="stl")), "d.stl", "mm")
    assert len(part.faces) == len(source.faces)
    assert [note.split()[0] for note in part.provenance.notes] == ["2", "5"]


def test_a_part_is_stored_and_loaded_as_it_was(tmp_path):
    part = read_part(SAMPLES / "flat-plate" / "flat-plate.stl", "flat-plate.stl", "mm")
    save_part(part, tmp_path / "part.npz")
    again = load_part(tmp_path / "part.npz")
    assert (again.vertices == part.vertices).all()
    assert (again.faces == part.faces).all()
    assert again.provenance == part.provenance
    assert np.isnan(again.chord_error_mm)
    (tmp_path / "part.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(EchoBaseError, match="cannot be read"):
        load_part(tmp_path / "part.npz")
    buffer = io.BytesIO()
    np.savez(buffer, vertices=np.array([{}], dtype=object), faces=part.faces, about=np.zeros(2, dtype=np.uint8))
    (tmp_path / "part.npz").write_bytes(buffer.getvalue())
    with pytest.raises(EchoBaseError, match="cannot be read"):
        load_part(tmp_path / "part.npz")
