"""Insight and findings as the JSON that pages hear."""

from typing import Any

from app.view.model import Insight


def insight_json(insight: Insight | None) -> dict[str, Any]:
    """Return what an insight says in numbers; null where nothing is known."""
    if insight is None:
        return {"version": None, "coverage": None, "normal_error_mm": None, "sigma": {}, "status": {}, "issues": []}
    path = insight.path
    return {
        "version": insight.version,
        "coverage": insight.coverage,
        "normal_error_mm": insight.normal_error_mm,
        "sigma": insight.sigma,
        "status": insight.status,
        "poses": len(path) if path is not None else 0,
        "issues": [issue.to_json() for issue in insight.issues],
    }
