"""One function per engineer's step. REST, the page, the command line and the tests call these and nothing below them.

Every function takes `progress(fraction, text)`, which may raise to cancel. Files come back as `Artifacts`
(relative name -> bytes), so that a folder and a content-addressed store are served alike.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from app.plan import Artifacts, Plan, load_plan, plan_artifacts
from app.steps.align import Alignment, AlignOptions, run_align
from app.steps.assess import AssessmentResult, AssessOptions, run_assess
from app.steps.batch import BatchResult, run_batch
from app.steps.plan import PlanRequest, run_plan
from app.steps.simulate import SimulateOptions, run_simulate
from app.steps.together import PlanScans, run_align_together
from planner.cad import read_part
from planner.keypoint import KeyPoint
from planner.part import Part
from planner.path.keypoints import suggest
from planner.setup import Setup
from planner.surface.choose import chosen_surface
from planner.surface.curved import CurvedSurface, footprint_mm
from planner.surface.inspection import InspectionSurface

Progress = Callable[[float, str], None]

__all__ = [
    "AlignOptions",
    "Alignment",
    "Artifacts",
    "AssessOptions",
    "AssessmentResult",
    "BatchResult",
    "Plan",
    "PlanRequest",
    "PlanScans",
    "Progress",
    "SimulateOptions",
    "align",
    "align_together",
    "assess",
    "batch",
    "choose_surface",
    "load_plan",
    "open_part",
    "plan",
    "plan_artifacts",
    "silent",
    "simulate",
    "suggest_keypoints",
]


def silent(fraction: float, text: str) -> None:
    """Report nothing."""


def open_part(source: Path, name: str, unit: str | None) -> Part:
    """Read CAD in a disposable child process; raise EchoBaseError with a remedy for whatever is wrong with it."""
    return read_part(source, name, unit)


def choose_surface(
    part: Part, setup: Setup, seeds_part: Sequence[tuple[float, float, float]] = ()
) -> InspectionSurface:
    """Return the inspection surface: flooded from the seeds (CAD, mm), or the largest, cut to the setup's box and paint."""
    return chosen_surface(part, setup, list(seeds_part))


def suggest_keypoints(
    part: Part, setup: Setup, seeds_part: Sequence[tuple[float, float, float]] = ()
) -> list[KeyPoint]:
    """Return key points whose alignment scan covers what the setup asks for."""
    surface = choose_surface(part, setup, seeds_part)
    return list(suggest(CurvedSurface(surface, footprint_mm(setup.probe)), setup))


def plan(request: PlanRequest, progress: Progress = silent) -> tuple[Plan, Artifacts]:
    """Plan both paths and export both programs.

    The plan's error-level issues say why a program is missing from the artifacts; raises EchoBaseError where there is
    nothing to show at all (unreadable part, no surface).
    """
    return run_plan(request, progress)


def simulate(folder: Path, options: SimulateOptions, output: Path, progress: Progress = silent) -> int:
    """Run an exported program of a plan folder on the simulated scanner; write the CSV, return the number of readings."""
    return run_simulate(folder, options, output, progress)


def align(folder: Path, scans: Sequence[Path], options: AlignOptions, progress: Progress = silent) -> Alignment:
    """Find the part; return the correction, its report and, unless it failed, the corrected program."""
    return run_align(folder, scans, options, progress)


def align_together(items: Sequence[PlanScans], progress: Progress = silent) -> list[Alignment]:
    """Find one part by the scans of several of its surfaces, each with its plan; return one alignment per plan, in order."""
    return run_align_together(items, progress)


def assess(
    folder: Path, scans: Sequence[Path], options: AssessOptions, progress: Progress = silent
) -> AssessmentResult:
    """Judge an inspection scan, in one file or more, against the plan, and against the one from before."""
    return run_assess(folder, scans, options, progress)


def batch(folder: Path, parts: Sequence[Path], options: AlignOptions, progress: Progress = silent) -> BatchResult:
    """Compare serial parts on one fixture: each a correction.json, a folder with one, or a scan that is aligned now."""
    return run_batch(folder, parts, options, progress)
