"""Runs a parsed command: output as text or JSON, failures as sentences, never a traceback."""

import argparse
import json
import os
import sys
import traceback
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from planner.errors import EchoBaseError
from planner.issues import Issue

DONE, FAILED, USAGE = 0, 1, 2


def run(args: argparse.Namespace) -> int:  # noqa: PLR0911 - one return per kind of ending
    """Run the command; return the exit status."""
    if args.version:
        print(version("echobase"))
        return DONE
    if args.command is None:
        print("echobase: a command is needed; see 'echobase --help'", file=sys.stderr)
        return USAGE
    command = import_module(f"app.cli.commands.{args.command}")
    try:
        result, status = command.run(args)
    except EchoBaseError as error:
        return _failed(args, list(error.issues))
    except KeyboardInterrupt:
        print("echobase: interrupted", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # The reader of our output (head, less) left; the rest has nobody to go to.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        where = str(error.filename or "")
        text = f"the file system refused: {error.strerror or error}."
        return _failed(args, [Issue("error", "os-error", text, "Check path, permissions and free space.", where)])
    except Exception:  # noqa: BLE001 - the last line of defence: a person gets a sentence, the developers a file
        return _failed(args, [_internal_fault()])
    if args.json and result is not None:
        print(json.dumps(result, indent=2, allow_nan=False))
    return status


def say(args: argparse.Namespace, text: str = "") -> None:
    """Print a line of the text output; silent under --json."""
    if not args.json:
        print(text)


def say_issues(args: argparse.Namespace, issues: list[Issue]) -> None:
    """Print issues, one a line, errors first."""
    order = {"error": 0, "warning": 1, "info": 2}
    for issue in sorted(issues, key=lambda i: order[i.severity]):
        say(args, f"{issue.severity}: {issue.sentence()}")


def progress_printer(args: argparse.Namespace) -> Any:
    """Return a `progress(fraction, text)` that writes to a terminal's standard error, or nothing when there is none."""
    if args.json or not sys.stderr.isatty():
        return lambda fraction, text: None

    def show(fraction: float, text: str) -> None:
        end = "\n" if fraction >= 1.0 else ""
        print(f"\r\033[K{fraction:4.0%} {text}", end=end, file=sys.stderr, flush=True)

    return show


def _failed(args: argparse.Namespace, issues: list[Issue]) -> int:
    if args.json:
        print(json.dumps({"ok": False, "issues": [i.to_json() for i in issues]}, indent=2))
    else:
        for issue in issues:
            print(f"{issue.severity}: {issue.sentence()}", file=sys.stderr)
    return FAILED


def _internal_fault() -> Issue:
    """Write the traceback to a file for the developers and return the sentence for the person."""
    log = Path.cwd() / "echobase-fault.log"
    try:
        log.write_text(traceback.format_exc(), encoding="utf-8")
        kept = f"Please report it with the file {log.name}."
    except OSError:
        kept = "Please report it with the command you ran."
    return Issue("error", "internal", "EchoBase has a fault of its own; nothing was written that could be used.", kept)
