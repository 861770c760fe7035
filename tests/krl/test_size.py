"""Programs of any length: split into modules and loads, with numbers, and quickly."""

import json
import time
import zipfile
from io import BytesIO

import numpy as np
import polars as pl
import pytest

from kuka_export.bundle import bundle
from kuka_export.check import check_files
from kuka_export.export import export
from kuka_export.options import ProgramOptions
from kuka_export.profiles import PROFILES
from kuka_export.reader import read_program
from kuka_export.runsheet import run_sheet_html, run_sheet_text
from planner.toolpath import ToolPath
from tests.krl.paths import correction, raster, setup


def stacked(data: int, passes: int, step: float) -> ToolPath:
    return raster(data=data, passes=passes, step=step, wave=6.0)


@pytest.mark.parametrize("controller", ["krc2", "krc4", "krc5"])
def test_modules_hold_whole_passes_within_their_lines(controller: str):
    made = export(stacked(380, 20, 2.0), setup(controller, taught=False), "EB_BIG")
    motion = {n: d for n, d in made.files.items() if n[-7:-4].isdigit()}
    assert len(motion) > 2
    for name, data in motion.items():
        assert data.count(b"\n") <= PROFILES[controller].module_lines
        assert data.count(b";FOLD PASS") == data.count(b";ENDFOLD (PASS"), name
        assert b"PART" not in data
    assert len(made.program.loads) == 1
    assert check_files(made.files, controller) == []


@pytest.mark.parametrize("controller", ["krc2", "krc4"])
def test_a_pass_longer_than_a_module_goes_on_in_the_next_without_a_gap(controller: str):
    path = stacked(700, 2, 1.0)
    made = export(
        path, setup(controller, taught=False), "EB_BIG", options=ProgramOptions(module_lines=300, load_modules=30)
    )
    assert any(b"PASS 1 PART 2" in d for d in made.files.values())
    reading = read_program(made.files)
    assert reading.path.data_on.sum() == 2 * 699
    assert np.array_equal(reading.path.pass_id, path.pass_id)
    assert max(d.count(b"\n") for n, d in made.files.items() if n[-7:-4].isdigit()) <= 300


def test_what_does_not_fit_comes_in_loads_each_with_its_own_main_and_start():
    path = stacked(60, 12, 2.0)
    options = ProgramOptions(module_lines=200, load_modules=4)
    made = export(path, setup("krc4"), "EB_BIG", T_base_basecorr=correction(), options=options)
    loads = made.program.loads
    assert len(loads) > 1
    assert [i.code for i in made.issues if i.severity == "warning" and i.code == "krl-loads"] == ["krl-loads"]
    reading = read_program(made.files)
    assert reading.mains == tuple(load.main for load in loads)
    assert len(reading.axis_moves) == len(loads)
    starts = [row for row, _, _ in reading.axis_moves]
    assert all(reading.path.pass_id[r] != reading.path.pass_id[r - 1] for r in starts[1:])
    assert made.manifest["limits"]["used_modules"] <= 4
    # Every load runs alone: its own files are a program.
    for load in loads:
        own = {f: d for f, d in made.files.items() if f.rsplit(".", 1)[0] in (load.main, *load.modules)}
        assert read_program(own).base_number == reading.base_number


def test_two_megabytes_are_exported_and_proven_in_seconds():
    path = stacked(1000, 27, 1.5)
    start = time.perf_counter()
    made = export(path, setup("krc4", taught=False), "EB_BIG")
    took = time.perf_counter() - start
    assert made.proof.bytes > 1_700_000
    assert took < 6.0  # 0.6 s on an idle machine


@pytest.mark.slow
def test_three_hundred_thousand_poses_are_split_written_and_proven():
    path = stacked(3000, 100, 0.5)
    made = export(path, setup("krc4", taught=False), "EB_BIG")
    assert made.proof.poses == len(path) == 300_400
    assert len(made.program.loads) > 3
    assert all(load["bytes"] <= PROFILES["krc4"].load_bytes for load in made.manifest["loads"])


def test_the_zip_holds_modules_manifest_dense_path_and_run_sheet():
    path, s = stacked(30, 3, 2.0), setup("krc4")
    sent = path.take(np.flatnonzero((path.role != 2) | (np.arange(len(path)) % 2 == 0)))
    made = export(sent, s, "EB_ZIP", "part <b>7</b>", T_base_basecorr=correction())
    data = bundle(made, path, s, {"extra.txt": b"x"})
    assert data == bundle(made, path, s, {"extra.txt": b"x"})
    with zipfile.ZipFile(BytesIO(data)) as archive:
        names = set(archive.namelist())
        beside = {"manifest.json", "path.csv", "run_sheet.html", "run_sheet.txt", "extra.txt"}
        assert {f"krl/{n}" for n in made.files} | beside == names
        assert {n: archive.read(f"krl/{n}") for n in made.files} == made.files
        manifest = json.loads(archive.read("manifest.json"))
        table = pl.read_csv(archive.read("path.csv"))
        sheet, html = archive.read("run_sheet.txt").decode(), archive.read("run_sheet.html").decode()
    assert manifest["files"] == made.manifest["files"]
    assert table.columns == [
        "pass",
        "role",
        "x_mm",
        "y_mm",
        "z_mm",
        "a_deg",
        "b_deg",
        "c_deg",
        "nx",
        "ny",
        "nz",
        "standoff_mm",
    ]
    assert table.height == len(path)
    # The poses sent are rows of the dense path, number for number.
    rows = {tuple(r) for r in table.select("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg").rows()}
    assert {tuple(r) for r in read_program(made.files).poses.tolist()} <= rows
    beam = table.filter(pl.col("role") == "data")
    assert np.allclose(np.linalg.norm(beam.select("nx", "ny", "nz").to_numpy(), axis=1), 1.0, atol=2e-6)
    assert "TOOL_DATA[5]" in sheet
    assert "BASE_DATA[3]" in sheet
    assert "<b>7</b>" not in html
    assert run_sheet_text(made.program, made.proof, s) == sheet
    assert run_sheet_html(made.program, made.proof, s) == html
