"""`Document`: a report as data. What stands in it is computed once; HTML, PDF, JSON and CSV are four ways to show it."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.report.record import Record

Tone = Literal["pass", "partial", "fail", "note"]


class _Noun(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Number(_Noun):
    """A number with the decimals it deserves; None is shown as a dash. `signed`: a plus is shown too."""

    value: float | None
    decimals: int = Field(3, ge=0, le=9)
    signed: bool = False
    unit: str = ""


Cell = Number | str | None


class Heading(_Noun):
    """Begins a section; `fresh` on a new page."""

    kind: Literal["heading"] = "heading"
    text: str
    fresh: bool = False


class Text(_Noun):
    """A paragraph; `soft` for what explains."""

    kind: Literal["text"] = "text"
    text: str
    soft: bool = False


class Verdict(_Noun):
    """A word in its tone, with a sentence."""

    kind: Literal["verdict"] = "verdict"
    tone: Tone
    word: str
    text: str = ""


class Said(_Noun):
    """An issue, for a list."""

    severity: Literal["error", "warning", "info"]
    message: str
    remedy: str = ""
    where: str = ""


class Issues(_Noun):
    """Issues, errors first."""

    kind: Literal["issues"] = "issues"
    issues: tuple[Said, ...]


class Column(_Noun):
    """A column: numbers stand right, `text` left, `code` left in equal letters. `share` of the width of all, 0: as needed."""

    title: str
    look: Literal["number", "text", "code"] = "number"
    share: float = Field(0.0, ge=0.0)


class Table(_Noun):
    """A table; `name` is what CSV and JSON call it. `group`: a row that only names what follows has one cell."""

    kind: Literal["table"] = "table"
    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


class Figure(_Noun):
    """A drawing, kept as `figures/<name>.svg`. `alt`: what it shows, for those who cannot see it."""

    kind: Literal["figure"] = "figure"
    name: str = Field(pattern=r"^[a-z0-9-]+$")
    caption: str
    alt: str


class Line(_Noun):
    """A line of the record: computed (`value`), or brought by people: `field` is its place in `record.json`."""

    label: str
    value: str = ""
    field: str = ""
    unit: str = ""


class Lines(_Noun):
    """A group of the record. What nobody filled in prints as a ruled blank."""

    kind: Literal["lines"] = "lines"
    title: str
    lines: tuple[Line, ...]


class Signatures(_Noun):
    """Who takes it over: filled in from the acceptance of a partial result, else blank lines to sign."""

    kind: Literal["signatures"] = "signatures"


Block = Annotated[Heading | Text | Verdict | Issues | Table | Figure | Lines | Signatures, Field(discriminator="kind")]


class Acceptance(_Noun):
    """Who took a partial result over, why and when (UTC)."""

    name: str
    reason: str
    at: str
    sha256: str = ""


class Document(_Noun):
    """A report. `simulated`: some of its readings come from no transducer, and every page says so.

    `made`: when, UTC, where that is known. `record`, `acceptance`: as they were when it was made; they may be replaced.
    """

    format: Literal[1] = 1
    title: str
    subject: str
    facts: tuple[str, ...] = ()
    simulated: bool = False
    made: str = ""
    version: str
    blocks: tuple[Block, ...]
    record: Record = Record()
    acceptance: Acceptance | None = None
    data: dict[str, Any] = {}
    """Figures behind the tables that a script wants under stable names."""

    def figures(self) -> tuple[str, ...]:
        """Return the names of its drawings, in order."""
        return tuple(block.name for block in self.blocks if isinstance(block, Figure))
