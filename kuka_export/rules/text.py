"""Rules of the bytes: character set, line ends, headers, folds."""

import re
from collections.abc import Iterator

from kuka_export.language.nodes import Note, SourceFile
from kuka_export.rules.finding import Finding

_HEADER = re.compile(r"&(ACCESS\s+\S+|REL\s+\d+|COMMENT\b.*|PARAM\s+\w+\s*=.*|USER\b.*|HEAD\b.*)$", re.IGNORECASE)
LONG_LINE = 600
"""The longest line seen on a real controller has 593 characters."""


def check_bytes(data: bytes) -> Iterator[Finding]:
    """Yield what is wrong with the bytes of one file."""
    if data.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")):
        yield Finding(1, "krl-bom", "The file starts with a byte order mark")
    lines = data.split(b"\n")
    strange = re.compile(rb"[^\x09\x0d\x20-\x7e]")
    for number, line in enumerate(lines, 1):
        match = strange.search(line)
        if match is not None and not (number == 1 and match.start() < 3 and data[:1] > b"\x7f"):
            yield Finding(
                number, "krl-ascii", f"Byte 0x{match.group()[0]:02X} in column {match.start() + 1} is not plain ASCII"
            )
        if len(line) > LONG_LINE:
            yield Finding(number, "krl-long-line", f"The line has {len(line)} characters", "warning")
        if b"\r" in line[:-1]:
            yield Finding(number, "krl-line-ends", "A carriage return stands inside the line", "warning")
    crlf, lf = data.count(b"\r\n"), data.count(b"\n")
    if lf and crlf < lf:
        bare = next(i for i, line in enumerate(lines, 1) if not line.endswith(b"\r"))
        yield Finding(bare, "krl-line-ends", f"{lf - crlf} of {lf} lines end without CR", "warning")
    if data and not data.endswith(b"\n"):
        yield Finding(len(lines), "krl-final-newline", "The last line does not end", "warning")


def check_headers(source: SourceFile) -> Iterator[Finding]:
    """Yield header lines the controller would not know."""
    for line, text in source.headers:
        if not _HEADER.match(text):
            yield Finding(line, "krl-header", f"'{text[:40]}' is no header of a KRL file", "warning")


def check_folds(source: SourceFile) -> Iterator[Finding]:
    """Yield folds that are not closed, or closed twice."""
    open_lines: list[int] = []
    for routine in source.routines:
        for s in routine.body:
            if not isinstance(s, Note):
                continue
            word = s.text.strip().upper()
            if re.match(r"FOLD\b", word):
                open_lines.append(s.line)
            elif re.match(r"ENDFOLD\b", word):
                if open_lines:
                    open_lines.pop()
                else:
                    yield Finding(s.line, "krl-fold", ";ENDFOLD closes no fold")
    for line in open_lines:
        yield Finding(line, "krl-fold", "The fold is not closed")
