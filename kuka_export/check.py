"""`echobase check`: what is wrong with KRL, ours or anybody's."""

from kuka_export.language.library import load
from planner.issues import Issue


def check_files(files: dict[str, bytes], controller: str | None = None) -> list[Issue]:
    """Return the findings for file name -> bytes, in order of file and line."""
    return [
        Issue("error", code, message, "Correct the line.", f"{source.name}:{line}")
        for source in load(files).files.values()
        for line, code, message in source.problems
    ]
