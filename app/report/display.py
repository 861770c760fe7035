"""A `Document` as plain strings in order: what both templates, of HTML and of PDF, lay out."""

from datetime import date
from typing import Any

from app.report.document import Document, Figure, Heading, Issues, Line, Lines, Signatures, Table, Text, Verdict
from app.report.record import Record
from app.report.shown import MINUS, number, shown

# UFGS 05 05 23.13: where a check finds 2 dB less sensitivity, all since the check before is inspected again.
SENSITIVITY_DB = 2.0
SIGNS = {"pass": "\N{CHECK MARK}", "partial": "!", "fail": "\N{MULTIPLICATION SIGN}", "note": ""}


def display(document: Document) -> dict[str, Any]:
    """Return title, facts and blocks; every value is text, and none of it is markup."""
    blocks: list[dict[str, Any]] = []
    for block in document.blocks:
        if isinstance(block, Lines):
            blocks.append(_lines(document, block))
        elif isinstance(block, Signatures):
            blocks += [{"kind": "text", "text": note, "soft": False} for note in _notes(document)]
            blocks.append(_signatures(document))
        else:
            blocks.append(_plain(block))
    facts = [*document.facts, f"EchoBase {document.version}"]
    if document.made:
        facts.append(f"made {document.made[:16].replace('T', ' ')} UTC")
    return {
        "title": document.title,
        "subject": document.subject,
        "facts": facts,
        "simulated": document.simulated,
        "accepted": _accepted(document),
        "blocks": blocks,
    }


def _plain(block: Heading | Text | Verdict | Issues | Table | Figure) -> dict[str, Any]:
    content = block.model_dump()
    if isinstance(block, Table):
        content["rows"] = [[shown(cell) for cell in row] for row in block.rows]
    elif isinstance(block, Verdict):
        content["sign"] = SIGNS[block.tone]
    elif isinstance(block, Issues):
        content["issues"] = [{**issue.model_dump(), "message": _sentence(issue.message)} for issue in block.issues]
    return content


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _accepted(document: Document) -> str:
    given = document.acceptance
    if given is None:
        return ""
    return f"Accepted by {given.name} on {given.at[:16].replace('T', ' ')} UTC: {given.reason}"


def _lines(document: Document, group: Lines) -> dict[str, Any]:
    def line(item: Line) -> dict[str, Any]:
        if not item.field:
            return {"label": item.label, "value": item.value, "blank": False, "unit": ""}
        value = document.record.text(item.field)
        text = f"{value} {item.unit}".strip() if value else ""
        if item.unit:
            text = text.replace("-", MINUS)
        return {"label": item.label, "value": text, "blank": not value, "unit": item.unit}

    return {"kind": "lines", "title": group.title, "lines": [line(item) for item in group.lines]}


def _signatures(document: Document) -> dict[str, Any]:
    people = document.record.people
    rows = [
        {"role": "Operator", "name": " ".join(filter(None, (people.operator, _bracket(people.operator_level))))},
        {"role": "Reviewer", "name": " ".join(filter(None, (people.reviewer, _bracket(people.reviewer_level))))},
    ]
    return {"kind": "signatures", "rows": rows}


def _bracket(text: str) -> str:
    return f"({text})" if text else ""


def _notes(document: Document) -> list[str]:
    """Return what the record says of itself: temperatures against the setup, sensitivity, calibrations out of date."""
    record = document.record
    return [*_temperature(document), *_sensitivity(record), *_due(record)]


def _temperature(document: Document) -> list[str]:
    assumed, slope = document.data.get("temperature_c"), document.data.get("mm_per_c")
    measured = [
        (when, t)
        for when, t in (
            ("start", document.record.couplant.temperature_start_c),
            ("end", document.record.couplant.temperature_end_c),
        )
        if t is not None
    ]
    if assumed is None or slope is None or not measured:
        return []
    parts = [
        f"{t:g} deg C at the {when} ({shown(number((t - assumed) * slope, 3, signed=True))} mm)" for when, t in measured
    ]
    standoff = document.data["standoff_mm"]
    text = (
        f"Water: {', '.join(parts)} against {assumed:g} deg C assumed; in brackets, how far the surface seems moved by "
        f"that at {standoff:g} mm standoff."
    )
    return [text]


def _sensitivity(record: Record) -> list[str]:
    before, after = record.calibration.sensitivity_before_db, record.calibration.sensitivity_after_db
    if before is None or after is None:
        return []
    change = after - before
    text = f"Sensitivity changed by {shown(number(change, 1, signed=True))} dB between the two checks."
    if abs(change) > SENSITIVITY_DB:
        text += f" That is more than {SENSITIVITY_DB:g} dB: what was inspected since the check before is to be inspected again."
    return [text]


def _due(record: Record) -> list[str]:
    """Return which calibrations were out of date on the day of the scan."""
    begun = record.people.begun
    if begun is None:
        return []
    named: tuple[tuple[str, date | None], ...] = (
        ("the ultrasonic set", record.equipment.instrument_due),
        ("the reference block", record.calibration.block_due),
    )
    return [
        f"The calibration of {what} was due on {due.isoformat()}, before the scan began."
        for what, due in named
        if due is not None and due < begun.date()
    ]
