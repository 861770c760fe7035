"""The report of an inspection scan: the paper's Fig. 8 from data, before and after."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from alignment.metrics import Assessment
from app.plan import Plan
from app.report.document import Cell, Column, Document, Figure, Heading, Signatures, Table, Text, Verdict
from app.report.figures import Panel, Scale, Series, histograms_svg, states_svg
from app.report.known import ScanFacts, record_lines, temperatures
from app.report.package import Pages, Report
from app.report.pictures import pass_distance_mm
from app.report.record import Record
from app.report.said import issues_of
from app.report.sections import inputs_of
from app.report.sheet import Sheet, fill, sheet_of
from app.report.shown import limit_of, number, percent, shown
from planner.frames import Array
from planner.issues import Issue

MOST_TOLERANCES = 3.0
TITLES = {"before": "before the correction", "after": "this scan"}


@dataclass(frozen=True, eq=False)
class AssessmentData:
    """content: assessment.json. after, before: the maps behind it. correction: where the part was taken to be, in words."""

    content: dict[str, Any]
    after: Assessment
    before: Assessment | None
    issues: Sequence[Issue]
    scans: Sequence[ScanFacts]
    correction: str
    record: Record = field(default_factory=Record)

    @property
    def states(self) -> list[tuple[str, Assessment]]:
        """The scans by name, the one before first."""
        return [*([("before", self.before)] if self.before else []), ("after", self.after)]


def assessment_report(plan: Plan, data: AssessmentData) -> Report:
    """Return the report of one inspection scan, or of two that are compared."""
    sheet, pages = sheet_of(plan.surface), Pages()
    after, loss = data.content["after"], plan.setup.tolerances.loss_db
    improvement = data.content["improvement_pct"]
    word = f"{shown(percent(after['within_2db']))} within 2 dB"
    text = "" if improvement is None else f"The mean |dB| improved by {shown(number(improvement, 1, unit='%'))}."
    pages.add(Verdict(tone="note", word=word, text=text), *issues_of(data.issues))
    pages.add(Heading(text="Front wall over the inspection"), _table(data))
    pages.add(
        Text(
            text="Of the centre law, without over-spray (less than half the beam on the part), which is the share of all "
            "readings. A lost echo on the part counts as outside 2 dB. ToF is given as one-way distance. "
            + data.correction,
            soft=True,
        )
    )
    pages.show([_histograms(plan, data, loss), _maps(plan, data, sheet)])
    pages.add(*inputs_of(_named(plan), data.scans))
    pages.add(Heading(text="Record"), *record_lines(plan, [s for s in data.scans if s.role != "before"]), Signatures())
    document = Document(
        title="Assessment of an inspection scan",
        subject=plan.part.provenance.name,
        facts=(" x ".join(f"{v:.1f}" for v in plan.part.extents_mm) + " mm",),
        simulated=any(s.simulated for s in data.scans),
        version=version("echobase"),
        blocks=tuple(pages.blocks),
        record=data.record,
        data={"assessment": data.content, **temperatures(plan, plan.setup.standoff_mm)},
    )
    return Report(document, pages.drawn)


def _table(data: AssessmentData) -> Table:
    content = data.content
    rows: list[tuple[Cell, ...]] = []
    names = [name for name, _ in data.states]
    for label, key, decimals, share in (
        ("Within 2 dB of the reference", "within_2db", 1, True),
        ("Mean |dB|", "mean_abs_db", 3, False),
        ("Amplitude, range (dB)", "db_range_db", 2, False),
        ("ToF, standard deviation (mm)", "tof_std_mm", 3, False),
        ("ToF, range (mm)", "tof_range_mm", 3, False),
        ("Over-spray", "over_spray", 2, True),
    ):
        values = [content[name][key] for name in names]
        cells: list[Cell] = [percent(v, decimals) if share else number(v, decimals) for v in values]
        if len(names) > 1:
            known = not share and None not in values and values[0] > 0.0
            cells.append(number(100.0 * (values[0] - values[1]) / values[0], 1, unit="%") if known else None)
        rows.append((label, *cells))
    columns = [Column(title="", look="text"), *(Column(title=TITLES[name]) for name in names)]
    if len(names) > 1:
        columns.append(Column(title="improvement"))
    return Table(name="assessment", columns=tuple(columns), rows=tuple(rows))


def _kept(plan: Plan, scan: Assessment) -> tuple[Array, Array]:
    """Return ToF less planned (mm) and dB of all readings (n,); NaN for over-spray and bubbles."""
    good = scan.on_part & ~scan.bubble
    return np.where(
        good, scan.distance_mm - plan.setup.probe.face_offset_mm - plan.setup.standoff_mm, np.nan
    ), np.where(good, scan.db, np.nan)


def _histograms(plan: Plan, data: AssessmentData, loss: float) -> tuple[Figure, str]:
    of_centre = [(name, [v[scan.centre] for v in _kept(plan, scan)]) for name, scan in data.states]
    quantities = [
        (label, [Series(name, TITLES[name], values[k]) for name, values in of_centre], limits)
        for k, (label, limits) in enumerate(
            (
                ("ToF less planned, mm", (-plan.setup.tolerances.standoff_mm, plan.setup.tolerances.standoff_mm)),
                ("amplitude from the reference, dB", (-loss, loss)),
            )
        )
    ]
    figure = Figure(
        name="histograms",
        caption="How many readings of the centre law show which standoff error and amplitude (the paper's Fig. 8). Dashed: "
        "tolerances.",
        alt="Histograms of standoff error and amplitude, before and after",
    )
    return figure, histograms_svg(quantities, "readings")


def _maps(plan: Plan, data: AssessmentData, sheet: Sheet) -> tuple[Figure, str]:
    kept = [(name, scan, _kept(plan, scan)) for name, scan in data.states]
    limits = [limit_of(*(values[k] for _, _, values in kept), least=least) for k, least in enumerate((0.05, 0.5))]
    # Laws that the curvature of the part tilts far would leave no colours for what matters.
    limits[1] = min(limits[1], MOST_TOLERANCES * plan.setup.tolerances.loss_db)
    reach = 0.2 * pass_distance_mm(plan) + 1.5 * plan.setup.inspection.point_spacing_mm
    quantities = [
        [
            Panel(TITLES[name], fill(sheet, scan.feet_part, values[k], reach), Scale(label, -limits[k], limits[k]))
            for name, scan, values in kept
        ]
        for k, label in enumerate(("ToF less planned (mm)", "amplitude (dB)"))
    ]
    figure = Figure(
        name="maps",
        caption="The scan over the part, all laws whose beam is on it: time of flight of the front wall as distance, less the "
        "planned standoff, and amplitude from the reference. Grey: nothing measured. What lies beyond "
        "a scale has its end colour.",
        alt="Maps of standoff error and amplitude over the part, before and after",
    )
    return figure, states_svg(sheet, quantities)


def _named(plan: Plan) -> list[tuple[str, str]]:
    return [
        (f"part: {plan.part.provenance.name}", plan.part.provenance.sha256),
        ("plan", plan.sha256),
        ("EchoBase", version("echobase")),
    ]
