"""The rehearsal: an exported program on the simulated scanner."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from alignment.simulator import Noise, Truth, simulate, write_readings_csv
from app.plan import load_plan
from app.steps.programs import active_base, read_folder
from planner.errors import fail
from planner.frames import Transform

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class SimulateOptions:
    """The hidden truth (`offset`: T_base_basecorr as X Y Z A B C, mm and deg) and what the cell adds to it."""

    offset: tuple[float, ...]
    spring_back_mm: float = 0.0
    seed: int = 0
    path: Literal["alignment", "inspection", "corrected"] = "alignment"
    outliers: float = 0.0
    dropouts: float = 0.0
    latency_ms: float = 0.0


def run_simulate(folder: Path, options: SimulateOptions, output: Path, progress: Progress) -> int:
    """Run the program's own text on the hidden part; write the readings CSV to `output`; return the number of readings."""
    if options.seed < 0:
        raise fail("seed-negative", "the seed of the noise must not be negative.", "Give 0, 1, 2, ...")
    progress(0.05, "reading plan and program")
    plan = load_plan(folder)
    reading = read_folder(folder, options.path)
    active = active_base(reading, plan.setup)
    progress(0.2, "scanning")
    noise = Noise(outliers=options.outliers, dropouts=options.dropouts, latency_ms=options.latency_ms)
    truth = Truth(Transform.from_xyzabc("base", "basecorr", options.offset), options.spring_back_mm)
    scan = simulate(
        plan.part,
        plan.surface,
        reading.path,
        plan.setup,
        truth,
        noise,
        options.seed,
        active if options.path == "corrected" else None,
    )
    progress(0.8, "writing the readings")
    output.parent.mkdir(parents=True, exist_ok=True)
    write_readings_csv(scan, output)
    progress(1.0, "scanned")
    return len(scan)
