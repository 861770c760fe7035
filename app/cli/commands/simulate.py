"""`echobase simulate`."""

import argparse
from typing import Any

from app import workflow
from app.cli.run import DONE, progress_printer, say


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Run an exported program on the simulated scanner and write the readings."""
    options = workflow.SimulateOptions(
        offset=args.offset,
        spring_back_mm=args.spring_back,
        seed=args.seed,
        path=args.path,
        outliers=args.outliers,
        dropouts=args.dropouts,
        latency_ms=args.latency_ms,
    )
    readings = workflow.simulate(args.directory, options, args.output, progress_printer(args))
    say(args, f"{readings} simulated readings of the {args.path} program written to {args.output}")
    return {"ok": True, "readings": readings, "file": str(args.output)}, DONE
