"""Nouns behind results, for the 3D view: planned paths, the cloud of a scan, where an alignment found the part."""

import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from app.jobs.specs import suffix_of
from app.store import inputs, results, scans
from app.store.content import get_bytes
from app.store.store import Store
from app.store.tables import ResultRow
from app.view.model import Found
from planner.frames import AXES, Array, Transform
from planner.placement import corrected_base, part_from_correction
from planner.setup import Setup


def load_paths(store: Store, row: ResultRow) -> dict[str, Any]:
    """Return the dense paths of a plan by kind."""
    from app.plan import load_plan  # noqa: PLC0415 - big, and only asked for by an open view

    with store.db.read() as session:
        files = inputs.files_of(session, row.project_id, f"plan:{row.number}")
    with tempfile.TemporaryDirectory(prefix="echobase-view-") as name:
        for file in ("plan.json", "plan.npz"):
            store.blobs.copy_to(files[file].sha256, Path(name) / file)
        plan = load_plan(Path(name))
    return {"alignment": plan.alignment, "inspection": plan.inspection}


def load_cloud(store: Store, project_id: str, setup: Setup, keep: Callable[[str, Any, Callable[[], Any]], Any]) -> Any:
    """Return the point cloud of the newest scan of the alignment path, or None; `keep` remembers it by its digests."""
    with store.db.read() as session:
        fitting = [s for s in scans.all_scans(session, project_id) if s.path in (None, "alignment")]
        if not fitting:
            return None
        scan = fitting[-1]
        files = inputs.files_of(session, project_id, f"scan:{scan.number}")
        aligned = results.latest(session, project_id, "alignment")
    last = None
    if scan.base == "corrected" and aligned is not None and aligned.verdict != "fail":
        last = correction_of(aligned)
    key = (scan.sha256, setup, aligned.sha256 if last is not None and aligned is not None else None)

    def make() -> Any:
        from app.steps.scans import cloud_of, read_scans  # noqa: PLC0415 - as above

        with tempfile.TemporaryDirectory(prefix="echobase-view-") as folder:
            sources = []
            for place, (name, file) in enumerate(sorted(files.items()), start=1):
                sources.append(Path(folder) / f"scan-{scan.number}-{place}{suffix_of(name)}")
                store.blobs.copy_to(file.sha256, sources[-1])
            read = read_scans(sources)
        T_world_corrected = None if last is None else corrected_base(setup.T_world_base, last)
        base: Any = scan.base
        return cloud_of(read, setup, base, T_world_corrected)

    return keep("cloud", key, make)


def correction_of(row: ResultRow) -> Transform:
    """Return `T_base_basecorr` of an alignment."""
    correction = row.summary["correction"]
    six = [float(correction[f"{axis}_{'mm' if axis in 'xyz' else 'deg'}"]) for axis in AXES]
    return Transform.from_xyzabc("base", "basecorr", six)


def found_of(store: Store, row: ResultRow, setup: Setup) -> Found:
    """Return where an alignment found the part, and in which shape if its poses follow that."""
    T_base_part = part_from_correction(correction_of(row), setup.T_base_partnom)
    status = {k["id"]: (k["status"], k.get("reason")) for k in row.summary.get("keypoints", [])}
    followed = (row.summary.get("non_rigid") or {}).get("applied", False)
    return Found(T_base_part, row.verdict, status, _shape(store, row) if followed else None)


def _shape(store: Store, row: ResultRow) -> tuple[Array, Array] | None:
    with store.db.read() as session:
        file = inputs.files_of(session, row.project_id, f"alignment:{row.number}").get("correction/field.npz")
    if file is None:
        return None
    with np.load(io.BytesIO(get_bytes(store.blobs, file.sha256)), allow_pickle=False) as arrays:
        return arrays["nodes"], arrays["values"]
