"""Pictures of the alignment report: figures of the paper from data, the deviation, and the shape of a part that sprang back."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.plan import Plan
from app.report.compare import State
from app.report.document import Figure
from app.report.figures import Panel, Scale, Series, histograms_svg, maps_svg, states_svg
from app.report.sheet import Sheet, fill
from app.report.shown import limit_of
from planner.frames import Array

Drawn = tuple[Figure, str]


@dataclass(frozen=True, eq=False)
class Deviation:
    """Measured less expected position along the normal, of n patches at points_part (n, 3), mm; + is outside.

    before_mm, after_mm (n,): against the part where the plan believed it, and where it was found.
    """

    points_part: Array
    before_mm: Array
    after_mm: Array


@dataclass(frozen=True, eq=False)
class Shape:
    """The field of a part that sprang back at m places of equal area: displacement along the normal and its s.d., mm.

    supported (m,): the data determine it there.
    """

    points_part: Array
    values_mm: Array
    sigma_mm: Array
    supported: NDArray[np.bool_]


def deviation_maps(sheet: Sheet, found: Deviation, keypoints: Array) -> list[Drawn]:
    """Return the deviation before and after, each on a scale of its own. keypoints (k, 3), part, mm."""
    if not len(found.points_part):
        return []
    panels = []
    for title, values, least in (
        ("before, against the part as believed", found.before_mm, 0.05),
        ("after, against the part as found", found.after_mm, 0.02),
    ):
        limit = limit_of(values, least=least)
        scale = Scale("measured less expected (mm)", -limit, limit)
        panels.append(Panel(title, fill(sheet, found.points_part, values), scale))
    figure = Figure(
        name="deviation",
        caption="Deviation of the scanned surface along its outward normal, before and after the correction, each on its own "
        "scale. Circles: key points. Grey: not measured.",
        alt="Maps of the deviation over the part, before and after",
    )
    return [(figure, maps_svg(sheet, panels, sheet.uv(keypoints) if len(keypoints) else None))]


def inspection_maps(plan: Plan, sheet: Sheet, states: Sequence[State]) -> list[Drawn]:
    """Return the paper's Fig. 7 and 8: histograms, then ToF and amplitude over the part, in every state on one scale."""
    data = plan.inspection.take(plan.inspection.is_data)
    places, reach = data.Ts_part_contact.xyz_mm, 0.62 * pass_distance_mm(plan)
    off = [np.where(s.seen.on_part, s.seen.standoff_mm - plan.setup.standoff_mm, np.nan) for s in states]
    db = [np.where(s.seen.on_part, s.seen.db, np.nan) for s in states]
    limit, depth = limit_of(*off, least=0.05), limit_of(*db, least=0.1)
    tolerance, loss = plan.setup.tolerances.standoff_mm, plan.setup.tolerances.loss_db
    histogram = histograms_svg(
        [
            ("ToF less planned, mm", _series(states, off), (-tolerance, tolerance)),
            ("amplitude through tilt, dB", _series(states, db), (-loss,)),
        ],
        "poses",
    )
    out = [
        (
            Figure(
                name="histograms",
                caption="How many poses of the inspection meet which standoff error and which amplitude. Dashed: tolerances.",
                alt="Histograms of standoff error and amplitude in each state",
            ),
            histogram,
        )
    ]
    scales = (Scale("ToF less planned (mm)", -limit, limit), Scale("amplitude (dB)", -depth, 0.0))
    quantities = [
        [Panel(s.title, fill(sheet, places, v, reach), scale) for s, v in zip(states, values, strict=True)]
        for values, scale in zip((off, db), scales, strict=True)
    ]
    figure = Figure(
        name="inspection",
        caption="The inspection over the part: time of flight of the front wall as distance, less the planned standoff (the "
        "paper's Fig. 7), and its amplitude as the tilt leaves it, from the reference (the paper's Fig. 8). Centre law of each "
        "pose, drawn as wide as its pass.",
        alt="Maps of standoff error and amplitude over the part in each state",
    )
    return [*out, (figure, states_svg(sheet, quantities))]


def _series(states: Sequence[State], values: Sequence[Array]) -> list[Series]:
    return [Series(s.name, s.title, v) for s, v in zip(states, values, strict=True)]


def shape_maps(sheet: Sheet, shape: Shape) -> list[Drawn]:
    """Return the displacement of a part that sprang back and its standard deviation, where the data determine them."""
    on = shape.supported
    if not on.any():
        return []
    reach = 2.0 * np.sqrt(_area_per_point(sheet, len(shape.points_part)))
    limit = limit_of(shape.values_mm[on], least=0.05)
    sigma = limit_of(shape.sigma_mm[on], least=0.005)
    # A cell belongs to the support if most of what lies around it does.
    beyond = fill(sheet, shape.points_part, on.astype(np.float64), reach) < 0.5

    def cells(values: Array) -> Array:
        return np.where(beyond, np.nan, fill(sheet, shape.points_part, values, reach))

    panels = [
        Panel("displacement", cells(shape.values_mm), Scale("along the normal (mm)", -limit, limit)),
        Panel("its standard deviation", cells(shape.sigma_mm), Scale("one s.d. (mm)", 0.0, sigma)),
    ]
    figure = Figure(
        name="shape",
        caption="Shape of the part as measured, beyond the rigid correction, + outside the CAD, and how well it is known "
        "(posterior standard deviation). Grey: the scan does not determine it.",
        alt="Maps of the displacement field over the part and of its standard deviation",
    )
    return [(figure, maps_svg(sheet, panels))]


def pass_distance_mm(plan: Plan) -> float:
    """Return the distance of neighbouring passes as planned, mm."""
    inspection, probe = plan.setup.inspection, plan.setup.probe
    return inspection.step_mm if inspection.step_mm is not None else (1.0 - inspection.overlap) * probe.swath_mm


def _area_per_point(sheet: Sheet, n: int) -> float:
    return float(sheet.inside.sum()) * sheet.cell_mm**2 / max(n, 1)
