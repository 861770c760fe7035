"""The last gate before a program leaves the house: fresh, not failed, accepted where it must be, proven, and undamaged."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from sqlalchemy.orm import Session

from app.store.blobs import BlobStore
from app.store.content import get_bytes
from app.store.freshness import changed_since, in_words
from app.store.inputs import files_of
from app.store.refusal import Refusal, refuse
from app.store.results import latest
from app.store.tables import FileRow, ResultRow
from planner.issues import Issue, errors_in

OWNER = {"alignment": "plan", "inspection": "plan", "corrected": "alignment"}
PROOF_IN = {"plan": ("plan.json",), "alignment": ("correction/correction.json", "correction/report.html")}
"""Where a result keeps what was proven of its programs, with the SHA-256 of every file."""
KRL = (".src", ".dat")


@dataclass(frozen=True)
class Handout:
    """The files of a program folder (name without the folder -> bytes) and the result they belong to."""

    which: str
    result: ResultRow
    files: dict[str, bytes]


def why_not(session: Session, project_id: str, which: str) -> Refusal | None:
    """Return why a program cannot be had now, or None; does not read its bytes."""
    try:
        permitted(session, project_id, which)
    except Refusal as refusal:
        return refusal
    return None


def permitted(session: Session, project_id: str, which: str) -> tuple[ResultRow, dict[str, FileRow]]:
    """Return the result a program belongs to and its files; raises Refusal 409 with what to do."""
    kind = OWNER[which]
    row = latest(session, project_id, kind)
    if row is None:
        remedy = "Plan first." if kind == "plan" else "Align first."
        raise refuse(409, f"{kind}-missing", f"there is no {kind} yet.", remedy, which)
    changed = changed_since(session, row)
    if changed:
        remedy = "Plan again." if kind == "plan" or set(changed) - {"scans", "together"} else "Align again."
        text = f"the {which} program is stale: {in_words(changed)} changed since."
        raise refuse(409, "program-stale", text, remedy, which)
    if kind == "alignment":
        _require_verdict(row)
    own = files_of(session, project_id, f"{kind}:{row.number}")
    files = {name.removeprefix(f"{which}/"): file for name, file in own.items() if name.startswith(f"{which}/")}
    if not any(name.endswith(".src") for name in files):
        raise Refusal(409, *_reasons(row, which))
    return row, files


def hand_out(session: Session, blobs: BlobStore, project_id: str, which: str) -> Handout:
    """Return a program's exact, proven bytes; raises Refusal 409 for one that may not leave, 500 for damaged bytes."""
    row, rows = permitted(session, project_id, which)
    own = files_of(session, project_id, f"{row.kind}:{row.number}")
    proofs = (own[name] for name in (*PROOF_IN[row.kind], f"{which}/manifest.json") if name in own)
    manifest = "".join(get_bytes(blobs, file.sha256).decode("utf-8", "replace") for file in proofs)
    files = {name: get_bytes(blobs, file.sha256) for name, file in rows.items()}
    programs = {name: content for name, content in files.items() if name.endswith(KRL)}
    unproven = [name for name in programs if rows[name].sha256 not in manifest]
    if unproven:
        text = f"the {which} program has no proof for {', '.join(sorted(unproven))}."
        raise refuse(409, "program-unproven", text, "Plan again.", which)
    # The reader that proves an export reads these very bytes once more: also after an import, also after a repair.
    faults = errors_in(import_module("kuka_export.check").check_files(programs))
    if faults:
        first = Issue(
            "error", "program-unproven", f"the {which} program does not read back without faults.", "Plan again.", which
        )
        raise Refusal(409, first, *faults)
    return Handout(which, row, files)


def _require_verdict(row: ResultRow) -> None:
    if row.verdict == "fail":
        raise refuse(
            409, "alignment-failed", "the last alignment failed; there is no corrected program.",
            "See its issues, scan again, then align again.", f"alignment {row.number}",
        )  # fmt: skip
    accepted: dict[str, Any] | None = row.accepted
    if row.verdict != "pass" and (accepted is None or accepted.get("sha256") != row.sha256):
        raise refuse(
            409, "acceptance-missing", "the alignment is partial: somebody must take it over first.",
            "Read its reasons, then accept it with your name and why.", f"alignment {row.number}",
        )  # fmt: skip


def _reasons(row: ResultRow, which: str) -> list[Issue]:
    issues = row.summary.get("issues", [])
    faults = [Issue(**issue) for issue in issues if issue.get("severity") == "error"]
    text = f"the {which} program was not written."
    return [Issue("error", "program-missing", text, "Correct what the issues say, then plan again.", which), *faults]
