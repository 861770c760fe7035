"""The report as one HTML page: no scripts, nothing fetched, prints on A4."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import jinja2

from app.report.display import display
from app.report.document import Document


def html(document: Document, figures: Mapping[str, str]) -> bytes:
    """Return the page. figures: name -> SVG text, ours; everything else is escaped."""
    return _template().render(d=display(document), figures=figures).encode()


@cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html")
