"""`read_scan`: files in, one `Scan` or one cloud of `SurfacePoints` out."""

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from alignment.readers.formats import parser_of
from alignment.readers.merge import merge_by_time
from alignment.scan import Scan, SurfacePoints
from planner.errors import fail
from planner.frames import Transform
from planner.issues import Issue
from planner.sandbox import SandboxLimits, run_limited


def read_scan(
    sources: Sequence[Path], names: Sequence[str] | None = None, limits: SandboxLimits | None = None
) -> Scan | SurfacePoints:
    """Return the scan in one file, or in a pair of files (poses and echoes, merged by time).

    sources: where the bytes are. names: what people call them (default: the file names); the format is told from the
    suffix of the name, then from the first bytes. Each file is parsed in a child process under `limits`.
    """
    labels = [path.name for path in sources] if names is None else list(names)
    if len(labels) != len(sources):
        raise ValueError(f"{len(sources)} files but {len(labels)} names")
    if not 1 <= len(sources) <= 2:
        raise fail("scan-files", f"{len(sources)} files given.", "A scan is one file, or a pair: poses and readings.")
    with ThreadPoolExecutor(1) as aside:
        digest = aside.submit(_sha256, sources)
        parsed = [_parse(path, label, limits) for path, label in zip(sources, labels, strict=True)]
    name, sha256 = " + ".join(labels), digest.result()
    if len(parsed) == 2:
        return _scan(*_paired(parsed, name), name, sha256)
    payload = parsed[0]
    if payload["kind"] == "points":
        return SurfacePoints(
            payload["points"],
            payload["amplitude_pct"],
            payload["tof_us"],
            _base(payload),
            name,
            sha256,
            _issues(payload),
            payload.get("simulated", False),
        )
    if payload["kind"] != "readings":
        other = (
            "the readings (t_s, law, tof_us, amplitude_pct)"
            if payload["kind"] == "poses"
            else "the poses (t_s, x_mm .. c_deg)"
        )
        raise fail(
            "scan-half", f"this file holds only {payload['kind']}.", f"Give {other} of the same scan beside it.", name
        )
    return _scan(payload, Transform.from_xyzabc("scan", "tcp", payload["poses"]), name, sha256)


def _parse(path: Path, label: str, limits: SandboxLimits | None) -> dict[str, Any]:
    options = {"parser": parser_of(path, label), "name": label}
    arrays, meta = run_limited("alignment.readers.sandboxed:parse", path, options, limits)
    return meta | arrays


def _paired(parsed: list[dict[str, Any]], name: str) -> tuple[dict[str, Any], Transform]:
    kinds = {payload["kind"]: payload for payload in parsed}
    if set(kinds) != {"poses", "echoes"}:
        found = " and ".join(payload["kind"] for payload in parsed)
        raise fail(
            "scan-pair",
            f"two files make one scan only as poses and echoes; these hold {found}.",
            "Give t_s + pose in one file and t_s, law, tof_us, amplitude_pct in the other; load whole scans one by one.",
            name,
        )
    return merge_by_time(kinds["poses"], kinds["echoes"], name)


def _scan(payload: dict[str, Any], Ts_scan_tcp: Transform, name: str, sha256: str) -> Scan:
    return Scan(
        Ts_scan_tcp=Ts_scan_tcp,
        pose_index=payload["pose_index"],
        law=payload["law"],
        tof_us=payload["tof_us"],
        amplitude_pct=payload["amplitude_pct"],
        T_world_scan=_base(payload),
        t_s=payload["t_s"],
        pass_id=payload["pass_id"],
        name=name,
        sha256=sha256,
        issues=_issues(payload),
        simulated=payload.get("simulated", False),
    )


def _base(payload: dict[str, Any]) -> Transform | None:
    return None if payload["base"] is None else Transform.from_xyzabc("world", "scan", payload["base"])


def _issues(payload: dict[str, Any]) -> tuple[Issue, ...]:
    return tuple(Issue(**issue) for issue in payload["issues"])


def _sha256(sources: Sequence[Path]) -> str:
    """SHA-256 of the file; of a pair: of both digests, in the order given."""
    digests = []
    for path in sources:
        with path.open("rb") as stream:
            digests.append(hashlib.file_digest(stream, "sha256").hexdigest())
    return digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()
