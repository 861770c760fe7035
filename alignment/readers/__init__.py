"""Scan files in: one module per format, each parsed in the sandbox. See docs/scan-formats.md.

`read_scan` is imported on first use: the child process that parses a file needs the parsers only, and starts faster.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from alignment.readers.read import read_scan

__all__ = ["read_scan"]


def __getattr__(name: str) -> Any:
    if name == "read_scan":
        from alignment.readers.read import read_scan  # noqa: PLC0415

        return read_scan
    raise AttributeError(name)
