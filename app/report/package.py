"""A report as files: one self-contained HTML, a PDF, the numbers as JSON and CSV, the drawings as SVG."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from app.report.document import Acceptance, Block, Document, Figure, Verdict
from app.report.html import html
from app.report.pdf import pdf
from app.report.plain import csv_text, json_content
from app.report.record import Record
from planner.errors import fail

Files = dict[str, bytes]


@dataclass(frozen=True, eq=False)
class Report:
    """A document and its drawings: name -> SVG text."""

    document: Document
    figures: Mapping[str, str]

    def completed(
        self, record: Record | None, acceptance: Acceptance | None, made: str = "", outdated: str = ""
    ) -> "Report":
        """Return the report with what came to be known after it was made; outdated: why it holds no longer, if so."""
        changed: dict[str, Any] = {"acceptance": acceptance, "made": made or self.document.made}
        if record is not None:
            changed["record"] = record
        if outdated:
            said = Verdict(tone="fail", word="OUT OF DATE", text=f"{outdated} What follows does not hold any more.")
            changed["blocks"] = (said, *self.document.blocks)
        return Report(self.document.model_copy(update=changed), self.figures)

    def html(self) -> bytes:
        """Return one page without scripts, drawings inside."""
        return html(self.document, self.figures)

    def pdf(self) -> bytes:
        """Return the same as PDF (A4); the same report gives the same bytes."""
        return pdf(self.document, self.figures)

    def json(self) -> bytes:
        """Return its tables and figures as JSON."""
        return (json.dumps(json_content(self.document), indent=1, allow_nan=False) + "\n").encode()

    def csv(self) -> bytes:
        """Return its tables as CSV, one cell a line."""
        return csv_text(self.document)

    def files(self, folder: str) -> Files:
        """Return everything under `folder/`, and what the report can be made from again (`report.document.json`)."""
        out = {
            "report.html": self.html(),
            "report.pdf": self.pdf(),
            "report.json": self.json(),
            "report.csv": self.csv(),
            "report.document.json": (self.document.model_dump_json(indent=1) + "\n").encode(),
        }
        out |= {f"figures/{name}.svg": svg.encode() for name, svg in self.figures.items()}
        return {f"{folder}/{name}": content for name, content in out.items()}


@dataclass
class Pages:
    """A report being written: its blocks in order, and the drawings among them."""

    blocks: list[Block] = field(default_factory=list)
    drawn: dict[str, str] = field(default_factory=dict)

    def add(self, *blocks: Block) -> None:
        """Append blocks."""
        self.blocks += blocks

    def show(self, found: Sequence[tuple[Figure, str]]) -> None:
        """Append drawings."""
        for figure, svg in found:
            self.drawn[figure.name] = svg
            self.blocks.append(figure)


def stored(document: bytes, figures: Mapping[str, bytes]) -> Report:
    """Return a report from its `report.document.json` and drawings (name -> SVG); raises EchoBaseError if they are damaged."""
    try:
        read = Document.model_validate_json(document)
        return Report(read, {name: figures[name].decode() for name in read.figures()})
    except (ValidationError, KeyError, UnicodeDecodeError) as error:
        raise fail("report-damaged", "the report cannot be read back.", "Align or assess again.", "report") from error
