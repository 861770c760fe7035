"""The alignment report: what was found, how well, and what it changes, as one `Document` with its drawings."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from alignment.metrics import Expected
from app.plan import Plan
from app.report.compare import State, comparison
from app.report.document import Document, Heading, Signatures, Text
from app.report.known import ScanFacts, record_lines, temperatures
from app.report.package import Pages, Report
from app.report.pictures import Deviation, Shape, deviation_maps, inspection_maps, shape_maps
from app.report.record import Record
from app.report.sections import correction_of, directions_of, inputs_of, keypoints_of, proof_of, verdict_of
from app.report.sheet import Sheet, sheet_of
from app.report.shown import number, percent, shown
from app.report.together import surfaces_of
from planner.issues import Issue
from planner.setup import Pose

KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
METHODS = {"map": "point-to-surface estimate (MAP)", "keypoints": "key-point method (Riise et al.)"}


@dataclass(frozen=True, eq=False)
class ReportData:
    """What the report shows beside correction.json.

    before, keyed, after: the inspection as the centre law sees it, uncorrected, with the key-point method and with this
    correction; None where nothing could be estimated. baseline: the key-point method on the same readings (X Y Z mm,
    A B C deg) or None. manifest, findings: of the corrected program. shape: of a part that sprang back.
    """

    correction: dict[str, Any]
    before: Expected | None
    keyed: Expected | None
    after: Expected | None
    deviation: Deviation
    baseline: Sequence[float] | None = None
    shape: Shape | None = None
    manifest: dict[str, Any] | None = None
    findings: Sequence[Issue] = ()
    scans: Sequence[ScanFacts] = field(default_factory=tuple)
    record: Record = field(default_factory=Record)


def alignment_report(plan: Plan, data: ReportData) -> Report:
    """Return the report of an alignment; a failed one says why and what was measured, and has no program."""
    content = data.correction
    sheet = sheet_of(plan.surface)
    pages = Pages()
    pages.add(*verdict_of(content), *correction_of(plan, content), *surfaces_of(content), *directions_of(content))
    states = _states(data)
    figures: dict[str, Any] = {}
    if states:
        table, figures = comparison(states)
        pages.add(Heading(text="Inspection, before and after"), table, Text(text=_how(data), soft=True))
        pages.show(inspection_maps(plan, sheet, states))
    if content["residual"]:
        pages.add(Heading(text="Deviation of the part as scanned"), Text(text=_residual(content["residual"])))
        pages.add(Text(text=_shown_how(sheet), soft=True))
        pages.show(deviation_maps(sheet, data.deviation, np.array([k.xyz() for k in plan.keypoints]).reshape(-1, 3)))
    if content["non_rigid"]:
        pages.add(Heading(text="Shape of the part"), Text(text=_shape(content["non_rigid"])))
        if data.shape is not None:
            pages.show(shape_maps(sheet, data.shape))
    pages.add(*keypoints_of(content), *proof_of(data.manifest, data.findings))
    pages.add(*inputs_of(_named(plan, content), data.scans))
    pages.add(Heading(text="Record"), *record_lines(plan, data.scans), Signatures())
    document = Document(
        title="Alignment report",
        subject=plan.part.provenance.name,
        facts=(" x ".join(f"{v:.1f}" for v in plan.part.extents_mm) + " mm", METHODS[content["method"]]),
        simulated=any(s.simulated for s in data.scans),
        version=version("echobase"),
        blocks=tuple(pages.blocks),
        record=data.record,
        data={
            "verdict": content["verdict"],
            "comparison": figures,
            **temperatures(plan, plan.setup.alignment_standoff_mm),
        },
    )
    return Report(document, pages.drawn)


def _states(data: ReportData) -> tuple[State, ...]:
    if data.before is None or data.after is None or data.correction["correction"] is None:
        return ()
    own = Pose.model_validate({k: data.correction["correction"][k] for k in KEYS}).xyzabc()
    keyed: tuple[State, ...] = ()
    if data.keyed is not None and data.baseline is not None and data.correction["method"] != "keypoints":
        keyed = (State("key points", "key-point method (paper)", tuple(data.baseline), data.keyed),)
    return (State("before", "before", None, data.before), *keyed, State("after", "this correction", own, data.after))


def _how(data: ReportData) -> str:
    shape = (data.correction["non_rigid"] or {}).get("applied") is not None and data.shape is not None
    text = (
        "What the centre law meets of the part along the whole inspection path, as this scan found it"
        + (", with the shape it has sprung back to" if shape else "")
        + ". ToF is given as one-way distance; amplitude is what the tilt leaves by the calibrated curve. Improvements are "
        "against the state before. The figures of this correction are what is to be expected, the uncertainty of the estimate "
        "in them and the robot's own wander not; those of the key-point method take the part to be where this estimate puts "
        "it. The drawings show the part exactly as found."
    )
    if data.keyed is None and data.correction["method"] != "keypoints":
        text += " The key-point method of the paper finds no answer in these readings."
    return text


def _residual(residual: dict[str, Any]) -> str:
    return (
        f"Residual {shown(number(residual['rms_mm']))} mm rms, 95 % within {shown(number(residual['p95_mm']))} mm, largest "
        f"{shown(number(residual['max_mm']))} mm, of {residual['readings']} readings used."
    )


def _shown_how(sheet: Sheet) -> str:
    if sheet.unrolled:
        return "The inspection surface is drawn unrolled; distances around are those on its mean radius."
    return "The inspection surface is drawn as seen along its mean normal."


def _shape(found: dict[str, Any]) -> str:
    text = "The poses follow the shape." if found["applied"] else f"The poses do not follow it: {found['reason']}."
    if found.get("field_rms_mm") is None:
        return text
    mm = {k: shown(number(found[k])) for k in found if k.endswith("_mm") and found[k] is not None}
    return (
        f"{text} Beyond the rigid correction the surface stands {mm['field_rms_mm']} mm rms and at most "
        f"{mm['field_max_mm']} mm off its CAD, with slopes up to {shown(number(found['slope_max_deg']))} deg. The scan "
        f"determines it over {shown(percent(found['support_share']))} of the surface, there to {mm['sigma_max_mm']} mm or "
        f"better (one s.d.); it changes over {found['length_along_mm']:.0f} mm along and {found['length_across_mm']:.0f} mm "
        f"across. Parts of the scan left out in turn are foretold to {mm['foretold_rms_mm']} mm rms with this shape, to "
        f"{mm['foretold_rigid_rms_mm']} mm without."
    )


def _named(plan: Plan, content: dict[str, Any]) -> list[tuple[str, str]]:
    others = content["inputs"].get("together", ())
    return [
        (f"part: {plan.part.provenance.name}", content["inputs"]["part_sha256"]),
        ("plan", content["inputs"]["plan_sha256"]),
        *((f"plan aligned together: {o['name']}", o["plan_sha256"]) for o in others),
        *((f"its scan: {o['name']}", sha256) for o in others for sha256 in o["scan_sha256"]),
        ("EchoBase", content["inputs"]["version"]),
    ]
