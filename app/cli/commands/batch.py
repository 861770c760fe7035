"""`echobase batch`."""

import argparse
from typing import Any

from app import workflow
from app.cli.run import DONE, progress_printer, say, say_issues
from app.folder import write_artifacts
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Compare serial parts; print what is common and each part's own, write batch.json and the report."""
    for path in args.parts:
        if not path.exists():
            raise fail("file-missing", f"there is no '{path.name}'.", "Check the path.", str(path))
    options = workflow.AlignOptions.from_folder(
        args.directory, edges=args.edges, non_rigid=args.non_rigid, base=args.base
    )
    result = workflow.batch(args.directory, args.parts, options, progress_printer(args))
    write_artifacts(args.directory, result.artifacts)
    content = result.content
    say(args, f"{len(content['parts'])} parts, axes of {content['frame']}")
    for d in content["directions"]:
        scatter = "scatter cannot be told" if d["scatter"] is None else _scatter(d)
        say(args, f"{d['name']:<10} common {d['mean']:+z.4g} +- {d['half_95']:.3g} {d['unit']} (95 %), {scatter}")
    for part in content["parts"]:
        own = (
            f"{k} {v['departure']:+z.3g} ({v['z']:+z.1f} sd)"
            for k, v in part["directions"].items()
            if v["z"] is not None
        )
        say(args, f"{part['name']:<20} " + "  ".join(own))
    shape = content["shape"]
    if shape is not None and shape["common_rms_mm"] is not None:
        own_mm = ", ".join("-" if v is None else f"{v:.3f}" for v in shape["own_rms_mm"])
        say(args, f"shape      common {shape['common_rms_mm']:.3f} mm rms; own {own_mm} mm rms")
    if content["patch"]:
        say(args, f"patch      {content['patch']}")
    say_issues(args, list(result.issues))
    if args.output is not None:
        write_artifacts(args.output.parent, {args.output.name: result.artifacts["batch/patch.json"]})
    say(args, f"written to {args.directory}/batch.json and {args.directory}/batch")
    return {"ok": True, "files": sorted(result.artifacts), **content}, DONE


def _scatter(d: dict[str, Any]) -> str:
    low, high = d["scatter_95"]
    return f"scatter {d['scatter']:.3g} {d['unit']} ({low:.2g} to {high:.2g})"
