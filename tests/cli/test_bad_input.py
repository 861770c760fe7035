"""Bad input: exit status 1 or 2, one clear sentence that says what to do, no traceback, nothing written that could be used."""

import json

import numpy as np
import pytest

from tests.loop.chain import echobase
from tests.loop.surfaces import plane, write_stl


@pytest.fixture
def plate(tmp_path):
    return write_stl(tmp_path / "plate.stl", *plane().mesh(3, 3))


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planned")
    part = write_stl(folder / "plate.stl", *plane().mesh(3, 3))
    assert echobase("plan", part, "--unit", "mm", "-o", folder / "out") == 0
    return folder / "out"


def failure(capsys, *args) -> str:
    """Run a command that must fail; return what it says."""
    capsys.readouterr()
    assert echobase(*args) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert "Traceback" not in said
    return said


def test_missing_unit_lists_the_size_in_each(capsys, plate, tmp_path):
    said = failure(capsys, "plan", plate, "-o", tmp_path / "out")
    for unit in ("mm", "cm", "m", "inch"):
        assert f"{unit}" in said
    assert "150" in said
    assert not (tmp_path / "out" / "plan.json").exists()


def test_unit_wrong_by_a_thousand_is_named(capsys, plate, tmp_path):
    said = failure(capsys, "plan", plate, "--unit", "m", "-o", tmp_path / "out")
    assert "mm" in said


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("text.stl", b"this is not a mesh at all"),
        ("page.stl", b"<!doctype html><html><body>404</body></html>"),
        ("empty.stl", b""),
        ("none.stl", b"\0" * 80 + b"\0\0\0\0"),
        ("part.step", b"ISO-10303-21; nothing more"),
        ("part.obj", b"# no faces\nv 0 0 0\n"),
        ("part.xyz", b"1 2 3\n"),
    ],
)
def test_what_is_not_a_part(capsys, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    said = failure(capsys, "plan", tmp_path / name, "--unit", "mm", "-o", tmp_path / "out")
    assert name in said


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ('{"standof_mm": 12}', ["standof_mm", "standoff_mm"]),
        ('{"probe": {"pitch": 0.6}}', ["probe.pitch", "pitch_mm"]),
        ('{"standoff_mm": "far"}', ["standoff_mm"]),
        ('{"standoff_mm": 12', ["not valid JSON"]),
        ('{"probe": {"elements": 1}}', ["step_mm"]),
        ('{"robot": "fanuc-m20"}', ["fanuc-m20", "kuka-kr16-l6-2"]),
    ],
)
def test_settings_that_are_wrong(capsys, plate, tmp_path, content, words):
    (tmp_path / "setup.json").write_text(content)
    said = failure(capsys, "plan", plate, "--unit", "mm", "--setup", tmp_path / "setup.json", "-o", tmp_path / "out")
    for word in words:
        assert word in said


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([{"id": "K1", "x_mm": 20, "y_mm": 30, "z_mm": 9}], ["K1", "9"]),
        ([{"id": "K1", "x_mm": 20, "y_mm": 30}], ["z_mm"]),
        ([{"id": "K1", "x_mm": 20, "y_mm": 30, "z_mm": 0}] * 2, ["K1", "twice"]),
    ],
)
def test_key_points_that_are_wrong(capsys, plate, tmp_path, points, words):
    (tmp_path / "keypoints.json").write_text(json.dumps(points))
    args = ("plan", plate, "--unit", "mm", "--keypoints", tmp_path / "keypoints.json", "-o", tmp_path / "out")
    said = failure(capsys, *args)
    for word in words:
        assert word in said


HEADER = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,law,tof_us,amplitude_pct"


def readings(law, tof) -> str:
    return "\n".join([HEADER, *(f"{i},2,15,0,0,180,{law},{tof},50" for i in range(40))])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER.replace("tof_us,", "") + "\n1,2,3,0,0,180,1,50\n", ["tof_us"]),
        (readings(law=1, tof=""), ["tof_us"]),
        (HEADER + "\n", ["no"]),
        (HEADER + "\n1,2,x,0,0,180,1,20,50\n", ["z_mm"]),
        (readings(law=99, tof=20), ["99", "law"]),
        ("not,a,scan\n1,2,3\n", ["x_mm"]),
    ],
)
def test_scans_that_are_wrong(capsys, planned, tmp_path, text, words):
    (tmp_path / "scan.csv").write_text(text)
    said = failure(capsys, "align", planned, tmp_path / "scan.csv")
    for word in words:
        assert word in said
    assert not (planned / "corrected").exists()


def test_a_failed_alignment_leaves_no_program(planned, tmp_path, capsys):
    """A scan of another part far away: correction.json says fail, no corrected program, exit status 1."""
    assert echobase("simulate", planned, "--offset=1,-1,1,0,0,0", "-o", tmp_path / "scan.csv") == 0
    assert echobase("align", planned, tmp_path / "scan.csv") == 0
    assert list((planned / "corrected").glob("*.src"))
    rows = np.genfromtxt(tmp_path / "scan.csv", delimiter=",", names=True)
    rows["x_mm"] += 4000.0
    header = ",".join(rows.dtype.names)
    np.savetxt(tmp_path / "far.csv", rows, delimiter=",", header=header, comments="", fmt="%.6f")
    assert echobase("align", planned, tmp_path / "far.csv") == 1
    content = json.loads((planned / "correction" / "correction.json").read_text())
    assert content["verdict"] == "fail"
    assert any(i["severity"] == "error" and i["remedy"] for i in content["issues"])
    assert (planned / "correction" / "report.html").stat().st_size > 1000
    assert not list((planned / "corrected").glob("*.src")) if (planned / "corrected").exists() else True
    capsys.readouterr()


@pytest.mark.parametrize(
    "args",
    [
        ("plan",),
        ("plan", "part.stl"),
        ("simulate", "x", "--offset", "1,2,3", "-o", "y"),
        ("simulate", "x", "--offset", "1,2,3,4,5,nan", "-o", "y"),
        ("align", "x"),
        ("align", "x", "y", "--method", "guess"),
        ("frobnicate",),
        ("reproduce", "moon"),
    ],
)
def test_wrong_usage_is_status_2(args, capsys):
    with pytest.raises(SystemExit) as caught:
        echobase(*args)
    assert caught.value.code == 2
    assert "usage: echobase" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["align", "simulate", "assess"])
def test_a_folder_without_a_plan(capsys, tmp_path, command):
    (tmp_path / "scan.csv").write_text(HEADER + "\n1,2,3,0,0,180,1,20,50\n")
    args = {"simulate": ("--offset=0,0,0,0,0,0", "-o", tmp_path / "s.csv")}.get(command, (tmp_path / "scan.csv",))
    said = failure(capsys, command, tmp_path, *args)
    assert "echobase plan" in said
    assert echobase("plan", tmp_path / "nothing.stl", "-o", tmp_path / "o") == 1


def test_errors_are_json_when_asked(capsys, tmp_path):
    assert echobase("plan", tmp_path / "nothing.stl", "--json", "-o", tmp_path / "o") == 1
    said = json.loads(capsys.readouterr().out)
    assert said["ok"] is False
    assert said["issues"][0]["code"] == "file-missing"
