"""`echobase plan`."""

import argparse
from typing import Any

from app import workflow
from app.cli.run import DONE, FAILED, progress_printer, say, say_issues
from app.folder import clear_programs, write_artifacts
from app.inputs import patched, read_keypoints, read_setup, with_box
from planner.errors import fail
from planner.issues import errors_in


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Plan both paths, write both programs; fail if either could not be written."""
    if not args.part.is_file():
        raise fail("file-missing", f"there is no file '{args.part.name}'.", "Check the path.", str(args.part))
    setup = patched(read_setup(args.setup), args.patch)
    if args.box is not None:
        setup = with_box(setup, args.box)
    keypoints = tuple(read_keypoints(args.keypoints)) if args.keypoints else ()
    # No old program survives a plan that fails.
    clear_programs(args.output, "alignment", "inspection", "correction", "corrected", "assessment")
    request = workflow.PlanRequest(args.part, args.part.name, args.unit, setup, keypoints, tuple(args.seed))
    plan, artifacts = workflow.plan(request, progress_printer(args))
    write_artifacts(args.output, artifacts)
    failed = bool(errors_in(plan.issues))
    _report(args, plan)
    result = {
        "ok": not failed,
        "directory": str(args.output),
        "files": sorted(artifacts),
        "issues": [i.to_json() for i in plan.issues],
        **{k: v for k, v in plan.summary.items() if k != "arrays_sha256"},
    }
    return result, FAILED if failed else DONE


def _report(args: argparse.Namespace, plan: workflow.Plan) -> None:
    size = " x ".join(f"{v:.1f}" for v in plan.part.extents_mm)
    say(args, f"part       {plan.part.provenance.name}: {size} mm, {len(plan.part.faces)} triangles")
    say(args, f"surface    {plan.surface.area_mm2 / 100:.1f} cm2")
    say(args, f"key points {len(plan.keypoints)}")
    for kind in ("alignment", "inspection"):
        path = plan.summary[kind]
        covered = path["coverage"]
        say(args, f"{kind:<10} {path['passes']} passes, {path['data_length_mm'] / 1000:.2f} m of data")
        for text in coverage_lines(covered, kind):
            say(args, f"           {text}")
        program = path["program"]
        if program:
            size = f"{program['bytes'] / 1024:.0f} kB of KRL"
            say(args, f"           {program['poses']} poses in {len(program['files'])} files, {size}")
    say_prediction(args, plan.summary["prediction"])
    say_issues(args, list(plan.issues))
    say(args, f"written to {args.output}")


def coverage_lines(covered: dict[str, Any], kind: str) -> list[str]:
    """Return what a path covers, what it does not and why, for people."""

    def cm2(name: str) -> str:
        return f"{covered[name] / 100:.1f}"

    kept = f", {cm2('kept_out_mm2')} cm2 kept out" if covered["kept_out_mm2"] > 0.0 else ""
    first = (
        f"covers {covered['share']:.1%}, within tolerance {covered['within_tolerance_share']:.1%}: "
        f"{cm2('within_tolerance_mm2')} of {cm2('area_mm2')} cm2{kept}"
    )
    if kind == "alignment":
        return [first]
    reasons = (
        ("margin_mm2", "in the edge margin"),
        ("beside_mm2", "beside keep-outs"),
        ("beyond_mm2", "seen by laws out of tolerance"),
        ("unexplained_mm2", "not reached by any pass"),
    )
    told = [f"{cm2(name)} {text}" for name, text in reasons if covered[name] >= 5.0]
    return [first, f"missed {cm2('missed_mm2')} cm2" + (": " + ", ".join(told) if told else "")]


def say_prediction(args: argparse.Namespace, prediction: dict[str, Any]) -> None:
    """Print the accuracy that the alignment scan will give, in one line per degree of freedom."""
    cells = [
        f"{k.upper()} {v['status']}" + (f" {v['sigma']:.3f}" if v["sigma"] is not None else "")
        for k, v in prediction["dof"].items()
    ]
    say(args, "predicted  " + ", ".join(cells) + " (1 s.d., mm and deg)")
    say(args, f"           largest normal error over the surface {prediction['normal_error_mm']:.3f} mm (2 s.d.)")
