"""The report as PDF by typst: fonts that come with it and with matplotlib, nothing from the system or the network."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from app.report.display import display
from app.report.document import Document
from planner.errors import fail

TEMPLATE = Path(__file__).with_name("template.typ")


def pdf(document: Document, figures: Mapping[str, str]) -> bytes:
    """Return the PDF; the same document and figures give the same bytes. Text reaches typst as data, never as markup."""
    import typst  # noqa: PLC0415 - 30 MB that only a report needs

    # The files of a document as a dict is what it takes, and what its type hints leave out.
    compile_files: Any = typst.compile

    files: dict[str, bytes] = {
        "main.typ": TEMPLATE.read_bytes(),
        "report.json": json.dumps(display(document)).encode(),
        **{f"figures/{name}.svg": svg.encode() for name, svg in figures.items()},
    }
    try:
        # A fixed time stamp, since PDF has a field for one: when the report was made stands in its text.
        made = compile_files(files, font_paths=_fonts(), ignore_system_fonts=True, timestamp=0)
    except typst.TypstError as error:
        raise fail("report-pdf", "the report could not be set as PDF.", "Use the HTML, and report this.") from error
    return bytes(made)


@cache
def _fonts() -> list[Path]:
    import matplotlib as mpl  # noqa: PLC0415 - as above

    return [Path(mpl.get_data_path()) / "fonts" / "ttf"]
