"""Names are data: what people type is kept and shown, never used as a path. Identifiers are made here."""

import re
import secrets
import unicodedata
from datetime import UTC, datetime

from app.store.refusal import refuse

MAX_NAME = 200
_ID = re.compile(r"^[0-9a-f]{20}$")
# Controls, unassigned, surrogates, private use, and the format characters that reverse or hide text.
_FORBIDDEN = {"Cc", "Cs", "Co", "Cn", "Cf", "Zl", "Zp"}


def new_id() -> str:
    """Return a new identifier: 80 random bits as hexadecimal digits."""
    return secrets.token_hex(10)


def is_id(text: str) -> bool:
    """True if `text` has the form of an identifier made by `new_id`."""
    return _ID.fullmatch(text) is not None


def now() -> str:
    """Return the time as ISO 8601 in UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def clean_text(text: str, what: str, longest: int = MAX_NAME) -> str:
    """Return a one-line text of a person, normalised (NFC); raises Refusal 422 for an empty, too long or unprintable one."""
    cleaned = unicodedata.normalize("NFC", text).strip()
    if not cleaned:
        raise refuse(422, "text-empty", f"{what} is empty.", "Write at least one character.", what)
    if len(cleaned) > longest:
        raise refuse(422, "text-too-long", f"{what} is longer than {longest} characters.", "Shorten it.", what)
    if any(unicodedata.category(c) in _FORBIDDEN for c in cleaned):
        raise refuse(
            422, "text-unprintable", f"{what} has characters that cannot be shown.", "Use one line of plain text.", what
        )
    return cleaned


def shown_file_name(name: str) -> str:
    """Return the last part of an uploaded file's name with unprintable characters removed; never used as a path."""
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rsplit("/", 1)[-1]
    kept = "".join(c for c in last if unicodedata.category(c) not in _FORBIDDEN).strip()
    stem, dot, suffix = kept.rpartition(".")
    if dot and len(kept) > MAX_NAME:
        kept = f"{stem[: MAX_NAME - len(suffix) - 1]}.{suffix}"
    return kept[:MAX_NAME] or "file"


def safe_member(name: str) -> str:
    """Return a name as one harmless path component of ASCII letters, digits, dot, dash and underscore."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9._-]+", "_", plain).lstrip(".")[-100:] or "file"


_RELATIVE = re.compile(r"^(?:[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}/){0,4}[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}$")


def is_relative_name(name: str) -> bool:
    """True for a file name of a result, such as `alignment/EB_SCAN.src`: no dots at the start, no absolute paths."""
    return _RELATIVE.fullmatch(name) is not None
