"""One document in four forms: the same numbers in each, words as words, and the same bytes for the same document."""

import csv
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from pydantic import ValidationError

from alignment.metrics.expected import Expected
from alignment.metrics.figures import Prediction
from app.report.compare import State, comparison
from app.report.display import display
from app.report.document import (
    Acceptance,
    Column,
    Document,
    Figure,
    Heading,
    Issues,
    Line,
    Lines,
    Number,
    Said,
    Signatures,
    Table,
    Text,
    Verdict,
)
from app.report.package import Report, stored
from app.report.record import Record
from app.report.shown import limit_of, shown
from app.steps.records import record_from
from planner.couplant import water_speed_m_s
from planner.errors import EchoBaseError

NASTY = '"q" <script>alert(1)</script> &amp; # $x^2$ *b* _i_ @ref [c] ] } \\ // /* `r` ~ = #eval("1")'
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="90" height="30"><rect width="90" height="30" fill="#0b6fa4"/></svg>'
)


def document(words: str = NASTY, **changes) -> Document:
    columns = (Column(title=words, look="text"), Column(title="mm"), Column(title=words, look="code", share=1.0))
    rows = ((words, Number(value=-1.25, decimals=3), words), ("b", Number(value=None), None))
    return Document(
        title="Report",
        subject=words,
        facts=(words,),
        version="1",
        blocks=(
            Verdict(tone="partial", word="PARTIAL", text=words),
            Heading(text=words),
            Text(text=words),
            Issues(issues=(Said(severity="warning", message=words, remedy=words, where=words),)),
            Table(name="t", columns=columns, rows=rows),
            Figure(name="f", caption=words, alt=words),
            Lines(title=words, lines=(Line(label=words, value=words), Line(label="Serial", field="part.serial"))),
            Signatures(),
        ),
        **changes,
    )


