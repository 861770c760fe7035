"""`echobase align --with`: two faces of a box, two plans, one correction in both inspection programs."""

import json

import numpy as np
import pytest
import trimesh

from kuka_export.reader import read_program
from tests.loop.chain import echobase

OFFSET = (0.9, -0.6, 0.8, 0.15, -0.5, 0.4)
SEEDS = {"top": "100,60,80", "side": "100,0,40"}


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("box")
    box = trimesh.creation.box((200.0, 120.0, 80.0))
    box.apply_translation((100.0, 60.0, 40.0))
    box.export(folder / "box.stl")
    for name, seed in SEEDS.items():
        assert echobase("plan", folder / "box.stl", "--unit", "mm", "--seed", seed, "-o", folder / name) == 0
        offset = ",".join(str(v) for v in OFFSET)
        scan = folder / f"{name}.csv"
        assert echobase("simulate", folder / name, "--offset", offset, "--seed", 4, "-o", scan) == 0
    return folder


def correction(folder):
    return json.loads((folder / "correction" / "correction.json").read_text())


def test_both_programs_get_the_one_correction(planned, capsys):
    top, side = planned / "top", planned / "side"
    capsys.readouterr()
    status = echobase("align", top, planned / "top.csv", "--with", side, planned / "side.csv", "--json")
    assert status == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["ok"]
    assert answer["together"][0]["directory"] == str(side)
    found = [correction(f) for f in (top, side)]
    assert found[0]["correction"] == found[1]["correction"] == answer["correction"]
    for one, other, name in ((found[0], found[1], "side"), (found[1], found[0], "top")):
        (said,) = one["inputs"]["together"]
        assert said["name"] == name
        assert said["plan_sha256"] == other["inputs"]["plan_sha256"]
        assert said["scan_sha256"] == other["inputs"]["scan_sha256"]
        assert [s["name"] for s in one["surfaces"]] == ["top", "side"]
        assert one["centroid_mm"] != other["centroid_mm"]
        assert not [i for i in one["issues"] if i["code"] == "programs-alike"]
    values = np.array(list(found[0]["correction"].values()))
    np.testing.assert_allclose(values[:3], OFFSET[:3], atol=0.08)
    np.testing.assert_allclose(values[3:], OFFSET[3:], atol=0.03)
    # Both were planned from box.stl: on the controller no module of one replaces one of the other.
    modules = [{p.stem for p in f.rglob("*.src")} for f in (top, side)]
    assert not modules[0] & modules[1]
    for folder in (top, side):
        files = {p.name: p.read_bytes() for p in (folder / "corrected").glob("*") if p.suffix in {".src", ".dat"}}
        # An untaught BASE: the program composes the correction with the controller's own.
        np.testing.assert_allclose(read_program(files).base_offset, values, atol=6e-4)
        assert "Surfaces aligned together" in (folder / "correction" / "report.html").read_text()


def test_together_is_surer_than_either_alone(planned, capsys):
    top, side = planned / "top", planned / "side"
    assert echobase("align", top, planned / "top.csv", "--with", side, planned / "side.csv") == 0
    joint = correction(top)["dof"]
    for folder, scan in ((top, "top.csv"), (side, "side.csv")):
        assert echobase("align", folder, planned / scan) == 0
        alone = correction(folder)
        assert alone["surfaces"] is None
        assert all(joint[k]["sigma"] < 1.05 * alone["dof"][k]["sigma"] for k in "xyzabc")
    capsys.readouterr()


@pytest.mark.parametrize(
    ("extra", "code"), [(("--non-rigid",), "rigid part"), (("--method", "keypoints"), "rigid part")]
)
def test_what_only_one_plan_can_is_refused(planned, capsys, extra, code):
    capsys.readouterr()
    top, side = planned / "top", planned / "side"
    assert echobase("align", top, planned / "top.csv", "--with", side, planned / "side.csv", *extra) == 1
    assert code in capsys.readouterr().err
    assert not (side / "corrected").exists()


def test_one_folder_twice_and_a_folder_without_a_scan(planned, capsys):
    top = planned / "top"
    assert echobase("align", top, planned / "top.csv", "--with", top, planned / "top.csv") == 1
    assert "named twice" in capsys.readouterr().err
    with pytest.raises(SystemExit) as left:
        echobase("align", top, planned / "top.csv", "--with", planned / "side")
    assert left.value.code == 2


def test_seeds_around_an_edge_say_what_to_do(planned, capsys, tmp_path):
    seeds = [a for seed in SEEDS.values() for a in ("--seed", seed)]
    capsys.readouterr()
    assert echobase("plan", planned / "box.stl", "--unit", "mm", *seeds, "-o", tmp_path / "both") == 1
    said = capsys.readouterr().err
    assert "90 deg" in said
    assert "--with" in said
    assert not (tmp_path / "both" / "plan.json").exists()
