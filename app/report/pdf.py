"""The report as PDF by typst: fonts that come with it and with matplotlib, and those of a folder that somebody names."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.report.display import display
from app.report.document import Document
from app.report.pdf_fonts import families, fonts, undrawable
from planner.errors import fail

TEMPLATE = Path(__file__).with_name("template.typ")
MOST_NAMED = 8


def pdf(document: Document, figures: Mapping[str, str]) -> bytes:
    """Return the PDF; the same document and figures give the same bytes. Text reaches typst as data, never as markup."""
    import typst  # noqa: PLC0415 - 30 MB that only a report needs

    # The files of a document as a dict is what it takes, and what its type hints leave out.
    compile_files: Any = typst.compile

    content = display(document)
    if missing := undrawable(content):
        content["blocks"].insert(0, {"kind": "text", "text": _said(missing), "soft": False})
    files: dict[str, bytes] = {
        "main.typ": TEMPLATE.read_bytes(),
        "report.json": json.dumps({**content, "fonts": families()}).encode(),
        **{f"figures/{name}.svg": svg.encode() for name, svg in figures.items()},
    }
    try:
        # A fixed time stamp, since PDF has a field for one: when the report was made stands in its text.
        made = compile_files(files, font_paths=list(fonts()), ignore_system_fonts=True, timestamp=0)
    except typst.TypstError as error:
        raise fail("report-pdf", "the report could not be set as PDF.", "Use the HTML, and report this.") from error
    return bytes(made)


def _said(missing: list[str]) -> str:
    named = ", ".join(f"U+{ord(c):04X}" for c in missing[:MOST_NAMED])
    more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
    return (
        f"The fonts of this PDF lack {len(missing)} of the characters used ({named}{more}): boxes stand in their place; "
        "report.html shows them."
    )
