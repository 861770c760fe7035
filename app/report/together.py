"""The section of a report that says of several surfaces aligned together how well the readings of each agree."""

from typing import Any

from app.report.document import Block, Cell, Column, Heading, Table, Text
from app.report.shown import number, percent, whole


def surfaces_of(content: dict[str, Any]) -> list[Block]:
    """Return the surfaces whose scans determined the correction together; nothing for a plan aligned by itself."""
    found = content.get("surfaces")
    if not found:
        return []
    rows: list[tuple[Cell, ...]] = [
        (
            s["name"], number(s["rms_mm"]), number(s["p95_mm"]), number(s["mean_mm"], signed=True),
            percent(s["agreeing_share"]), whole(s["readings"]), whole(s["crossings"]),
        )
        for s in found
    ]  # fmt: skip
    titles = ("rms, mm", "95 % within, mm", "mean, mm", "agreeing", "readings", "edge crossings")
    columns = (Column(title="surface", look="text", share=1.6), *(Column(title=t) for t in titles))
    how = (
        "The scans of these surfaces determined one placement of the part together; each counts against its own surface. "
        "Residuals are measured minus expected distances at that placement: a surface that stands off by itself is out of "
        "place or out of shape. Agreeing: share of what was scanned of it that the estimate rests on."
    )
    return [
        Heading(text="Surfaces aligned together"),
        Table(name="surfaces", columns=columns, rows=tuple(rows)),
        Text(text=how, soft=True),
    ]
