"""Builds the specification of a job from what is in force: which blobs, which options, made from what."""

from typing import Any

from sqlalchemy.orm import Session

from app.store import inputs, scans
from app.store.freshness import changed_since, in_words, plan_inputs
from app.store.refusal import refuse
from app.store.results import CORRECTION, correction_in_force, latest
from app.store.store import VERSION
from app.store.tables import ResultRow, ScanRow

Spec = dict[str, Any]


def plan_spec(session: Session, pid: str) -> Spec:
    """Return the work of planning with what is in force; raises Refusal 409 without a part."""
    part = inputs.current(session, pid, "part")
    if not part.is_given:
        raise refuse(409, "part-missing", "the project has no part yet.", "Upload one first.", "part")
    files = inputs.files_of(session, pid, f"part:{part.version}")
    options = {
        "part_name": part.content["name"],
        "unit": part.content["given_unit"],
        "setup": inputs.current(session, pid, "setup").content,
        "keypoints": inputs.current(session, pid, "keypoints").content,
        "seeds": [list(seed) for seed in inputs.seeds_in(session, pid)],
    }
    return {"files": {"part/source": files["source"].sha256}, "options": options, "inputs": plan_inputs(session, pid)}


def simulate_spec(session: Session, pid: str, options: dict[str, Any]) -> Spec:
    """Return the work of a rehearsal; raises Refusal 409 if the program it would run may not be handed out."""
    plan = fresh_plan(session, pid)
    files = _plan_files(session, plan)
    made_from = {"plan": plan.sha256, "version": VERSION}
    if options["path"] == "corrected":
        alignment = latest(session, pid, "alignment")
        if alignment is None:
            raise refuse(409, "alignment-missing", "there is no alignment yet.", "Align first.", "alignment")
        _require_fresh(session, alignment, "Align again.")
        files |= {n: f.sha256 for n, f in inputs.files_of(session, pid, f"alignment:{alignment.number}").items()}
        made_from["alignment"] = alignment.sha256
    return {"files": files, "options": options, "inputs": made_from}


def align_spec(session: Session, pid: str, numbers: list[int] | None, options: dict[str, Any]) -> Spec:
    """Return the work of aligning with some scans (None: the newest of the alignment path)."""
    plan = fresh_plan(session, pid)
    chosen = (
        [scans.get_scan(session, pid, n) for n in numbers] if numbers else [_newest(session, pid, (None, "alignment"))]
    )
    base = options["base"] or _one_base(chosen)
    files, scan_files = _scan_files(session, chosen, "scans")
    spec_options = {**options, "base": base, "scan_files": scan_files, "scans": [s.number for s in chosen]}
    made_from: dict[str, Any] = {"plan": plan.sha256, "scans": [s.sha256 for s in chosen], "version": VERSION}
    if base == "corrected":
        files |= _correction(session, pid, chosen)
    return {"files": _plan_files(session, plan) | files, "options": spec_options, "inputs": made_from}


def assess_spec(
    session: Session, pid: str, numbers: list[int] | None, before: list[int], base: str | None, before_base: str | None
) -> Spec:
    """Return the work of judging the scans of one inspection, against those from before if there are any."""
    plan = fresh_plan(session, pid)
    after = (
        [scans.get_scan(session, pid, n) for n in numbers]
        if numbers
        else [_newest(session, pid, (None, "inspection", "corrected"))]
    )
    earlier = [scans.get_scan(session, pid, n) for n in before]
    files, scan_files = _scan_files(session, after, "scans")
    more, before_files = _scan_files(session, earlier, "before")
    setup = inputs.setup_in(session, pid)
    options = {
        "scan_files": scan_files, "before_files": before_files,
        "scans": [s.number for s in after], "before": [s.number for s in earlier],
        "base": base or _one_base(after), "before_base": before_base or (_one_base(earlier) if earlier else None),
        "standoff_mm": setup.standoff_mm, "loss_db": setup.tolerances.loss_db,
    }  # fmt: skip
    made_from = {"plan": plan.sha256, "scans": [s.sha256 for s in (*after, *earlier)], "version": VERSION}
    made_from["correction"] = correction_in_force(session, pid)
    more |= _correction(session, pid, [*after, *earlier])
    return {"files": _plan_files(session, plan) | files | more, "options": options, "inputs": made_from}


def fresh_plan(session: Session, pid: str) -> ResultRow:
    """Return the newest plan; raises Refusal 409 if there is none or it is stale."""
    plan = latest(session, pid, "plan")
    if plan is None:
        raise refuse(409, "plan-missing", "nothing is planned yet.", "Plan first.", "plan")
    return _require_fresh(session, plan, "Plan again.")


def _require_fresh(session: Session, row: ResultRow, remedy: str) -> ResultRow:
    changed = changed_since(session, row)
    if changed:
        text = f"the {row.kind} is stale: {in_words(changed)} changed since."
        raise refuse(409, f"{row.kind}-stale", text, remedy, row.kind)
    return row


def _plan_files(session: Session, plan: ResultRow) -> dict[str, str]:
    return {name: f.sha256 for name, f in inputs.files_of(session, plan.project_id, f"plan:{plan.number}").items()}


def _correction(session: Session, pid: str, taken: list[ScanRow]) -> dict[str, str]:
    """Return the correction.json that gives the BASE of scans: the one in force when they came, not one made since.

    Scans that do not know it (they came before any, or from an older server) stand in the one in force now.
    """
    known = {scan.detail.get("correction") for scan in taken if scan.base == "corrected"} - {None, ""}
    if len(known) > 1:
        raise refuse(
            409, "bases-differ", "the scans were taken in the BASE of different corrections.",
            "Align or assess them one after the other.", "scans",
        )  # fmt: skip
    sha256 = next(iter(known), "") or correction_in_force(session, pid)
    return {CORRECTION: sha256} if sha256 else {}


def _scan_files(session: Session, chosen: list[ScanRow], folder: str) -> tuple[dict[str, str], list[str]]:
    """Return blobs by relative name, and those names in order. A name only keeps the suffix a reader goes by."""
    files: dict[str, str] = {}
    for scan in chosen:
        own = sorted(inputs.files_of(session, scan.project_id, f"scan:{scan.number}").items())
        for place, (name, row) in enumerate(own, start=1):
            stem = f"scan-{scan.number}" if len(own) == 1 else f"scan-{scan.number}-{place}"
            files[f"{folder}/{stem}{suffix_of(name)}"] = row.sha256
    return files, list(files)


def suffix_of(name: str) -> str:
    """Return the suffix of a shown file name, lower case, `.csv.gz` whole; empty if it has none of letters and digits."""
    stem, dot, last = name.lower().rpartition(".")
    if not dot or not last.isalnum() or not last.isascii() or len(last) > 8:
        return ""
    inner = suffix_of(stem) if last in ("gz", "zst") else ""
    return f"{inner}.{last}"


def _one_base(chosen: list[ScanRow]) -> str | None:
    bases = {scan.base for scan in chosen}
    if len(bases) > 1:
        raise refuse(
            422,
            "bases-differ",
            "the scans were taken in different BASEs.",
            "Say which with 'base', or align them one by one.",
            "base",
        )
    return bases.pop()


def _newest(session: Session, pid: str, paths: tuple[str | None, ...]) -> ScanRow:
    fitting = [scan for scan in scans.all_scans(session, pid) if scan.path in paths]
    if not fitting:
        raise refuse(
            409,
            "scan-missing",
            "there is no scan for this yet.",
            "Upload one, or rehearse with the simulated scanner.",
            "scan",
        )
    return fitting[-1]
