"""KRL lines to tokens. Case does not matter; a comment runs from `;` to the end of the line."""

import re
from dataclasses import dataclass

from kuka_export.language.vocabulary import KEYWORDS


@dataclass(frozen=True)
class Token:
    """kind: name, number, text, bits, enum, op, end. `value` upper case for names and enums."""

    kind: str
    value: str
    column: int


class KrlSyntaxError(Exception):
    """One line that is not KRL: a rule code and a sentence."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


_TOKEN = re.compile(
    r"""(?P<space>[ \t]+)
      | (?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?(?![A-Za-z0-9_$]))
      | (?P<name>[A-Za-z_$][A-Za-z0-9_$]*)
      | (?P<enum>\#\s*[A-Za-z_][A-Za-z0-9_$]*)
      | (?P<text>"[^"]*")
      | (?P<bits>'[BHDbhd]?[0-9A-Fa-f]+')
      | (?P<op>==|<>|<=|>=|:=|[{}()\[\],:.=<>+\-*/?!\#&])
      | (?P<comment>;.*)
    """,
    re.VERBOSE,
)


def tokens(line: str) -> list[Token]:
    """Return the tokens of one line without its comment, closed by an `end` token; raises KrlSyntaxError."""
    found: list[Token] = []
    at = 0
    while at < len(line):
        match = _TOKEN.match(line, at)
        if match is None:
            raise _illegal(line, at)
        kind = match.lastgroup or ""
        if kind == "comment":
            break
        if kind != "space":
            value = match.group()
            found.append(
                Token(kind, re.sub(r"\s", "", value).upper() if kind in ("name", "enum", "bits") else value, at + 1)
            )
        at = match.end()
    found.append(Token("end", "", len(line) + 1))
    return found


def _illegal(line: str, at: int) -> KrlSyntaxError:
    piece = line[at : at + 12].split(maxsplit=1)[0] if line[at : at + 12].split() else line[at]
    if line[at].isdigit():
        return KrlSyntaxError("krl-number", f"'{piece}' is neither a number nor a name (column {at + 1}).")
    if line[at] in "\"'":
        return KrlSyntaxError("krl-string", f"The text that starts in column {at + 1} is not closed.")
    return KrlSyntaxError("krl-character", f"The character {line[at]!a} in column {at + 1} means nothing in KRL.")


def is_keyword(token: Token, *words: str) -> bool:
    """True if the token is one of these words (any keyword if none are given)."""
    return token.kind == "name" and (token.value in words if words else token.value in KEYWORDS)
