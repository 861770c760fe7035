"""Scans of several surfaces of one part, each planned by itself: one correction, applied to every plan's inspection."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from alignment.estimate.several import SurfaceScan, align_several
from app.steps.align import Alignment, AlignOptions, Prepared, Progress, complete, prepare
from app.steps.programs import program_name
from planner.errors import fail
from planner.issues import Issue


@dataclass(frozen=True)
class PlanScans:
    """A plan folder and its scans. name: what people call the plan; options as for an alignment by itself."""

    folder: Path
    scans: Sequence[Path]
    options: AlignOptions
    name: str


def run_align_together(items: Sequence[PlanScans], progress: Progress) -> list[Alignment]:
    """Return one alignment per plan, in order, all of the same placement of the part.

    The options of the first say method and edges. Raises EchoBaseError where the plans cannot be aligned together
    (another part, another believed place, another probe), and for what only one plan can be aligned with.
    """
    first = items[0].options
    if first.method != "map" or any(i.options.non_rigid for i in items):
        raise fail(
            "together-rigid-only",
            "scans of several plans are aligned together as one rigid part, by the MAP method.",
            "Leave out --non-rigid and --method keypoints; or align each plan by itself.",
        )
    folders = [i.folder.resolve() for i in items]
    if len(set(folders)) < len(folders):
        raise fail("plan-twice", "a plan is named twice.", "Give all scans of one plan beside its folder, once.")
    progress(0.02, "reading plans and scans")
    given = [prepare(i.folder, i.scans, i.options) for i in items]
    progress(0.3, "aligning together")
    scans = [
        SurfaceScan(i.name, g.cloud, g.plan.curved, g.plan.keypoints, g.plan.setup, g.plan.inspection)
        for i, g in zip(items, given, strict=True)
    ]
    found = align_several(scans, first.edges)
    said = [_said(i.name, g) for i, g in zip(items, given, strict=True)]
    out = []
    for k, (one, rigid) in enumerate(zip(given, found, strict=True)):
        low, step = 0.4 + 0.6 * k / len(given), 0.6 / len(given)

        def part(share: float, text: str, low: float = low, step: float = step, name: str = items[k].name) -> None:
            progress(low + step * share, f"{name}: {text}")

        warned = replace(rigid, issues=(*rigid.issues, *_same_names(k, items, given)))
        out.append(complete(one, warned, False, part, [s for n, s in enumerate(said) if n != k]))
    return out


def _same_names(k: int, items: Sequence[PlanScans], given: Sequence[Prepared]) -> list[Issue]:
    """Return a warning where another plan's programs are called as those of plan k: one would replace the other."""
    names = [program_name(g.plan, "corrected") for g in given]
    alike = [f"'{item.name}'" for n, item in enumerate(items) if n != k and names[n] == names[k]]
    if not alike:
        return []
    text = f"the programs of {' and '.join(alike)} are called {names[k]} too: on the controller one replaces the other."
    remedy = "Load one inspection after the other; or plan one of them with another program_name in its setup."
    return [Issue("warning", "programs-alike", text, remedy, "corrected")]


def _said(name: str, given: Prepared) -> dict[str, Any]:
    return {"name": name, "plan_sha256": given.plan.sha256, "scan_sha256": [s.sha256 for s in given.read]}
