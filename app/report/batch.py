"""The report of a batch: what serial parts on one fixture have in common, and what is each part's own."""

import json
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from alignment.batch import Batch, Shapes
from app.plan import Plan
from app.report.document import Cell, Column, Document, Figure, Heading, Table, Text, Verdict
from app.report.figures import Panel, Scale, maps_svg, states_svg
from app.report.package import Pages, Report
from app.report.said import issues_of
from app.report.sheet import Sheet, fill, sheet_of
from app.report.shown import POSE_TITLES, limit_of, number, shown, six, whole
from app.report.strips import Strip, strips_svg
from planner.frames import Array

DIGITS = {"mm": 3, "deg": 4, "sigma": 3}
MOST_MAPS = 6


def batch_report(plan: Plan, found: Batch, shapes: Shapes | None, content: dict[str, Any]) -> Report:
    """Return the report; content is batch.json."""
    pages = Pages()
    pages.add(_verdict(found), *issues_of(content["issues"]))
    pages.add(Heading(text="Common to the parts"), _common(found))
    pages.add(Text(text=_how(found), soft=True))
    pages.add(
        Table(name="common", columns=_titled(POSE_TITLES), rows=(("common correction", *six(content["common"], True)),))
    )
    pages.show([_strips(found)])
    pages.add(Heading(text="Each part's own"), _own(found))
    pages.add(
        Text(
            text="Departure from the common place; in brackets by how many standard deviations (scan and scatter together). "
            "A dash: its scan does not show this direction.",
            soft=True,
        )
    )
    if shapes is not None:
        pages.add(Heading(text="Shape"), _shape_table(shapes), Text(text=_shape_text(shapes)))
        pages.show(_shape_maps(sheet_of(plan.surface), shapes))
    pages.add(Heading(text="For setup.json"), *_patch(content["patch"]))
    inputs = [(f"part: {plan.part.provenance.name}", plan.part.provenance.sha256), ("plan", plan.sha256)]
    inputs += [
        (p["name"] + (" (simulated)" if p["simulated"] else ""), p["sha256"]) for p in content["inputs"]["parts"]
    ]
    columns = (Column(title="input", look="text", share=1.3), Column(title="SHA-256, version", look="code", share=2.4))
    rows = (*inputs, ("EchoBase", version("echobase")))
    pages.add(Heading(text="Inputs"), Table(name="inputs", columns=columns, rows=rows))
    document = Document(
        title="Batch of serial parts",
        subject=plan.part.provenance.name,
        facts=(f"{len(found.names)} parts",),
        simulated=any(p["simulated"] for p in content["inputs"]["parts"]),
        version=version("echobase"),
        blocks=tuple(pages.blocks),
        data={"batch": content},
    )
    return Report(document, pages.drawn)


def _verdict(found: Batch) -> Verdict:
    odd = int(found.odd.any(axis=1).sum())
    text = "They have an offset in common." if found.offset_known else "No common offset can be told from nominal."
    if odd:
        text += f" {odd} of them {'is' if odd == 1 else 'are'} unlike the others."
    return Verdict(tone="note", word=f"{len(found.names)} parts", text=text)


def _common(found: Batch) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for j, (axis, c) in enumerate(zip(found.axes, found.common, strict=True)):
        d = DIGITS[axis.unit]
        between = None if c.scatter_95 is None else f"{c.scatter_95[0]:.{d}f} to {c.scatter_95[1]:.{d}f}"
        seen = int(np.isfinite(found.values[:, j]).sum())
        label = f"{axis.name}: {axis.text} ({axis.unit})"
        rows.append((label, whole(seen), number(c.mean, d, True), number(c.half_95, d), number(c.scatter, d), between))
    titles = ("parts", "common", "\N{PLUS-MINUS SIGN} 95 %", "scatter", "scatter, 95 %")
    columns = (Column(title="direction", look="text", share=1.6), *(Column(title=t) for t in titles))
    return Table(name="directions", columns=columns, rows=tuple(rows))


def _how(found: Batch) -> str:
    frame = (
        "axes of BASE" if found.frame == "base" else "axes of the inspected face (x its longest extent, z its normal)"
    )
    return (
        f"Turns and shifts about the centroid of the inspected face, {frame}, from nominal. Common: mean with its 95 % "
        "interval (Hartung, Knapp 2001). Scatter: standard deviation from part to part, beyond what the scans' own uncertainty "
        "explains, with its 95 % interval (Q-profile, Viechtbauer 2007). Directions that a scan holds count for nothing."
    )


def _own(found: Batch) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate(found.names):
        cells: list[Cell] = []
        for j, axis in enumerate(found.axes):
            known = np.isfinite(found.departure[i, j])
            mark = " *" if found.odd[i, j] else ""
            own = shown(number(found.departure[i, j], DIGITS[axis.unit], True))
            cells.append(f"{own} ({shown(number(found.z[i, j], 1, True))}){mark}" if known else None)
        rows.append((name, *cells))
    columns = (Column(title="part", look="text", share=1.2), *(Column(title=f"{a.name} {a.unit}") for a in found.axes))
    return Table(name="departures", columns=columns, rows=tuple(rows))


