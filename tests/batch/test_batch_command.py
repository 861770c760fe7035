"""`echobase batch` over corrections, folders and scans of simulated parts, through files."""

import json
import shutil

import numpy as np
import pytest

from tests.loop.analytic_scanner import matrix
from tests.loop.chain import echobase, pose, read, six, write
from tests.loop.surfaces import plane, write_stl

BASE = {"x_mm": 1050, "y_mm": -80, "z_mm": 400, "a_deg": 12, "b_deg": 0.5, "c_deg": -0.4}
COMMON = np.array([1.1, -0.7, 1.0, 0.2, -0.4, 0.3])


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A plan, scans of six parts (the fourth 1.5 mm farther along y), and the corrections of the first two."""
    folder = tmp_path_factory.mktemp("batch")
    write_stl(folder / "plate.stl", *plane().mesh(3, 3))
    write(
        folder / "setup.json", {"base": BASE, "placement": pose([20, 15, 5, 3, 0, 0]), "tool": {"tcp": {"z_mm": 180}}}
    )
    out = folder / "out"
    plan = ("plan", folder / "plate.stl", "--unit", "mm", "--setup", folder / "setup.json", "-o", out)
    assert echobase(*plan) == 0
    rng = np.random.default_rng(1)
    offsets = COMMON + np.r_[np.full(3, 0.1), np.full(3, 0.02)] * rng.uniform(-1, 1, (6, 6))
    offsets[3, 1] += 1.5
    for i, offset in enumerate(offsets, start=1):
        args = ("--offset", ",".join(f"{v:.6f}" for v in offset), "--seed", i, "-o", folder / f"s{i}.csv")
        assert echobase("simulate", out, *args) == 0
    assert echobase("align", out, folder / "s1.csv") == 0
    shutil.copytree(out / "correction", folder / "first" / "correction")
    assert echobase("align", out, folder / "s2.csv") == 0
    shutil.copy(out / "correction" / "correction.json", folder / "second.json")
    return folder, offsets


def test_corrections_folders_and_scans_are_told_alike(parts, capsys):
    folder, offsets = parts
    items = [folder / "first", folder / "second.json", *(folder / f"s{i}.csv" for i in (3, 4, 5, 6))]
    before = (folder / "out" / "correction" / "correction.json").read_bytes()
    capsys.readouterr()
    assert echobase("batch", folder / "out", *items, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert (folder / "out" / "correction" / "correction.json").read_bytes() == before  # nothing else is touched
    content = read(folder / "out" / "batch.json")
    assert content["parts"] == said["parts"]
    assert [p["name"] for p in content["parts"]] == ["first", "second", "s3", "s4", "s5", "s6"]
    middle = np.median(offsets, axis=0)
    assert np.all(np.abs(six(content["common"]) - middle)[[0, 2, 3, 4, 5]] < [0.15, 0.1, 0.05, 0.05, 0.05])
    assert [i["where"] for i in content["issues"] if i["code"] == "batch-outlier"] == ["s4"]
    assert all(p["simulated"] for p in content["inputs"]["parts"] if p["name"] != "second")
    for kind in ("html", "pdf", "json", "csv"):
        assert (folder / "out" / "batch" / f"report.{kind}").stat().st_size > 500
    assert read(folder / "out" / "batch" / "patch.json") == content["patch"]
    html = (folder / "out" / "batch" / "report.html").read_text(encoding="utf-8")
    assert "4 sits 1." in html
    assert "further along y than the other 5" in html


def test_what_cannot_be_compared_is_left_out_and_named(parts, tmp_path, capsys):
    folder, _ = parts
    good = [folder / "first", folder / "s2.csv", folder / "s3.csv"]
    failed = write(tmp_path / "failed.json", {**read(folder / "second.json"), "verdict": "fail", "inputs": {
        **read(folder / "second.json")["inputs"], "scan_sha256": ["x"]}})  # fmt: skip
    other = read(folder / "second.json")
    other["inputs"]["plan_sha256"] = "0" * 64
    elsewhere = write(tmp_path / "elsewhere.json", other)
    capsys.readouterr()
    # second.json is the correction of s2.csv: one part, named twice.
    assert echobase("batch", folder / "out", *good, failed, elsewhere, folder / "second.json", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    left_out = {i["where"]: i["message"] for i in said["issues"] if i["code"] == "batch-left-out"}
    assert set(left_out) == {"failed", "elsewhere", "second"}
    assert "another plan" in left_out["elsewhere"]
    assert "named before" in left_out["second"]
    assert echobase("batch", folder / "out", folder / "first", elsewhere) == 1
    assert "needs two parts" in capsys.readouterr().err
    assert echobase("batch", folder / "out", folder / "nowhere.json", folder / "first") == 1
    broken = tmp_path / "broken.json"
    broken.write_text("{")
    assert echobase("batch", folder / "out", broken, folder / "first") == 1
    assert "correction.json" in capsys.readouterr().err


def test_shapes_of_sprung_parts_are_compared(parts, capsys):
    folder, offsets = parts
    for i in (1, 2, 3):
        args = ("--offset", ",".join(f"{v:.6f}" for v in offsets[i]), "--seed", 20 + i, "--spring-back", 0.6 * i)
        assert echobase("simulate", folder / "out", *args, "-o", folder / f"bent{i}.csv") == 0
    bent = [folder / f"bent{i}.csv" for i in (1, 2, 3)]
    capsys.readouterr()
    assert echobase("batch", folder / "out", *bent, "--non-rigid", "--json") == 0
    shape = json.loads(capsys.readouterr().out)["shape"]
    assert shape["parts"] == ["bent1", "bent2", "bent3"]
    # Spring-backs of one form, 0.6, 1.2 and 1.8 mm: the outer two are half of the middle one away from it.
    own = np.array(shape["own_rms_mm"])
    assert own[1] < 0.3 * min(own[0], own[2])
    assert own[[0, 2]] / shape["common_rms_mm"] == pytest.approx([0.5, 0.5], rel=0.3)
    html = (folder / "out" / "batch" / "report.html").read_text(encoding="utf-8")
    assert "The shape common to 3 parts" in html


def test_its_patch_is_given_on_to_the_next_plan(parts, tmp_path):
    folder, offsets = parts
    own = tmp_path / "own.json"
    scans = [folder / f"s{i}.csv" for i in (1, 2, 3, 5, 6)]
    assert echobase("batch", folder / "out", *scans, "-o", own) == 0
    patch, setup = read(own), read(folder / "setup.json")
    assert set(patch) == {"base", "fixture"}
    write(tmp_path / "more.json", {"fixture": {"sigma_deg": 0.9}, "standoff_mm": 21.5})
    plan = ("plan", folder / "plate.stl", "--unit", "mm", "--setup", folder / "setup.json", "-o", tmp_path / "next")
    assert echobase(*plan, "--patch", own, "--patch", tmp_path / "more.json") == 0
    made = read(tmp_path / "next" / "plan.json")["setup"]
    # BASE is where the parts were: nominal and the offset that they share.
    moved, meant = (matrix(six(b)) for b in (made["base"], BASE))
    meant = meant @ matrix(offsets[[0, 1, 2, 4, 5]].mean(axis=0))
    at = np.array([75.0, 50.0, 10.0, 1.0])
    assert np.linalg.norm((moved @ at - meant @ at)[:3]) < 0.25
    assert np.degrees(np.arccos(moved[:3, 2] @ meant[:3, 2])) < 0.05
    assert made["fixture"] == {**patch["fixture"], "sigma_deg": 0.9}
    assert made["standoff_mm"] == 21.5
    assert made["tool"]["tcp"]["z_mm"] == setup["tool"]["tcp"]["z_mm"]
    for wrong in ([1], {"fixture": {"sigma": 1}}, {"standoff_mm": "far"}):
        write(tmp_path / "wrong.json", wrong)
        assert echobase(*plan, "--patch", tmp_path / "wrong.json") == 1
