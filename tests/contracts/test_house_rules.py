"""House rules that a machine can keep: import direction, file sizes, no machine paths."""

import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("planner", "alignment", "kuka_export", "app")


def sources() -> list[Path]:
    return [p for package in PACKAGES for p in (ROOT / package).rglob("*.py")] + list((ROOT / "static").rglob("*.js"))


def test_imports_go_one_way():
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_files_are_short():
    lengths = {str(p.relative_to(ROOT)): len(p.read_text(encoding="utf-8").splitlines()) for p in sources()}
    too_long = {name: n for name, n in lengths.items() if n > 400}
    assert too_long == {}
    assert median(n for n in lengths.values() if n > 3) <= 150


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_says_what_it_is_for(package):
    silent = [
        str(p.relative_to(ROOT))
        for p in (ROOT / package).rglob("*.py")
        if p.stat().st_size and not p.read_text(encoding="utf-8").lstrip().startswith('"""')
    ]
    assert silent == []


def test_help_answers_in_half_a_second():
    # The interpreter's own start is part of what a person waits for.
    code = "import sys, time; t = time.perf_counter(); from app.__main__ import main\n"
    code += "try:\n    main(['--help'])\nexcept SystemExit: pass\nsys.stderr.write(str(time.perf_counter() - t))"
    runs = [
        float(subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stderr)
        for _ in range(3)
    ]
    assert min(runs) < 0.5
