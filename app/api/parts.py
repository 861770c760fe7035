"""Reads an uploaded part in the limited child process and keeps what was read beside the upload."""

import io
import json
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from app.api.models import PartInfo
from app.store import inputs
from app.store.blobs import Blob, BlobStore
from app.store.content import get_bytes, put_bytes
from app.store.inputs import Input
from app.store.store import Store
from planner.part import Part, Provenance
from planner.units import MM_PER, LengthUnit


def keep_part(
    store: Store, project_id: str, source: Blob, name: str, unit: LengthUnit | None, expected: int | None
) -> Input:
    """Read a stored CAD file and put it in force; raises EchoBaseError, and changes nothing, if it cannot be read.

    Call it inside `store.busy()`: until it returns, no row names the blobs.
    """
    with tempfile.TemporaryDirectory(prefix="echobase-part-") as folder:
        path = Path(folder) / "source"
        store.blobs.copy_to(source.sha256, path)
        part: Part = import_module(store.settings.workflow).open_part(path, name, unit)
    arrays = put_bytes(store.blobs, _npz(part))
    chord = part.chord_error_mm
    content = {
        "name": name,
        "unit": part.provenance.unit,
        "given_unit": unit,
        "sha256": source.sha256,
        "bytes": source.size,
        "triangles": len(part.faces),
        "extents_mm": [round(float(v), 4) for v in part.extents_mm],
        "centre_mm": [round(float(v), 4) for v in 0.5 * (part.vertices.min(axis=0) + part.vertices.max(axis=0))],
        "chord_error_mm": float(chord) if np.isfinite(chord) else None,
        "notes": list(part.provenance.notes),
    }
    return inputs.put_part(store, project_id, content, {"source": source, "part.npz": arrays}, expected)


def load_part(store: Store, project_id: str) -> Part | None:
    """Return the part in force from the arrays kept at its upload, or None."""
    with store.db.read() as session:
        row = inputs.current(session, project_id, "part")
        if not row.is_given:
            return None
        files = inputs.files_of(session, project_id, f"part:{row.version}")
    return part_from(store.blobs, files["part.npz"].sha256, row.content)


def part_from(blobs: BlobStore, arrays_sha256: str, content: dict[str, Any]) -> Part:
    """Return a part from its stored arrays and properties."""
    with np.load(io.BytesIO(get_bytes(blobs, arrays_sha256)), allow_pickle=False) as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
        meta = json.loads(str(arrays["meta"]))
    origin = Provenance(content["name"], content["sha256"], content["unit"], tuple(content["notes"]))
    chord = float("nan") if content["chord_error_mm"] is None else float(content["chord_error_mm"])
    return Part(vertices, faces, origin, chord, meta)


def info_of(row: Input) -> PartInfo:
    """Return what the page shows of a part."""
    content = row.content
    own = MM_PER.get(content["unit"], 1.0)
    sizes = {unit: [round(v / own * mm, 4) for v in content["extents_mm"]] for unit, mm in MM_PER.items()}
    shown = {key: content[key] for key in PartInfo.model_fields if key in content}
    return PartInfo(version=row.version, size_if=sizes, **shown)


def _npz(part: Part) -> bytes:
    buffer = io.BytesIO()
    try:
        meta = json.dumps(part.meta, allow_nan=False)
    except (TypeError, ValueError):
        meta = "{}"  # what JSON cannot carry is for the reader's own use
    np.savez(buffer, vertices=part.vertices, faces=part.faces, meta=np.array(meta))
    return buffer.getvalue()
