"""Files from outside are parsed in a disposable child process: a reader that crashes is an answer, not an outage.

`run_limited("package.module:function", source, options)` calls `function(source, options) -> (arrays, meta)` in a fresh
interpreter with limits on memory, time and file size, no core dump and a private folder. Arrays come back as .npy files
read without pickle, the rest as JSON.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import EchoBaseError, fail
from planner.issues import Issue

CONSOLE_BYTES = 20_000
STOP_WITHIN_S = 0.1
ROOT = Path(__file__).resolve().parents[1]
# Libraries of the child that start a thread for every core, each with its own arena, run into the memory limit.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1") | {
    "POLARS_MAX_THREADS": "2",
    "MALLOC_ARENA_MAX": "2",
}


@dataclass(frozen=True)
class SandboxLimits:
    """What a reader may use: address space (MB), processor time (s), wall time (s), size of any file it writes (MB)."""

    memory_mb: int = 4096
    cpu_s: int = 180
    wall_s: float = 200.0
    file_mb: int = 4096


def run_limited(
    target: str,
    source: Path,
    options: dict[str, Any],
    limits: SandboxLimits | None = None,
    stop: threading.Event | None = None,
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return `(arrays, meta)` of `target` called with a file and JSON-able options, in a child process.

    `meta["console"]` is what the reader and its libraries wrote to standard output and error (at most 20 kB).
    Raises EchoBaseError: the child's own issues; or `reader-memory`, `reader-time`, `reader-crash`, `reader-failed`;
    `reader-stopped` if somebody set `stop` meanwhile: the child is then ended at once.
    Safe to call from threads, pool workers and servers: nothing is forked, no main module is run again.
    """
    limits = limits or SandboxLimits()
    source = Path(source).resolve()
    with tempfile.TemporaryDirectory(prefix="echobase-") as folder:
        work = Path(folder)
        request = {"target": target, "source": str(source), "options": options, "limits": asdict(limits)}
        (work / "request.json").write_text(json.dumps(request), encoding="utf-8")
        code = _run_child(work, limits.wall_s, stop)
        if code is None and stop is not None and stop.is_set():
            raise fail("reader-stopped", "Reading the file was stopped.", "Start it again.", source.name)
        console = _console(work)
        if code is None:
            raise _too_slow(source, f"{limits.wall_s:g} s")
        outcome = _outcome(work)
        if outcome is None:
            raise _death(source, code, console, limits)
        if "issues" in outcome:
            raise EchoBaseError(*(Issue(**issue) for issue in outcome["issues"]))
        if "memory" in outcome:
            raise _too_big(source, limits)
        if "failed" in outcome:
            raise fail(
                "reader-failed", f"The file could not be read ({outcome['failed']}).", "Export it again.", source.name
            )
        arrays = {name: np.load(work / f"{i}.npy", allow_pickle=False) for i, name in enumerate(outcome["arrays"])}
        return arrays, outcome["meta"] | {"console": console}


def _run_child(work: Path, wall_s: float, stop: threading.Event | None) -> int | None:
    """Run the child to its end and return its exit code (negative: a signal); None if it was stopped or ran out of time."""
    path = os.pathsep.join([str(ROOT), *(p for p in sys.path if p)])
    environment = os.environ | THREADS | {"PYTHONPATH": path, "TMPDIR": str(work), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-X", "utf8", "-m", "planner.sandbox_child", str(work)]
    with (work / "console.txt").open("wb") as console:
        child = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=console,
            stderr=subprocess.STDOUT,
            cwd=work,
            env=environment,
            start_new_session=True,
        )
    deadline = time.monotonic() + wall_s
    try:
        while (left := deadline - time.monotonic()) > 0.0 and not (stop is not None and stop.is_set()):
            with contextlib.suppress(subprocess.TimeoutExpired):
                return child.wait(timeout=left if stop is None else min(left, STOP_WITHIN_S))
        return None
    finally:
        if child.poll() is None:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()


def _console(work: Path) -> str:
    with (work / "console.txt").open("rb") as file:
        return file.read(CONSOLE_BYTES).decode("utf-8", errors="replace")


def _outcome(work: Path) -> dict[str, Any] | None:
    try:
        outcome = json.loads((work / "outcome.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return outcome if isinstance(outcome, dict) else None


def _too_slow(source: Path, limit: str) -> EchoBaseError:
    return fail(
        "reader-time", f"Reading the file took longer than {limit}.", "Simplify it, or export it coarser.", source.name
    )


def _too_big(source: Path, limits: SandboxLimits) -> EchoBaseError:
    return fail(
        "reader-memory",
        f"Reading the file needs more than {limits.memory_mb} MB of memory.",
        "Simplify it, or export it coarser.",
        source.name,
    )


def _death(source: Path, code: int, console: str, limits: SandboxLimits) -> EchoBaseError:
    """Return the error for a child that ended without a word: by a signal, or by a library that called exit."""
    if "bad_alloc" in console or "MemoryError" in console:
        return _too_big(source, limits)
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return _too_slow(source, f"{limits.cpu_s} s of processor time")
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    return fail(
        "reader-crash",
        f"The reader crashed on this file ({name}): the file is damaged, or too unusual for it.",
        "Export it again from the CAD or acquisition system, if possible in another format.",
        source.name,
    )
