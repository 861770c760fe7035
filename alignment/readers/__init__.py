"""Scan files in: one module per format, each parsed in the sandbox. See docs/scan-formats.md."""

from alignment.readers.read import read_scan

__all__ = ["read_scan"]
