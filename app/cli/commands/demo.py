"""`echobase demo`: plan, rehearse, align, and rehearse again with the corrected program."""

import argparse
from pathlib import Path
from typing import Any, Literal

from app import workflow
from app.cli.commands.align import pose_line, say_correction
from app.cli.run import DONE, FAILED, progress_printer, say, say_issues
from app.folder import clear_programs, write_artifacts
from app.samples import Sample, sample
from planner.issues import errors_in

KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Run the whole main job on a sample part; every figure is computed here and now, from simulated scans."""
    chosen, folder = sample(args.part), args.output
    progress = progress_printer(args)
    clear_programs(folder, "alignment", "inspection", "correction", "corrected", "scans", "assessment")
    say(
        args,
        f"Sample part {chosen.name}. All readings are simulated: pose noise 0.03 mm and 0.005 deg, ToF noise 0.01 mm.",
    )
    plan, artifacts = workflow.plan(
        workflow.PlanRequest(chosen.source, chosen.source.name, chosen.unit, chosen.setup), progress
    )
    write_artifacts(folder, artifacts)
    say_issues(args, list(plan.issues))
    if errors_in(plan.issues):
        return {"ok": False, "issues": [i.to_json() for i in plan.issues]}, FAILED
    found = _align(args, folder, chosen)
    say_correction(args, found.correction)
    say_issues(args, list(found.issues))
    applied = dict(zip(KEYS, chosen.hidden_offset, strict=True))
    say(args, f"applied    {pose_line(applied)}")
    if found.failed:
        return {"ok": False, **found.correction}, FAILED
    judged = _inspect_before_and_after(args, folder, chosen)
    for name in ("before", "after"):
        row = judged[name]
        say(
            args,
            f"{name:<10} scanned: ToF std {row['tof_std_mm']:.3f} mm, range {row['tof_range_mm']:.3f} mm, "
            f"within 2 dB {row['within_2db']:.1%}, over-spray {row['over_spray']:.1%}",
        )
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    say(args, f"written to {folder}: " + ", ".join(files))
    return {"ok": True, "applied": applied, "correction": found.correction, "assessment": judged, "files": files}, DONE


def _align(args: argparse.Namespace, folder: Path, chosen: Sample) -> workflow.Alignment:
    """Rehearse the alignment scan with the hidden offset and align."""
    scan = folder / "scans" / "alignment.csv"
    workflow.simulate(folder, workflow.SimulateOptions(chosen.hidden_offset, seed=1), scan, progress_printer(args))
    found = workflow.align(folder, [scan], workflow.AlignOptions.from_folder(folder), progress_printer(args))
    write_artifacts(folder, found.artifacts)
    return found


def _inspect_before_and_after(args: argparse.Namespace, folder: Path, chosen: Sample) -> dict[str, Any]:
    """Rehearse the nominal and the corrected inspection and judge the scans."""
    runs: tuple[tuple[Literal["inspection", "corrected"], str], ...] = (
        ("inspection", "before"),
        ("corrected", "after"),
    )
    for seed, (path, name) in enumerate(runs, start=2):
        options = workflow.SimulateOptions(chosen.hidden_offset, seed=seed, path=path)
        workflow.simulate(folder, options, folder / "scans" / f"{name}.csv", progress_printer(args))
    compared = workflow.AssessOptions(before=(folder / "scans" / "before.csv",))
    judged = workflow.assess(folder, [folder / "scans" / "after.csv"], compared, progress_printer(args))
    write_artifacts(folder, judged.artifacts)
    return judged.content
