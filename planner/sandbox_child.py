"""The child's side of `planner.sandbox`. Run as `python -m planner.sandbox_child FOLDER`; imports little, on purpose."""

import ctypes
import importlib
import json
import resource
import signal
import sys
from pathlib import Path
from typing import Any

MB = 1 << 20
PR_SET_PDEATHSIG = 1


def main(folder: str) -> None:
    """Carry out the request in the folder and leave the outcome there."""
    work = Path(folder)
    request = json.loads((work / "request.json").read_text(encoding="utf-8"))
    _limit(request["limits"])
    try:
        outcome = _call(work, request)
    except MemoryError:
        outcome = {"memory": True}
    except Exception as error:
        issues = getattr(error, "issues", None)
        if issues:
            outcome = {"issues": [issue.to_json() for issue in issues]}
        elif isinstance(error, ImportError):
            raise
        else:
            outcome = {"failed": f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]}
    part = work / "outcome.part"
    part.write_text(json.dumps(outcome), encoding="utf-8")
    part.rename(work / "outcome.json")


def _limit(limits: dict[str, Any]) -> None:
    memory, size, cpu = int(limits["memory_mb"]) * MB, int(limits["file_mb"]) * MB, int(limits["cpu_s"])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _at_most(resource.RLIMIT_AS, memory, memory)
    _at_most(resource.RLIMIT_FSIZE, size, size)
    # The soft limit says SIGXCPU, which is told apart from a crash; the hard one follows for those that ignore it.
    _at_most(resource.RLIMIT_CPU, cpu, cpu + 5)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _at_most(kind: int, soft: int, hard: int) -> None:
    """Set a limit, or leave it where the one who started us set a tighter one."""
    _, given = resource.getrlimit(kind)
    if given != resource.RLIM_INFINITY:
        soft, hard = min(soft, given), min(hard, given)
    resource.setrlimit(kind, (soft, hard))


def _call(work: Path, request: dict[str, Any]) -> dict[str, Any]:
    module, _, name = request["target"].partition(":")
    function = getattr(importlib.import_module(module), name)
    arrays, meta = function(Path(request["source"]), request["options"])
    import numpy as np  # noqa: PLC0415  the reader has it already, a failing request does not need it

    for i, array in enumerate(arrays.values()):
        np.save(work / f"{i}.npy", np.ascontiguousarray(array), allow_pickle=False)
    return {"arrays": list(arrays), "meta": meta}


if __name__ == "__main__":
    main(sys.argv[1])
    # Libraries may crash while they tidy up; the outcome is already written.
    sys.stdout.flush()
    sys.stderr.flush()
