"""Names that a KUKA controller accepts: legal, unique, at most 24 characters, no keyword."""

import hashlib
import re
import unicodedata
from collections.abc import Iterable

from kuka_export.language.vocabulary import KEYWORDS, PREDEFINED

MAX_NAME = 24
MAX_STEM = 16
"""What a person may choose: suffixes such as `_C_BASE` or `_001` are added, and old tools cut at 16."""
MAX_CHOSEN = 13
"""What a person may choose for the programs of a plan: their endings, `_AL` and `_IN`, are added."""
MARK = 4
# No vowels: a mark never spells a word. Nor anything that looks like something else.
_MARKS = "23456789BCDFGHJKMNPQRSTVWXZ"
_LEGAL = re.compile(r"[A-Z][A-Z0-9_]*\Z")


def name_problem(name: str, limit: int = MAX_NAME) -> str:
    """Return why `name` is not a legal module name ('' if it is): upper-case letters, digits, `_`, not a keyword."""
    if not name:
        return "is empty"
    if len(name) > limit:
        return f"is {len(name)} characters long, {limit} are allowed"
    if not _LEGAL.match(name):
        return "may hold A-Z, 0-9 and _ only and must start with a letter"
    if name in KEYWORDS or name in PREDEFINED:
        return "is a word of the language"
    return ""


def legal_name(text: str, prefix: str = "EB_", limit: int = MAX_STEM) -> str:
    """Return the legal module name nearest to any text: transliterated, upper case, cut to `limit`."""
    ascii_text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    body = re.sub(r"[^A-Z0-9]+", "_", ascii_text.upper()).strip("_") or "PROGRAM"
    name = body if body.startswith(prefix) else prefix + body
    name = name[:limit].rstrip("_")
    return name if not name_problem(name, limit) else f"EB_{name}"[:limit].rstrip("_")


def program_stem(part_name: str, ending: str, key: str, chosen: str | None = None) -> str:
    """Return the stem of a program, at most 16 characters: `EB_`, the part's name, a mark of what is inspected, `_ending`.

    part_name: of the CAD file, of which the first letters and digits are used. key: whatever tells one plan of a part, or one
    part, from another; four characters are made of it, so that their programs do not replace each other on the controller.
    chosen: a name to use instead of all this, before the ending; legal, of `MAX_CHOSEN` characters at most.
    """
    if chosen is not None:
        return f"{chosen}_{ending}"
    ascii_text = unicodedata.normalize("NFKD", part_name).encode("ascii", "ignore").decode("ascii")
    short = re.sub(r"[^A-Z0-9]", "", ascii_text.upper())[: MAX_CHOSEN - len("EB__") - MARK] or "PART"
    number = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big")
    mark = "".join(_MARKS[number // len(_MARKS) ** k % len(_MARKS)] for k in range(MARK))
    return f"EB_{short}_{mark}_{ending}"


def duplicates(names: Iterable[str]) -> list[str]:
    """Return the names that occur more than once; the controller does not tell upper from lower case."""
    seen: set[str] = set()
    twice: list[str] = []
    for name in names:
        key = name.upper()
        if key in seen and key not in twice:
            twice.append(key)
        seen.add(key)
    return twice
