"""Issues as a block of a report."""

from collections.abc import Sequence
from typing import Any

from app.report.document import Block, Issues, Said
from planner.issues import Issue


def issues_of(found: Sequence[Any]) -> list[Block]:
    """Return issues (JSON or nouns), errors first."""
    plain = [i.to_json() if isinstance(i, Issue) else i for i in found]
    rank = {"error": 0, "warning": 1, "info": 2}
    said = [Said(**{k: i[k] for k in ("severity", "message", "remedy", "where")}) for i in plain]
    return [Issues(issues=tuple(sorted(said, key=lambda s: rank[s.severity])))] if said else []
