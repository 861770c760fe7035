"""A `Part` as one .npz without pickle: quick to load again, with the SHA-256 of the CAD file it came from."""

import json
from dataclasses import asdict
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from planner.errors import fail
from planner.part import Part, Provenance

VERSION = 1


def save_part(part: Part, path: Path) -> None:
    """Write a part to `path` (.npz)."""
    about = {
        "version": VERSION,
        "provenance": asdict(part.provenance),
        "chord_error_mm": part.chord_error_mm if np.isfinite(part.chord_error_mm) else None,
        "meta": part.meta,
    }
    text = np.frombuffer(json.dumps(about).encode("utf-8"), dtype=np.uint8)
    with path.open("wb") as file:
        np.savez(file, vertices=part.vertices, faces=part.faces, about=text)


def load_part(path: Path) -> Part:
    """Return the part written by `save_part`. Raises EchoBaseError `part-file` if it is not one."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            about = json.loads(stored["about"].tobytes().decode("utf-8"))
            vertices, faces = stored["vertices"], stored["faces"]
        if about["version"] != VERSION:
            raise ValueError(f"version {about['version']}")
        provenance = Provenance(**(about["provenance"] | {"notes": tuple(about["provenance"]["notes"])}))
        chord = about["chord_error_mm"]
        return Part(
            np.asarray(vertices, dtype=np.float64),
            np.asarray(faces, dtype=np.int32),
            provenance,
            float("nan") if chord is None else float(chord),
            dict(about["meta"]),
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
        raise fail(
            "part-file", f"The stored part cannot be read ({error}).", "Read the CAD file again.", path.name
        ) from error
