"""The numbers of a report for machines: nested JSON, and CSV with one cell a line."""

import csv
import io
from typing import Any

from app.report.document import Cell, Document, Issues, Line, Lines, Number, Table, Verdict

COLUMNS = ("table", "row", "column", "value", "unit")
# What a spreadsheet would run as a formula.
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def json_content(document: Document) -> dict[str, Any]:
    """Return title, subject, record and all tables as plain values."""
    return {
        "title": document.title,
        "subject": document.subject,
        "simulated": document.simulated,
        "made": document.made,
        "version": document.version,
        "figures": list(document.figures()),
        **document.data,
        "verdicts": [b.word for b in document.blocks if isinstance(b, Verdict)],
        "issues": [i.model_dump() for b in document.blocks if isinstance(b, Issues) for i in b.issues],
        "acceptance": None if document.acceptance is None else document.acceptance.model_dump(),
        "record": document.record.model_dump(mode="json"),
        "known": {b.title: _known(document, b) for b in document.blocks if isinstance(b, Lines)},
        "tables": {b.name: _table(b) for b in document.blocks if isinstance(b, Table)},
    }


def csv_text(document: Document) -> bytes:
    """Return every cell of every table and line of the record, UTF-8 with CRLF (RFC 4180)."""
    buffer = io.StringIO(newline="")
    out = csv.writer(buffer)
    out.writerow(COLUMNS)
    for key, value in (("title", document.title), ("subject", document.subject), ("version", document.version)):
        out.writerow(("report", key, "", _safe(value), ""))
    out.writerow(("report", "simulated", "", str(document.simulated).lower(), ""))
    for block in document.blocks:
        if isinstance(block, Table):
            for row in block.rows:
                for column, cell in zip(block.columns[1:], row[1:], strict=True):
                    out.writerow((block.name, _text(row[0]), _safe(column.title), _text(cell), _unit(cell)))
        elif isinstance(block, Verdict):
            out.writerow(("report", "verdict", _safe(block.text), _safe(block.word), ""))
        elif isinstance(block, Issues):
            for said in block.issues:
                out.writerow(("issue", said.severity, _safe(said.where), _safe(said.message), ""))
        elif isinstance(block, Lines):
            for line in block.lines:
                out.writerow(("record", _safe(block.title), _safe(line.label), _safe(_line(document, line)), line.unit))
    return buffer.getvalue().encode()


def _table(table: Table) -> list[dict[str, Any]]:
    titles = [column.title or "name" for column in table.columns]
    return [{t: _value(cell) for t, cell in zip(titles, row, strict=True)} for row in table.rows]


def _known(document: Document, group: Lines) -> dict[str, str]:
    return {line.label: line.value for line in group.lines if line.value}


def _line(document: Document, line: Line) -> str:
    return document.record.text(line.field) if line.field else line.value


def _value(cell: Cell) -> Any:
    return cell.value if isinstance(cell, Number) else cell


def _text(cell: Cell) -> str:
    value = _value(cell)
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else _safe(value)


def _unit(cell: Cell) -> str:
    return cell.unit if isinstance(cell, Number) else ""


def _safe(text: str) -> str:
    """Keep a spreadsheet from taking words for a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text
