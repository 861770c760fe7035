"""The paper's two experiments on the simulated scanner, the paper's figures beside ours.

Riise, Mineo, Pierce, Nicholson, Cooper: Adapting Robot Paths for Automated NDT of Complex Structures using Ultrasonic
Alignment. Everything but the paper's own figures is computed when asked for.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from alignment.correction import Correction
from alignment.estimate.align import align
from alignment.metrics import assess
from alignment.point_cloud import point_cloud
from alignment.simulator import Noise, Truth, simulate
from app.plan import Artifacts, Plan
from app.samples import sample
from app.steps.non_rigid import follow
from app.steps.plan import PlanRequest, run_plan
from app.steps.programs import active_base, export_path, program_name
from kuka_export.options import ProgramOptions
from kuka_export.reader import read_program
from planner.errors import EchoBaseError, fail
from planner.frames import Array, Transform
from planner.issues import errors_in
from planner.placement import corrected_base, part_from_correction
from planner.setup import Setup

Progress = Callable[[float, str], None]
NOISE_TEXT = "simulated: pose 0.03 mm and 0.005 deg, correlated over 10 mm; ToF 0.01 mm; amplitude 2 %"
PLATE_OFFSET = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)
PAPER_PLATE = {"x": 0.25, "y": 0.13, "z": 0.03, "a": 0.01, "b": 0.02, "c": 0.01}
PAPER_AEROFOIL = {"before": (2.06, 8.0), "after": (0.76, 3.7)}
AEROFOIL_OFFSET = (1.4, -1.9, -3.2, 0.12, 0.08, 1.3)


@dataclass(frozen=True)
class Table:
    """A table for people (`lines`) and the same as JSON (`content`)."""

    lines: tuple[str, ...]
    content: dict[str, Any]


@dataclass(frozen=True, eq=False)
class _Cell:
    """A planned sample part and its programs, in memory."""

    plan: Plan
    files: Artifacts

    def scan(
        self,
        kind: str,
        truth: Truth,
        seed: int,
        T_base_basecorr: Transform | None = None,
        files: Artifacts | None = None,
    ) -> Any:
        """Return the cloud of a simulated scan; with a correction the program runs in the corrected BASE."""
        files = self.files if files is None else files
        text = {n.split("/")[1]: b for n, b in files.items() if n.startswith(f"{kind}/") and n[-4:] in (".src", ".dat")}
        reading, setup = read_program(text), self.plan.setup
        base = active_base(reading, setup)
        if T_base_basecorr is not None:
            base = corrected_base(setup.T_world_base, T_base_basecorr)
        active = None if T_base_basecorr is None else base
        found = simulate(
            self.plan.part, self.plan.surface, reading.path, setup, truth, Noise(), seed, T_world_active=active
        )
        return point_cloud([found], setup)

    def align(self, cloud: Any, method: Any = "map", edges: bool = False) -> Correction:
        """Return the correction that a cloud gives."""
        p = self.plan
        return align(cloud, p.curved, p.keypoints, p.setup, p.inspection, method, edges)


def flat_plate(seeds: int, progress: Progress) -> Table:
    """Return errors of the correction on the flat plate: the paper's, and ours by three methods over some seeds."""
    cell = _cell("flat-plate", {}, progress)
    truth = Truth(Transform.from_xyzabc("base", "basecorr", PLATE_OFFSET))
    rows: dict[str, list[Array]] = {"key points": [], "MAP, surface only": [], "MAP with edges": []}
    status: dict[str, list[str]] = {}
    for k in range(seeds):
        progress((k + 0.5) / seeds, f"seed {k}")
        raster, crossing = cell.scan("inspection", truth, k), cell.scan("alignment", truth, k)
        for name, cloud, method, edges in (
            ("key points", raster, "keypoints", False),
            ("MAP, surface only", raster, "map", False),
            ("MAP with edges", crossing, "map", True),
        ):
            found = cell.align(cloud, method, edges)
            if found.T_base_basecorr is None:
                raise EchoBaseError(*errors_in(found.issues))
            rows[name].append(_plate_error(cell.plan, truth.T_base_basecorr, found.T_base_basecorr))
            status[name] = [a.status for a in found.axes]
    lines = [
        "Flat plate 150 x 100 x 10, offset X 1.1 Y -0.7 Z 1.0 mm, A 0.2 B -0.8 C 0.5 deg: |error|, median (95th percentile).",
        f"Noise {NOISE_TEXT}. Seeds 0 to {seeds - 1}. Z is the height of the face's centre, B and C the tilt of its normal.",
        f"{'':<20}" + "".join(f"{n:>18}" for n in ("X mm", "Y mm", "Z mm", "A deg", "B deg", "C deg")),
        f"{'paper':<20}" + "".join(f"{v:>18.2f}" for v in PAPER_PLATE.values()),
    ]
    content: dict[str, Any] = {"paper": PAPER_PLATE, "noise": NOISE_TEXT, "seeds": seeds}
    for name, errors in rows.items():
        e = np.abs(np.array(errors))
        mid, high = np.median(e, axis=0), np.percentile(e, 95, axis=0)
        cells = [
            "held" if s == "held" else f"{a:.3f} ({b:.3f})" for s, a, b in zip(status[name], mid, high, strict=True)
        ]
        lines.append(f"{name:<20}" + "".join(f"{c:>18}" for c in cells))
        content[name] = {"median": mid.tolist(), "p95": high.tolist(), "status": status[name]}
    return Table(tuple(lines), content)


