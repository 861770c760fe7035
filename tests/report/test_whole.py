"""Reports of real alignments and assessments of the flat plate: what they say is what was computed, and nothing is left out."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from alignment.metrics import expected
from app import workflow
from app.folder import write_artifacts
from app.plan import load_plan
from app.samples import sample
from planner.frames import Transform
from planner.placement import corrected_base, part_from_correction

OFFSET = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)


@pytest.fixture(scope="module")
def cell(tmp_path_factory) -> Path:
    """A planned plate with an alignment scan, aligned, and inspected before and after."""
    folder = tmp_path_factory.mktemp("plate")
    chosen = sample("flat-plate")
    _, files = workflow.plan(workflow.PlanRequest(chosen.source, chosen.source.name, chosen.unit, chosen.setup))
    write_artifacts(folder, files)
    simulated(folder, "alignment", 1)
    (folder / "record.json").write_text(json.dumps({"part": {"serial": "SN-77"}}))
    aligned(folder)
    simulated(folder, "inspection", 2)
    simulated(folder, "corrected", 3)
    return folder


def simulated(folder: Path, path: str, seed: int, offset=OFFSET) -> Path:
    out = folder / "scans" / f"{path}.csv"
    workflow.simulate(folder, workflow.SimulateOptions(offset, seed=seed, path=path), out)
    return out


def aligned(folder: Path, **options) -> workflow.Alignment:
    chosen = workflow.AlignOptions.from_folder(folder, **options)
    found = workflow.align(folder, [folder / "scans" / "alignment.csv"], chosen)
    write_artifacts(folder, found.artifacts)
    return found


def test_the_report_says_what_was_computed(cell):
    content = json.loads((cell / "correction" / "correction.json").read_text())
    report = json.loads((cell / "correction" / "report.json").read_text())
    for name in ("before", "after"):
        for key, value in content["prediction"][name].items():
            assert report["comparison"][name][key] == pytest.approx(value, abs=1e-12)
    # No column is perfect: the estimate's own error is in all figures of it.
    after = report["comparison"]["after"]
    assert 0.0 < after["mean_abs_db"] < 0.05
    assert 90.0 < after["amplitude_improvement_pct"] < 100.0
    # The key-point method's column: the inspection seen from the BASE it asks for, computed here once more.
    plan = load_plan(cell)
    ours, keyed = (
        Transform.from_xyzabc(
            "base", "basecorr", [content[k][a] for a in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")]
        )
        for k in ("correction", "baseline")
    )
    T_base_part = part_from_correction(ours, plan.setup.T_base_partnom)
    left = Transform.from_matrix("base", "part", np.linalg.inv(keyed.matrix) @ T_base_part.matrix)
    seen = expected(plan.curved, plan.inspection, plan.setup, left)
    assert report["comparison"]["key points"]["tof_std_mm"] == pytest.approx(seen.summary.tof_std_mm, rel=1e-6)
    assert report["comparison"]["key points"]["tilt_max_deg"] == pytest.approx(seen.summary.tilt_max_deg, rel=1e-6)
    rows = {r["key point"]: r for r in report["tables"]["keypoints"]}
    assert [rows[k["id"]]["status"] for k in content["keypoints"]] == [k["status"] for k in content["keypoints"]]
    assert len(report["tables"]["directions"]) == 6
    assert report["record"]["part"]["serial"] == "SN-77"


def test_every_hash_is_of_the_bytes(cell):
    report = json.loads((cell / "correction" / "report.json").read_text())
    program = {row["file"]: row["SHA-256"] for row in report["tables"]["program"]}
    files = {p.name: p for p in (cell / "corrected").iterdir() if p.suffix in (".src", ".dat")}
    assert program == {name: hashlib.sha256(p.read_bytes()).hexdigest() for name, p in files.items()}
    inputs = {row["input"]: row["SHA-256, version"] for row in report["tables"]["inputs"]}
    scan, plan = (cell / p for p in ("scans/alignment.csv", "plan.json"))
    assert inputs["scan: alignment.csv"] == hashlib.sha256(scan.read_bytes()).hexdigest()
    assert inputs["plan"] == hashlib.sha256(plan.read_bytes()).hexdigest()


def test_the_page_is_whole_and_says_simulated(cell):
    page = (cell / "correction" / "report.html").read_text()
    assert ">SIMULATED</b>" in page
    assert "<script" not in page
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:)""", page)
    assert page.count("<figure") == page.count("<svg") == 3
    assert (cell / "correction" / "report.pdf").read_bytes().startswith(b"%PDF-")