def _strips(found: Batch) -> tuple[Figure, str]:
    strips = [
        Strip(
            f"{axis.name}, {axis.unit}", found.values[:, j], 1.96 * found.sigma[:, j], c.mean, c.half_95, c.scatter,
            found.odd[:, j],
        )
        for j, (axis, c) in enumerate(zip(found.axes, found.common, strict=True))
    ]  # fmt: skip
    figure = Figure(
        name="parts",
        caption="Each part with the 95 % interval of its scan. Line and dark band: what is common, with its 95 % interval; "
        "light band: two standard deviations of the scatter; dashed: nominal, where it is near. Ringed: unlike the others.",
        alt="Place of every part along each direction, beside the common place",
    )
    return figure, strips_svg(strips, found.names)


def _shape_table(shapes: Shapes) -> Table:
    own = zip(shapes.names, shapes.own_rms_mm, strict=True)
    columns = (Column(title="part", look="text"), Column(title="own shape, rms mm"))
    return Table(name="shapes", columns=columns, rows=tuple((name, number(v, 3)) for name, v in own))


def _shape_text(shapes: Shapes) -> str:
    of = shapes.to_json()
    if of["common_rms_mm"] is None:
        return "No place is determined by two of the scans."
    text = (
        f"The shape common to {len(shapes.names)} parts: {of['common_rms_mm']:.3f} mm rms, {of['common_max_mm']:.3f} mm at "
        f"most, known to {of['common_sigma_mm']:.3f} mm (one sigma) over {100 * of['support_share']:.0f} % of the surface."
    )
    scatter = "Two shapes cannot tell a scatter." if shapes.scatter_mm is None else ""
    return f"{text} {scatter or f'From part to part shapes differ by {shapes.scatter_mm:.3f} mm (one sigma).'}"


def _shape_maps(sheet: Sheet, shapes: Shapes) -> list[tuple[Figure, str]]:
    known = np.isfinite(shapes.common_mm)
    if not known.any():
        return []
    reach = 2.0 * float(np.sqrt(sheet.inside.sum() * sheet.cell_mm**2 / len(shapes.points_part)))

    def cells(values: Array) -> Array:
        told = np.isfinite(values)
        beyond = fill(sheet, shapes.points_part, told.astype(np.float64), reach) < 0.5
        return np.where(beyond, np.nan, fill(sheet, shapes.points_part[told], values[told], reach))

    limit = limit_of(shapes.common_mm[known], least=0.05)
    sigma = limit_of(shapes.sigma_mm[known], least=0.005)
    panels = [
        Panel("common shape", cells(shapes.common_mm), Scale("along the normal (mm)", -limit, limit)),
        Panel("its standard deviation", cells(shapes.sigma_mm), Scale("one s.d. (mm)", 0.0, sigma)),
    ]
    own = [v - shapes.common_mm for v in shapes.values_mm[:MOST_MAPS]]
    some = [(n, v) for n, v in zip(shapes.names, own, strict=False) if np.isfinite(v).any()]
    least = limit_of(*[v[np.isfinite(v)] for _, v in some], least=0.05)
    scale = Scale("own shape (mm)", -least, least)
    figures = [
        (
            _map_figure("common-shape", "The shape that the parts have in common, and how well it is known."),
            maps_svg(sheet, panels),
        )
    ]
    if some:
        caption = "What is left of each part's own shape" + (
            f", the first {MOST_MAPS}." if len(shapes.names) > MOST_MAPS else "."
        )
        figures.append(
            (_map_figure("own-shapes", caption), states_svg(sheet, [[Panel(n, cells(v), scale) for n, v in some]]))
        )
    return figures


def _map_figure(name: str, caption: str) -> Figure:
    return Figure(name=name, caption=f"{caption} + is outside the CAD. Grey: not determined.", alt=caption)


def _patch(patch: dict[str, Any]) -> list[Text | Table]:
    if not patch:
        return [Text(text="Nothing to change.")]
    rows = [(group, key, json.dumps(value)) for group, fields in patch.items() for key, value in fields.items()]
    columns = (
        Column(title="group", look="text"),
        Column(title="field", look="text"),
        Column(title="value", look="code"),
    )
    text = "Base: nominal BASE moved by what the parts have in common. Fixture: a sigma of which two hold the next part (95 %)."
    return [Text(text=text, soft=True), Table(name="patch", columns=columns, rows=tuple(rows))]


def _titled(titles: Sequence[str]) -> tuple[Column, ...]:
    return (Column(title="", look="text"), *(Column(title=t) for t in titles))
