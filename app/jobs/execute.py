"""Runs one payload: fetch its blobs into a private folder, call the task, store what it wrote. The same on every machine."""

import logging
import tempfile
import traceback
from pathlib import Path

from app.jobs.payload import Cancelled, Outcome, Payload, Progress
from app.jobs.tasks import TASKS
from app.store.blobs import CHUNK, BlobStore, BlobWriter, open_blobs
from app.store.content import LARGEST_RESULT
from app.store.names import is_relative_name
from planner.errors import EchoBaseError
from planner.issues import Issue

log = logging.getLogger(__name__)


def execute(payload: Payload, progress: Progress) -> Outcome:
    """Run a payload; every failure is an outcome with issues, never an exception."""
    try:
        blobs = open_blobs(payload.store_url)
        with tempfile.TemporaryDirectory(prefix="echobase-job-") as name:
            folder = Path(name)
            _fetch(blobs, payload, folder / "in")
            (folder / "out").mkdir()
            progress(0.0, "started")
            data = TASKS[payload.task](payload.workflow, folder / "in", folder / "out", payload.options, progress)
            return Outcome(_keep(blobs, folder / "out"), data)
    except Cancelled:
        return Outcome(cancelled=True)
    except EchoBaseError as error:
        return Outcome(issues=error.issues, failed=True)
    except MemoryError:
        text = "the work needs more memory than there is."
        return _failed("memory-short", text, "Use a coarser CAD or a smaller scan.")
    except OSError as error:
        text = f"the file system refused: {error.strerror or error}."
        return _failed("os-error", text, "Check free space and permissions of the data folder.")
    except Exception:  # noqa: BLE001 - the last line of defence of a worker: a sentence for the person, the rest to the log
        log.error("task %s failed:\n%s", payload.task, traceback.format_exc())
        return _failed(
            "internal", "EchoBase has a fault of its own; nothing was made that could be used.", "Please report it."
        )


def _failed(code: str, message: str, remedy: str) -> Outcome:
    return Outcome(issues=(Issue("error", code, message, remedy),), failed=True)


def _fetch(blobs: BlobStore, payload: Payload, folder: Path) -> None:
    folder.mkdir()
    for name, sha256 in payload.files.items():
        if not is_relative_name(name):
            raise ValueError(f"'{name}' is not a relative name")
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        blobs.copy_to(sha256, target)


def _keep(blobs: BlobStore, folder: Path) -> dict[str, tuple[str, int]]:
    kept: dict[str, tuple[str, int]] = {}
    for path in sorted(folder.rglob("*")):
        if not path.is_file():
            continue
        name = path.relative_to(folder).as_posix()
        if not is_relative_name(name):
            raise ValueError(f"'{name}' is not a relative name")
        with BlobWriter(blobs, LARGEST_RESULT) as writer, path.open("rb") as file:
            while data := file.read(CHUNK):
                writer.write(data)
            blob = writer.finish()
        kept[name] = (blob.sha256, blob.size)
    return kept
