"""Freshness: a result counts only while everything it was made from is in force. Digests decide, nobody remembers."""

from typing import Any

from sqlalchemy.orm import Session

from app.store.inputs import current
from app.store.results import correction_in_force, latest
from app.store.scans import all_scans
from app.store.store import VERSION
from app.store.tables import INPUT_KINDS, ProjectRow, ResultRow

IN_WORDS = {
    "part": "the part", "setup": "the setup", "surface": "the inspection surface", "keypoints": "the key points",
    "version": "the version of EchoBase", "plan": "the plan", "scans": "a scan that was deleted",
    "correction": "the alignment in force", "together": "the plan or a scan of a project aligned together with it",
}  # fmt: skip


def plan_inputs(session: Session, project_id: str) -> dict[str, Any]:
    """Return the digests of what a plan made now would be made from."""
    return {kind: current(session, project_id, kind).sha256 for kind in INPUT_KINDS} | {"version": VERSION}


def changed_since(session: Session, row: ResultRow) -> list[str]:
    """Return what is no longer as it was when the result was made; empty for a fresh one."""
    if row.kind == "plan":
        return _differences(row.inputs, plan_inputs(session, row.project_id))
    plan = latest(session, row.project_id, "plan")
    changed = changed_since(session, plan) if plan else ["plan"]
    if plan is not None and plan.sha256 != row.inputs["plan"]:
        changed.append("plan")
    if row.inputs["version"] != VERSION:
        changed.append("version")
    present = {scan.sha256 for scan in all_scans(session, row.project_id)}
    if not set(row.inputs["scans"]) <= present:
        changed.append("scans")
    if any(_moved_on(session, other) for other in row.inputs.get("together", [])):
        changed.append("together")
    # An assessment judges the program of one correction: beside another program it proves nothing.
    if "correction" in row.inputs and row.inputs["correction"] != correction_in_force(session, row.project_id):
        changed.append("correction")
    return sorted(set(changed))


def _moved_on(session: Session, other: dict[str, Any]) -> bool:
    """Return whether another project no longer has the plan or a scan that determined a common correction.

    A project that is not here (deleted, or left behind by an import) cannot have changed: correction.json names its digests.
    """
    if session.get(ProjectRow, other["project"]) is None:
        return False
    plan = latest(session, other["project"], "plan")
    if plan is None or plan.sha256 != other["plan"] or changed_since(session, plan):
        return True
    return not set(other["scans"]) <= {scan.sha256 for scan in all_scans(session, other["project"])}


def in_words(changed: list[str]) -> str:
    """Return what changed as part of a sentence."""
    return " and ".join(IN_WORDS[c] for c in changed)


def _differences(then: dict[str, Any], present: dict[str, Any]) -> list[str]:
    return sorted(name for name in present if then.get(name) != present[name])
