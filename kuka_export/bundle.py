"""The zip a user downloads: modules, manifest, dense path, run sheet."""

import io
import json
import zipfile
from collections.abc import Mapping

from kuka_export.dense import dense_csv
from kuka_export.export import Export
from kuka_export.runsheet import run_sheet_html, run_sheet_text
from planner.setup import Setup
from planner.toolpath import ToolPath

# Equal inputs give equal bytes: a zip entry without a clock.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def bundle(export: Export, dense_path: ToolPath, setup: Setup, extra: Mapping[str, bytes] | None = None) -> bytes:
    """Return the zip of an export. `dense_path`: the path before decimation, for the acquisition side.

    One folder `krl` (a folder a load, if there are several), `manifest.json`, `path.csv`, `run_sheet.html`, `run_sheet.txt`,
    and what `extra` adds by name.
    """
    program = export.program
    members: dict[str, bytes] = {}
    for k, load in enumerate(program.loads, 1):
        folder = "krl" if len(program.loads) == 1 else f"krl/load_{k}"
        for module in (load.main, *load.modules):
            for name in (f"{module}.src", f"{module}.dat"):
                if name in export.files:
                    members[f"{folder}/{name}"] = export.files[name]
    members["manifest.json"] = (json.dumps(export.manifest, indent=1) + "\n").encode()
    members["path.csv"] = dense_csv(dense_path, setup)
    members["run_sheet.html"] = run_sheet_html(program, export.proof, setup).encode()
    members["run_sheet.txt"] = run_sheet_text(program, export.proof, setup).encode()
    members.update(extra or {})
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
