"""What a part takes of memory, against what the machine can give: a sentence before it swaps, never a killed process.

Measured (peak resident size, double-curved panels of 0.5, 1 and 3.5 million triangles, whole plans): 0.6 kB a triangle to
read a part, of which 0.4 kB stay, and 1.25 kB more a triangle of the inspection surface to plan on it.
"""

import os
import resource
from pathlib import Path

from planner.errors import fail

LIMIT = "ECHOBASE_MEMORY_MB"
"""Environment variable: what one process may take (MB), whatever the machine says; 0 asks nothing at all."""
READ_BYTES = 620
"""Peak of reading, a triangle of the part."""
PLAN_BYTES = 1250
"""What planning takes beside the part, a triangle of the inspection surface."""
_MB = 1 << 20


def expect_memory(triangles: int, bytes_each: int, doing: str, where: str) -> None:
    """Raise EchoBaseError `part-memory` where a step on so many triangles needs more memory than is free now.

    doing: the step, as a sentence begins with it.
    """
    free, need = free_mb(), triangles * bytes_each / _MB
    if free is None or need <= free:
        return
    raise fail(
        "part-memory",
        f"{doing} {triangles / 1e6:.2f} million triangles needs about {_gb(need)} of memory; {_gb(max(free, 0.0))} "
        f"{'are left of ' + LIMIT if _limit_mb() is not None else 'are free'}.",
        "Export the CAD coarser (0.01 mm of chord error is plenty), inspect a smaller surface, free memory, or raise the "
        f"limit: {LIMIT} in MB overrules what the machine says, 0 asks nothing.",
        where,
    )


def free_mb(root: Path = Path("/")) -> float | None:
    """Return the memory (MB) that this process can still take without swapping; None where nobody knows or asks.

    The least of: what `ECHOBASE_MEMORY_MB` leaves, else what the machine has available and what the control groups of this
    process (version 2 or 1) leave; and what its own limit of address space leaves. root: of the file system, for tests.
    """
    limit = _limit_mb()
    if limit == 0.0:
        return None
    if limit is not None:
        used = _field_mb(root / "proc/self/status", "VmRSS")
        return limit - (0.0 if used is None else used)
    known = [
        m
        for m in (_field_mb(root / "proc/meminfo", "MemAvailable"), *_groups_mb(root), _space_mb(root))
        if m is not None
    ]
    return min(known) if known else None


def _limit_mb() -> float | None:
    text = os.environ.get(LIMIT, "").strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise fail("memory-limit", f"{LIMIT} is '{text}', not a number of MB.", "Give MB, or 0 for no limit.", LIMIT)
    return value


def _field_mb(file: Path, name: str) -> float | None:
    """Return a field of a file of /proc that counts kB, in MB."""
    try:
        lines = file.read_text(encoding="ascii", errors="replace").splitlines()
        return next(float(line.split()[1]) / 1024.0 for line in lines if line.startswith(f"{name}:"))
    except (OSError, StopIteration, ValueError, IndexError):
        return None


def _groups_mb(root: Path) -> list[float]:
    """Return what each control group that this process is in, or its parents, leaves (MB)."""
    try:
        own = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    out: list[float] = []
    for line in own:
        _, controllers, path = line.split(":", 2) if line.count(":") >= 2 else ("", "-", "")
        if controllers == "":
            base, most, used = root / "sys/fs/cgroup", "memory.max", "memory.current"
        elif "memory" in controllers.split(","):
            base, most, used = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
        else:
            continue
        # Inside a container the path may be that outside of it; the root of what is mounted counts then.
        folder = base / path.strip("/")
        for at in (folder, *folder.parents):
            left = _left_mb(at, most, used)
            out += [left] if left is not None else []
            if at == base:
                break
    return out


def _left_mb(folder: Path, most: str, used: str) -> float | None:
    try:
        limit = float((folder / most).read_text(encoding="ascii"))
        taken = float((folder / used).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None
    cache = 0.0
    try:
        lines = (folder / "memory.stat").read_text(encoding="ascii").splitlines()
        # What the kernel gives back before it kills.
        cache = sum(float(v) for k, v in (x.split() for x in lines) if k in ("inactive_file", "total_inactive_file"))
    except (OSError, ValueError):
        pass
    return (limit - taken + cache) / _MB


def _space_mb(root: Path) -> float | None:
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    size = _field_mb(root / "proc/self/status", "VmSize")
    return None if soft == resource.RLIM_INFINITY or size is None else soft / _MB - size


def _gb(mb: float) -> str:
    return f"{mb / 1024.0:.1f} GB"