def test_a_measured_scan_is_not_called_simulated(cell, tmp_path):
    measured = tmp_path / "measured.csv"
    pl.read_csv(cell / "scans" / "alignment.csv").drop("simulated").write_csv(measured)
    found = workflow.align(cell, [measured], workflow.AlignOptions())
    assert b"SIMULATED" not in found.artifacts["correction/report.html"]
    assert json.loads(found.artifacts["correction/report.json"])["simulated"] is False


def test_the_same_alignment_gives_the_same_bytes(cell):
    one, other = (
        workflow.align(cell, [cell / "scans" / "alignment.csv"], workflow.AlignOptions()).artifacts for _ in range(2)
    )
    assert {n: b for n, b in one.items() if "report" in n or "figures" in n} == {
        n: b for n, b in other.items() if "report" in n or "figures" in n
    }


def test_a_failed_alignment_has_a_report_and_no_program(cell, tmp_path):
    far = tmp_path / "far.csv"
    workflow.simulate(cell, workflow.SimulateOptions((0.0, 0.0, 9.0, 0.0, 6.0, 0.0), seed=5), far)
    found = workflow.align(cell, [far], workflow.AlignOptions())
    assert found.failed
    assert not [n for n in found.artifacts if n.startswith("corrected/")]
    page = found.artifacts["correction/report.html"].decode()
    assert "FAIL</b>" in page
    assert "program" not in json.loads(found.artifacts["correction/report.json"])["tables"]
    assert found.artifacts["correction/report.pdf"].startswith(b"%PDF-")


def test_an_inspection_in_several_files_is_one_inspection(cell, tmp_path):
    whole = cell / "scans" / "corrected.csv"
    table = pl.read_csv(whole)
    middle = int(table["pass"].max()) // 2
    halves = [tmp_path / "a.csv", tmp_path / "b.csv"]
    table.filter(pl.col("pass") <= middle).write_csv(halves[0])
    table.filter(pl.col("pass") > middle).write_csv(halves[1])
    before = (cell / "scans" / "inspection.csv",)
    one = workflow.assess(cell, [whole], workflow.AssessOptions(before))
    two = workflow.assess(cell, halves, workflow.AssessOptions(before))
    for key, value in one.content["after"].items():
        assert two.content["after"][key] == pytest.approx(value, rel=1e-9), key
    assert set(one.content) == {"after", "before", "improvement_pct"}
    report = json.loads(two.artifacts["assessment/report.json"])
    assert [row["scan"] for row in report["tables"]["scans"]] == [
        "before: inspection.csv",
        "scan: a.csv",
        "scan: b.csv",
    ]
    after, earlier = one.content["after"]["mean_abs_db"], one.content["before"]["mean_abs_db"]
    [row] = [r for r in report["tables"]["assessment"] if r["name"] == "Mean |dB|"]
    assert row["improvement"] == pytest.approx(100 * (earlier - after) / earlier)
    assert row["improvement"] == pytest.approx(one.content["improvement_pct"])


def test_the_base_that_a_file_cannot_say_can_be_said(cell, tmp_path):
    """Without its base_* columns the corrected scan is understood only if somebody says that BASE was corrected."""
    table = pl.read_csv(cell / "scans" / "corrected.csv")
    base = [c for c in table.columns if c.startswith("base_")]
    assert len(base) == 6
    correction = json.loads((cell / "correction" / "correction.json").read_text())["correction"]
    plan = load_plan(cell)
    six = [correction[k] for k in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")]
    T = corrected_base(plan.setup.T_world_base, Transform.from_xyzabc("base", "basecorr", six))
    np.testing.assert_allclose(table.select(base).row(0), T.xyzabc, atol=2e-3)
    silent = tmp_path / "silent.csv"
    table.drop(base).write_csv(silent)
    said = workflow.assess(cell, [silent], workflow.AssessOptions(base="corrected")).content["after"]
    whole = workflow.assess(cell, [cell / "scans" / "corrected.csv"], workflow.AssessOptions()).content["after"]
    # ToF does not depend on where the part is taken to be; what lies on the part does.
    assert said["over_spray"] == pytest.approx(whole["over_spray"], abs=2e-3)
    assert said["tof_std_mm"] == pytest.approx(whole["tof_std_mm"], rel=0.02)