class Seen(HTMLParser):
    """What a browser would make of a page: tags and text."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(page.decode())

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data) -> None:
        self.text += data


def test_words_are_never_markup_in_html():
    seen = Seen(Report(document(), {"f": SVG}).html())
    assert "script" not in seen.tags
    assert not [a for a in seen.attributes if a[0].startswith("on")]
    assert seen.text.count(NASTY) >= 11
    # Nothing is fetched: the only addresses are names of XML.
    assert not [v for k, v in seen.attributes if k in ("src", "href")]


def test_words_are_never_markup_in_pdf():
    made = Report(document(), {"f": SVG}).pdf()
    assert made.startswith(b"%PDF-")
    plain = Report(document("plain"), {"f": SVG}).pdf()
    assert plain != made
    # What typst would do with them as markup: a call of an unknown name fails to compile.
    assert Report(document("#nothing() $x"), {"f": SVG}).pdf().startswith(b"%PDF-")


def test_the_same_document_is_the_same_bytes():
    one, other = Report(document(), {"f": SVG}), Report(document(), {"f": SVG})
    assert one.files("r") == other.files("r")


def test_what_was_stored_is_the_same_report():
    made = Report(document(record=Record.model_validate({"part": {"serial": "7"}})), {"f": SVG})
    files = made.files("r")
    again = stored(files["r/report.document.json"], {"f": files["r/figures/f.svg"]})
    assert again.files("r") == files
    with pytest.raises(EchoBaseError) as caught:
        stored(files["r/report.document.json"], {})
    assert caught.value.issues[0].code == "report-damaged"


def test_json_and_csv_hold_the_numbers_unrounded():
    made = document()
    value = made.blocks[4].rows[0][1].value
    tables = json.loads(Report(made, {}).json())["tables"]
    assert tables["t"][0]["mm"] == value
    lines = list(csv.reader(io.StringIO(Report(made, {}).csv().decode(), newline="")))
    [line] = [x for x in lines if x[0] == "t" and x[2] == "mm" and x[1].lstrip("'") == NASTY]
    assert float(line[3]) == value


def test_a_spreadsheet_takes_no_word_for_a_formula():
    record = Record.model_validate({"part": {"serial": "=1+1"}})
    cells = [
        c for row in csv.reader(io.StringIO(Report(document("+cmd", record=record), {}).csv().decode())) for c in row
    ]
    assert not [c for c in cells if re.match(r"[=+@]", c)]
    assert "'=1+1" in cells
    assert "'+cmd" in cells


def test_empty_fields_are_blanks_and_filled_ones_are_not():
    for text, blanks in (("", 1), ("SN 12", 0)):
        page = (
            Report(document("x", record=Record.model_validate({"part": {"serial": text}})), {"f": SVG}).html().decode()
        )
        assert page.count('class="blank"') == blanks
        assert (text in page) is True


def test_simulated_is_said_only_of_simulated_scans():
    for simulated in (True, False):
        page = Report(document("x", simulated=simulated), {"f": SVG}).html().decode()
        assert (">SIMULATED</b>" in page) is simulated


def test_an_acceptance_is_printed_with_name_reason_and_time():
    accepted = Acceptance(name="A. Inspector", reason="gauge agrees", at="2026-03-01T08:00:00.000Z")
    text = Seen(Report(document("x"), {"f": SVG}).completed(None, accepted).html()).text
    assert "Accepted by A. Inspector on 2026-03-01 08:00 UTC: gauge agrees" in text


def test_notes_follow_from_the_record():
    record = Record.model_validate(
        {
            "couplant": {"temperature_start_c": 21.0},
            "calibration": {"sensitivity_before_db": 0.5, "sensitivity_after_db": -2.0, "block_due": "2026-02-01"},
            "equipment": {"instrument_due": "2027-01-01"},
            "people": {"begun": "2026-03-01T08:00:00+01:00"},
        }
    )
    slope = 15.0 * (water_speed_m_s(20.5) - water_speed_m_s(19.5)) / water_speed_m_s(20.0)
    data = {"temperature_c": 20.0, "mm_per_c": slope, "standoff_mm": 15.0}
    notes = [b["text"] for b in display(document("x", record=record, data=data))["blocks"] if b["kind"] == "text"][1:]
    # 1 deg C at 15 mm is 15 mm times the relative change of the speed of sound.
    moved = 15.0 * (water_speed_m_s(21.0) / water_speed_m_s(20.0) - 1.0)
    assert f"(+{moved:.3f} mm)" in notes[0]
    assert "changed by −2.5 dB" in notes[1]
    assert "inspected again" in notes[1]
    assert notes[2:] == ["The calibration of the reference block was due on 2026-02-01, before the scan began."]


def test_a_wrong_record_says_where_and_what_is_known():
    with pytest.raises(EchoBaseError) as caught:
        record_from({"part": {"nummer": "1"}, "couplant": {"temperature_end_c": 200}})
    issues = {i.code: i for i in caught.value.issues}
    assert "serial" in issues["field-unknown"].remedy
    assert "couplant.temperature_end_c" in issues["field-invalid"].message
    with pytest.raises(ValidationError):
        Record.model_validate({"people": {"begun": "2026-03-01T08:00:00"}})  # no time zone


def seen(distance, db, tilt=0.5) -> Expected:
    d, n = np.asarray(distance, float), len(distance)
    on = np.ones(n, dtype=bool)
    on[-1] = False  # beside the part: takes no part in any figure
    summary = Prediction(
        float(d[on].std()), float(np.ptp(d[on])), tilt, 0.5, float(np.abs(np.asarray(db, float)[on]).mean())
    )
    zero = np.zeros(n)
    return Expected(d, d, zero, zero, zero, np.asarray(db, float), on, summary)


def test_the_comparison_is_plain_arithmetic():
    before, after = seen([10, 12, 14, 99], [-2, -4, -6, -90]), seen([15, 15.5, 16, 99], [-1, -1, -1, -90])
    table, figures = comparison(
        (State("before", "before", None, before), State("after", "ours", (1, 2, 3, 0.1, 0.2, 0.3), after))
    )
    assert figures["before"]["mean_abs_db"] == pytest.approx(4.0)
    assert figures["after"]["amplitude_improvement_pct"] == pytest.approx(100 * (4 - 1) / 4)
    assert figures["after"]["tof_range_improvement_pct"] == pytest.approx(100 * (4 - 1) / 4)
    assert figures["after"]["tof_std_mm"] == pytest.approx(np.std([15, 15.5, 16]))
    rows = {row[0]: [shown(c) for c in row[1:]] for row in table.rows}
    assert rows["Correction Z (mm)"] == ["–", "+3.000"]
    assert rows["Improvement of mean |dB|"] == ["–", "75.0 %"]


def test_numbers_as_they_are_shown():
    assert shown(Number(value=-0.0004, decimals=3)) == "0.000"
    assert shown(Number(value=-1.5, decimals=1, signed=True)) == "−1.5"
    assert shown(Number(value=1.5, decimals=1, signed=True, unit="mm")) == "+1.5 mm"
    assert shown(Number(value=None)) == "–"
    values = np.linspace(-0.4, 0.4, 1001)
    assert np.quantile(np.abs(values), 0.99) <= limit_of(values) <= 0.5
