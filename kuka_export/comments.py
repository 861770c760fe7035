"""User text on its way into a program: it becomes a comment, and nothing else."""

import re
import unicodedata

MAX_COMMENT = 120
_SPELLED = str.maketrans(
    {
        "ß": "ss", "æ": "ae", "Æ": "AE", "œ": "oe", "Œ": "OE", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "đ": "d", "Đ": "D",
        "þ": "th", "Þ": "Th", "ð": "d", "°": " deg", "µ": "u", "μ": "u", "±": "+-", "×": "x", "–": "-", "—": "-", "−": "-",
        "‘": "'", "’": "'", "“": '"', "”": '"', "…": "...", "ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue",
    }
)  # fmt: skip


def comment_text(text: str, limit: int = MAX_COMMENT) -> str:
    """Return `text` as one line of printable ASCII, at most `limit` characters, that cannot be anything but a comment.

    Transliterated; controls and line breaks become spaces; `;` and `&`, which start folds, comments and headers, become
    `,` and `+`; `%` (fold metadata) becomes `pct`. What cannot be spelled becomes `?`.
    """
    spelled = unicodedata.normalize("NFC", text).translate(_SPELLED)
    folded = unicodedata.normalize("NFKD", spelled)
    kept = "".join(c for c in folded if not unicodedata.combining(c))
    plain = "".join(
        c if " " <= c <= "~" else (" " if c.isspace() or unicodedata.category(c)[0] == "C" else "?") for c in kept
    )
    plain = plain.replace(";", ",").replace("&", "+").replace("%", " pct")
    one = re.sub(r"\s+", " ", plain).strip()
    # `;FOLD` and `;ENDFOLD` are the only words that mean something behind a semicolon.
    one = re.sub(r"(?i)\b(end)?fold", lambda m: m.group(0)[0] + "-" + m.group(0)[1:], one)
    return one if len(one) <= limit else one[: limit - 3].rstrip() + "..."
