"""A part too big for the machine is told so before the machine swaps."""

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planner.cad import read_part
from planner.errors import EchoBaseError
from planner.memory import LIMIT, PLAN_BYTES, READ_BYTES, expect_memory, free_mb
from planner.setup import Setup
from planner.surface.choose import chosen_surface
from tests.path.shapes import drilled

MB = 1 << 20


def write_stl(path: Path, triangles: np.ndarray) -> Path:
    rows = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = triangles
    path.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())
    return path


def test_need_and_room_decide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT, "100000")
    room = free_mb()
    assert room is not None
    assert 0.0 < 100_000 - room < 8_000
    most = int(room * MB / PLAN_BYTES)
    expect_memory(int(0.99 * most), PLAN_BYTES, "Planning on", "part")
    with pytest.raises(EchoBaseError) as caught:
        expect_memory(int(1.05 * most), PLAN_BYTES, "Planning on", "part")
    (issue,) = caught.value.issues
    assert issue.code == "part-memory"
    assert f"{1.05 * most / 1e6:.2f} million triangles" in issue.message
    assert LIMIT in issue.remedy
    monkeypatch.setenv(LIMIT, "0")
    expect_memory(10**12, PLAN_BYTES, "Planning on", "part")
    monkeypatch.setenv(LIMIT, "much")
    with pytest.raises(EchoBaseError, match="not a number of MB"):
        expect_memory(1, PLAN_BYTES, "Planning on", "part")


@pytest.mark.parametrize(
    ("files", "left"),
    [
        ({"proc/meminfo": "MemTotal: 9000000 kB\nMemAvailable:    4096000 kB\n"}, 4000.0),
        (
            {
                "proc/meminfo": "MemAvailable: 4096000 kB\n",
                "proc/self/cgroup": "0::/jobs/one\n",
                "sys/fs/cgroup/jobs/one/memory.max": "max\n",
                "sys/fs/cgroup/jobs/one/memory.current": f"{50 * MB}\n",
                "sys/fs/cgroup/jobs/memory.max": f"{1000 * MB}\n",
                "sys/fs/cgroup/jobs/memory.current": f"{400 * MB}\n",
                "sys/fs/cgroup/jobs/memory.stat": f"anon 5\ninactive_file {100 * MB}\n",
            },
            700.0,
        ),
        (
            {
                "proc/meminfo": "MemAvailable: 4096000 kB\n",
                "proc/self/cgroup": "3:cpu:/x\n2:memory:/elsewhere\n",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": f"{512 * MB}\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{500 * MB}\n",
            },
            12.0,
        ),
        ({}, None),
    ],
)
def test_the_machine_and_its_control_groups_are_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: dict[str, str], left: float | None
) -> None:
    monkeypatch.delenv(LIMIT, raising=False)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY
    assert free_mb(tmp_path) == (None if left is None else pytest.approx(left))


def test_reading_and_planning_say_so_before_they_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    panel = drilled(300.0, 200.0, cell=2.0)
    file = write_stl(tmp_path / "plate.stl", panel.vertices[panel.faces])
    monkeypatch.delenv(LIMIT, raising=False)
    part = read_part(file, "plate.stl", "mm")
    used = next(float(x.split()[1]) / 1024 for x in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in x)
    monkeypatch.setenv(LIMIT, f"{used + 2.0:.3f}")
    with pytest.raises(EchoBaseError) as caught:
        read_part(file, "plate.stl", "mm")
    assert caught.value.issues[0].code == "part-memory"
    assert caught.value.issues[0].where == "plate.stl"
    with pytest.raises(EchoBaseError, match="Planning on a surface of"):
        chosen_surface(part, Setup())


def test_a_tighter_limit_of_address_space_is_kept_and_told(tmp_path: Path) -> None:
    """ulimit -v: the reader's own limit must not ask for more than it may, and what is left is what counts."""
    panel = drilled(300.0, 200.0, cell=1.0)
    file = write_stl(tmp_path / "plate.stl", panel.vertices[panel.faces])
    say = (
        "import app, sys; from pathlib import Path; from planner.cad import read_part; "
        "print(len(read_part(Path(sys.argv[1]), 'plate.stl', 'mm').faces))"
    )
    done = subprocess.run(
        [sys.executable, "-c", say, str(file)],
        capture_output=True,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (3000 * MB, 3000 * MB)),
        check=True,
    )
    assert int(done.stdout) > 100_000


PEAK = """
import sys
import app
from pathlib import Path
from planner.cad import read_part
from planner.path.keypoints import suggest
from planner.path.raster import raster
from planner.setup import Setup
from planner.surface.choose import chosen_surface
from planner.surface.curved import CurvedSurface, footprint_mm
import json
rows = lambda: Path("/proc/self/status").read_text().splitlines()
peak = lambda: next(int(row.split()[1]) * 1024 for row in rows() if row.startswith("VmHWM"))
setup, start = Setup(), peak()
part = read_part(Path(sys.argv[1]), "big.stl", "mm")
read = peak()
curved = CurvedSurface(chosen_surface(part, setup), footprint_mm(setup.probe))
suggest(curved, setup)
raster(curved, setup)
print(json.dumps([len(part.faces), read - start, peak() - start]))
"""


@pytest.mark.slow
def test_the_estimate_is_what_a_part_takes(tmp_path: Path) -> None:
    panel = drilled(900.0, 600.0, ((300.0, 300.0, 60.0),), radius=900.0, cell=1.5)
    file = write_stl(tmp_path / "big.stl", panel.vertices[panel.faces])
    done = subprocess.run(
        [sys.executable, "-c", PEAK, str(file)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", LIMIT: "0"},
    )
    triangles, read, whole = json.loads(done.stdout)
    assert triangles > 300_000
    assert read == pytest.approx(READ_BYTES * triangles, rel=0.25)
    assert whole == pytest.approx((400 + PLAN_BYTES) * triangles, rel=0.25)