def aerofoil(seeds: int, progress: Progress) -> Table:
    """Return the ToF spread of the full inspection scan of a sprung-back aerofoil, before and after each correction."""
    changes = {"probe": {"elements": 1, "beam_width_mm": 3.0}, "inspection": {"step_mm": 2.0}}
    cell = _cell("aerofoil", changes, progress)
    offset = Transform.from_xyzabc("base", "basecorr", AEROFOIL_OFFSET)
    # The field scales linearly: one trial tells the size that leaves the paper's rigid residual.
    progress(0.3, "sizing the spring-back")
    trial = _after(cell, Truth(offset, 1.0), 1000, "map")
    spring = PAPER_AEROFOIL["after"][0] / trial[0]
    truth = Truth(offset, spring)
    figures: dict[str, list[tuple[float, float]]] = {
        name: [] for name in ("no correction", "key points", "MAP, rigid", "MAP, non-rigid")
    }
    for k in range(seeds):
        progress(0.4 + 0.6 * k / seeds, f"seed {k}")
        figures["no correction"].append(_spread(cell, cell.scan("inspection", truth, k), truth))
        figures["key points"].append(_after(cell, truth, k, "keypoints"))
        figures["MAP, rigid"].append(_after(cell, truth, k, "map"))
        figures["MAP, non-rigid"].append(_after_following(cell, truth, k))
    lines = [
        f"Aerofoil 1.5 m, single crystal, 2 mm raster, sprung back by {spring:.2f} mm at most. ToF of the full scan, mm.",
        f"Noise {NOISE_TEXT}. Seeds 0 to {seeds - 1}; median (largest).",
        f"{'':<22}{'std':>18}{'range':>18}",
        f"{'paper, before':<22}{PAPER_AEROFOIL['before'][0]:>18.2f}{PAPER_AEROFOIL['before'][1]:>18.2f}",
        f"{'paper, after':<22}{PAPER_AEROFOIL['after'][0]:>18.2f}{PAPER_AEROFOIL['after'][1]:>18.2f}",
    ]
    content: dict[str, Any] = {"paper": PAPER_AEROFOIL, "noise": NOISE_TEXT, "seeds": seeds, "spring_back_mm": spring}
    for name, values in figures.items():
        v = np.array(values)
        mid, high = np.median(v, axis=0), v.max(axis=0)
        lines.append(f"{name:<22}{f'{mid[0]:.3f} ({high[0]:.3f})':>18}{f'{mid[1]:.2f} ({high[1]:.2f})':>18}")
        content[name] = {"tof_std_mm": v[:, 0].tolist(), "tof_range_mm": v[:, 1].tolist()}
    return Table(tuple(lines), content)


def _cell(name: str, changes: dict[str, Any], progress: Progress) -> _Cell:
    chosen = sample(name)
    setup = Setup.model_validate(chosen.setup.model_dump() | _merged(chosen.setup.model_dump(), changes))
    progress(0.0, "planning")
    plan, files = run_plan(PlanRequest(chosen.source, chosen.source.name, chosen.unit, setup), lambda f, t: None)
    if errors_in(plan.issues):
        raise EchoBaseError(*errors_in(plan.issues))
    return _Cell(plan, files)


def _merged(old: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    return {k: old[k] | v if isinstance(v, dict) else v for k, v in changes.items()}


def _plate_error(plan: Plan, applied: Transform, found: Transform) -> Array:
    """Return the error as X Y Z A B C: Z at the centre of the face, B and C the tilt of its normal."""
    T_base_base = found @ applied.inv()
    off, six = T_base_base.matrix, T_base_base.xyzabc
    centre = part_from_correction(applied, plan.setup.T_base_partnom).points(plan.surface.centroid_part)
    moved = off[:3, :3] @ centre + off[:3, 3] - centre
    return np.array([moved[0], moved[1], moved[2], six[3], six[4], six[5]])


def _after(cell: _Cell, truth: Truth, seed: int, method: str) -> tuple[float, float]:
    found = cell.align(cell.scan("alignment", truth, seed), method)
    if found.T_base_basecorr is None:
        raise fail("reproduce-failed", f"the {method} method found nothing on seed {seed}.", "Report this.")
    return _spread(cell, cell.scan("inspection", truth, seed + 500, found.T_base_basecorr), truth)


def _after_following(cell: _Cell, truth: Truth, seed: int) -> tuple[float, float]:
    """Return the spread that the program adapted to the part's shape leaves: it is exported, read back and run."""
    plan, cloud = cell.plan, cell.scan("alignment", truth, seed)
    rigid = align(cloud, plan.curved, plan.keypoints, plan.setup, plan.inspection, "map", None, True)
    followed = follow(plan, cloud, rigid, True)
    T = followed.found.T_base_basecorr
    if T is None or followed.found.failed:
        raise EchoBaseError(*errors_in(followed.found.issues))
    options = ProgramOptions(adapted=followed.adapted)
    name = program_name(plan, "corrected")
    program = export_path(plan, followed.sent, followed.dense, name, T_base_basecorr=T, options=options)
    return _spread(cell, cell.scan("corrected", truth, seed + 500, T, program.files), truth)


def _spread(cell: _Cell, cloud: Any, truth: Truth) -> tuple[float, float]:
    T_base_part = part_from_correction(truth.T_base_basecorr, cell.plan.setup.T_base_partnom)
    figures = assess(cloud, cell.plan.curved, cell.plan.setup, T_base_part).figures
    return figures.tof_std_mm, figures.tof_range_mm
