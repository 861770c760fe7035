"""`echobase`, also `python -m app`."""

import sys


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return 0 (done), 1 (the work failed: issues say why) or 2 (usage)."""
    from app.cli.parser import parse  # noqa: PLC0415 - `--help` must answer in half a second: import what is asked for
    from app.cli.run import run  # noqa: PLC0415

    return run(parse(argv))


if __name__ == "__main__":
    sys.exit(main())
