"""Artifacts on disk: written whole or not at all, old programs removed first."""

import os
import shutil
import tempfile
from pathlib import Path, PurePosixPath

from planner.errors import fail

# Only folders and files that EchoBase itself writes are ever removed.
PROGRAM_SUFFIXES = {".src", ".dat", ".json", ".csv", ".txt", ".html", ".zip", ".svg", ".npz", ".pdf"}


def write_artifacts(folder: Path, artifacts: dict[str, bytes]) -> None:
    """Write relative name -> bytes under a folder; each file appears whole (temporary file, then rename)."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in artifacts.items():
        relative = PurePosixPath(name)
        if relative.is_absolute() or ".." in relative.parts:
            raise fail("name-unsafe", f"'{name}' is not a name inside the folder.", "", str(folder))
        target = folder.joinpath(*relative.parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".writing-")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            umask = os.umask(0)
            os.umask(umask)
            Path(temporary).chmod(0o666 & ~umask)
            Path(temporary).replace(target)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def clear_programs(folder: Path, *names: str) -> None:
    """Empty the named subfolders of what EchoBase writes, so that no old program survives a step that fails."""
    for name in names:
        sub = folder / name
        if not sub.is_dir():
            continue
        foreign = [p for p in sub.rglob("*") if p.is_file() and p.suffix.lower() not in PROGRAM_SUFFIXES]
        if foreign:
            text = f"'{sub}' holds files that EchoBase did not write ({foreign[0].name})."
            raise fail("folder-foreign", text, "Choose another output folder.", str(sub))
        shutil.rmtree(sub)
