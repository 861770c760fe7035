"""`echobase reproduce`."""

import argparse
from typing import Any

from app.cli.run import DONE, progress_printer, say
from app.steps.reproduce import aerofoil, flat_plate
from planner.errors import fail


def run(args: argparse.Namespace) -> tuple[dict[str, Any], int]:
    """Run one of the paper's experiments and print its table beside ours."""
    if not 1 <= args.seeds <= 1000:
        raise fail("seeds-range", "the number of seeds must be from 1 to 1000.", "Give --seeds 20, say.")
    experiment = {"flat-plate": flat_plate, "aerofoil": aerofoil}[args.experiment]
    table = experiment(args.seeds, progress_printer(args))
    for line in table.lines:
        say(args, line)
    return {"ok": True, **table.content}, DONE
