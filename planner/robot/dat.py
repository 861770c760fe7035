"""Values in KUKA data lists (`$machine.dat`, `$config.dat`): a tolerant reader of `NAME[index] = value` lines."""

import re
from collections.abc import Iterator, Mapping

from planner.errors import fail

Fields = Mapping[str, float]
Value = float | str | Fields
MAX_BYTES = 16_000_000

# [DECL] [GLOBAL] [CONST] [type] NAME [ [index] ] = value
_LINE = re.compile(
    r"^\s*(?:(?:DECL|GLOBAL|CONST)\s+)*(?:[A-Z_]\w*\s+)?(?P<name>\$?[A-Z_]\w*)\s*(?:\[\s*(?P<index>\d*)\s*,?\s*\])?"
    r"\s*=\s*(?P<value>.+?)\s*$",
    re.IGNORECASE,
)
_NUMBER = re.compile(r"^[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?$", re.IGNORECASE)
_FIELD = re.compile(r"(?P<name>[A-Z_]\w*)\s+(?P<value>[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?)", re.IGNORECASE)


def read_values(name: str, data: bytes) -> dict[tuple[str, int], Value]:
    """Return (NAME in capitals, index or 0) -> number, text (quotes and # removed) or the numeric fields of an aggregate.

    Lines that are no assignment are skipped; of repeated ones the last counts, as on the controller. Raises EchoBaseError
    `backup-file` for a file that is too large or is not text.
    """
    if len(data) > MAX_BYTES:
        raise fail(
            "backup-file", "The file is larger than any data list.", "Upload $machine.dat and $config.dat.", name
        )
    if b"\x00" in data:
        raise fail("backup-file", "The file is not a text file.", "Upload the files of an unpacked backup.", name)
    return dict(_assignments(data.decode("latin-1")))


def _assignments(text: str) -> Iterator[tuple[tuple[str, int], Value]]:
    for line in text.splitlines():
        match = _LINE.match(_without_comment(line))
        if match is None:
            continue
        value = _value(match["value"])
        if value is not None:
            yield (match["name"].upper(), int(match["index"] or 0)), value


def _without_comment(line: str) -> str:
    """Cut a comment off; a semicolon inside quotes is none."""
    quoted = False
    for i, char in enumerate(line):
        if char == '"':
            quoted = not quoted
        elif char == ";" and not quoted:
            return line[:i]
    return line


def _value(text: str) -> Value | None:
    if _NUMBER.match(text):
        return float(text)
    if text.startswith("{") and text.endswith("}"):
        return {m["name"].upper(): float(m["value"]) for m in _FIELD.finditer(text)}
    if text.startswith('"') and text.endswith('"') and len(text) >= 2:
        return text[1:-1].strip()
    if text.startswith("#"):
        return text[1:].strip().upper()
    return None
