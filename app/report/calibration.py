"""The report of a calibration: what was found, how well, drawn, and what of the setup it changes."""

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from alignment.calibrate.result import Calibration, Estimate
from app.report.calibration_figures import calibration_svg
from app.report.document import Block, Cell, Column, Document, Figure, Heading, Table, Text, Verdict
from app.report.package import Pages, Report
from app.report.said import issues_of
from app.report.shown import number
from planner.setup import Setup

SUBJECTS = {"tilt": "Tilt loss of the probe", "couplant": "Couplant", "tcp": "TCP"}
TITLES = {
    "k_b": "Tilt loss about B",
    "k_c": "Tilt loss about C",
    "zero_b": "B of the largest echo",
    "zero_c": "C of the largest echo",
    "sound_speed": "Speed of sound",
    "delay": "Delay",
    "c": "Turn about x (C)",
    "b": "Turn about y (B)",
    "a": "Turn about z (A)",
    "x": "Shift along x",
    "y": "Shift along y",
    "z": "Shift along z",
    "radius": "Radius of the sphere",
}
UNITS = {"us": "µs", "dB/deg^2": "dB/deg²"}
CAPTIONS = {
    "tilt": "Amplitude against tilt about each axis, less what the fit says of the other one. Line: fitted curve; band: its "
    "95 %. Rings: left out (noise floor, side lobes, outliers).",
    "couplant": "Times of flight with the fitted lines, and what is left of each reading. Band: 1.96 times the rms.",
    "tcp": "What is left of each reading after the fit, over the poses. Band: 1.96 times the rms of those used; rings and "
    "arrows at the rim: left out (outliers; of a sphere also faint echoes). Vertical lines: a new pass.",
}
TCP_AXES = (
    "Turns and shifts of the TCP are in EchoBase's own TCP (z along the beam, x along the array); the patch is in the axes of "
    "the flange, as tool.tcp."
)
STATUS = (
    "measured: in the patch. weak: in the patch, and known worse than one would like. held: these data do not show it; it "
    "stays as it was."
)


def calibration_report(found: Calibration, setup: Setup, inputs: Sequence[tuple[str, str]]) -> Report:
    """Return the report; setup: as it was believed to be; inputs: name and SHA-256 of each file."""
    pages = Pages()
    pages.add(_verdict(found), *issues_of(found.issues), Heading(text="Found"), _estimates(found))
    pages.add(Text(text=STATUS, soft=True))
    if found.kind == "tcp":
        pages.add(Text(text=TCP_AXES, soft=True))
    figure = Figure(name=found.kind, caption=CAPTIONS[found.kind], alt=f"{SUBJECTS[found.kind]}: readings and fit")
    pages.show([(figure, calibration_svg(found))])
    pages.add(Heading(text="For setup.json"), _changes(found, setup), Heading(text="Inputs"))
    columns = (Column(title="input", look="text"), Column(title="SHA-256, version", look="code", share=2.0))
    pages.add(Table(name="inputs", columns=columns, rows=(*inputs, ("EchoBase", version("echobase")))))
    if found.kind != "tcp":
        pages.add(Text(text="These files cannot say whether a transducer took their readings.", soft=True))
    document = Document(
        title="Calibration",
        subject=SUBJECTS[found.kind],
        facts=(
            f"{found.readings} readings",
            f"residual {found.residual_rms:.3g} {UNITS.get(found.residual_unit, found.residual_unit)} rms",
        ),
        simulated=found.simulated,
        version=version("echobase"),
        blocks=tuple(pages.blocks),
        data={"calibration": found.to_json()},
    )
    return Report(document, pages.drawn)


def changes(patch: dict[str, Any], setup: Setup) -> list[tuple[str, Any, Any]]:
    """Return (field, before, after) of every field of the patch, nested names joined by dots."""
    return list(_leaves(patch, setup.model_dump(mode="json"), ""))


def _leaves(patch: dict[str, Any], before: Any, path: str) -> list[tuple[str, Any, Any]]:
    out = []
    for key, value in patch.items():
        old = before.get(key) if isinstance(before, dict) else None
        if isinstance(value, dict):
            out += _leaves(value, old, f"{path}{key}.")
        else:
            out.append((path + key, old, value))
    return out


def _verdict(found: Calibration) -> Verdict:
    status = [estimate.status for estimate in found.estimates.values()]
    if not found.observable:
        return Verdict(tone="fail", word="NOTHING SHOWN", text="These data show none of the values.")
    if set(status) == {"measured"}:
        return Verdict(tone="pass", word="MEASURED", text="Every value is measured.")
    words = ", ".join(f"{status.count(s)} {s}" for s in ("measured", "weak", "held") if s in status)
    return Verdict(tone="note", word="IN PART", text=f"Of {len(status)} values: {words}.")


def _estimates(found: Calibration) -> Table:
    titles = ("value", "\N{PLUS-MINUS SIGN} 95 %", "sigma")
    columns = (
        Column(title="quantity", look="text", share=1.6),
        *(Column(title=t) for t in titles),
        Column(title="unit", look="text"),
        Column(title="status", look="text"),
    )
    return Table(name="estimates", columns=columns, rows=tuple(_row(n, e) for n, e in found.estimates.items()))


def _row(name: str, estimate: Estimate) -> tuple[Cell, ...]:
    decimals = decimals_of(estimate.half_95)
    numbers = (number(v, decimals) for v in (estimate.value, estimate.half_95, estimate.sigma))
    return (TITLES.get(name, name), *numbers, UNITS.get(estimate.unit, estimate.unit), estimate.status)


def decimals_of(half_95: float) -> int:
    """Return the decimals that show two digits of a half width."""
    if not np.isfinite(half_95) or half_95 <= 0.0:
        return 4
    return int(np.clip(1 - np.floor(np.log10(half_95)), 0, 6))


def _changes(found: Calibration, setup: Setup) -> Block:
    rows = tuple((path, _text(before), _text(after)) for path, before, after in changes(found.patch, setup))
    if not rows:
        return Text(text="Nothing to change.")
    looks = (("field", "text"), ("before", "code"), ("after", "code"))
    columns = tuple(Column(title=title, look=look) for title, look in looks)
    return Table(name="patch", columns=columns, rows=rows)


def _text(value: Any) -> str:
    return "–" if value is None else f"{value:.10g}" if isinstance(value, float) else str(value)
