"""Runs every benchmark in turn: `python -m benchmarks [name ...]`."""

import sys
from runpy import run_module

NAMES = {"loading": "benchmarks.loading", "planning": "benchmarks.planning", "alignment": "benchmarks.alignment.speed"}


def main() -> int:
    chosen = sys.argv[1:] or list(NAMES)
    unknown = [name for name in chosen if name not in NAMES]
    if unknown:
        print(f"no benchmark '{unknown[0]}'; one of {', '.join(NAMES)}", file=sys.stderr)
        return 2
    for name in chosen:
        print(f"\n# {name}", flush=True)
        sys.argv = [NAMES[name]]
        run_module(NAMES[name], run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main())
