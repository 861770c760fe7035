"""The fonts of the PDF, and which characters none of them can draw."""

import json
import os
import unicodedata
from functools import cache
from pathlib import Path
from typing import Any

FOLDER = "ECHOBASE_FONTS"
"""Environment variable: a folder with more fonts, for scripts that those at hand do not have."""
TEXT = ("DejaVu Sans", "Libertinus Serif")
# Has every character there is, as a box.
_LAST_RESORT = "Last Resort High-Efficiency"
_SUFFIXES = (".ttf", ".otf")


def fonts() -> tuple[Path, ...]:
    """Return the folders of fonts, beside those inside typst; nothing of the system."""
    more = os.environ.get(FOLDER)
    return (_data(), *([Path(more)] if more else []))


def families() -> list[str]:
    """Return the families of text, in the order in which they are asked for a character."""
    own = _families((_data(),))
    return [*TEXT, *(name for name in _families(fonts()) if name not in own)]


def undrawable(content: Any) -> list[str]:
    """Return the characters in strings of JSON that would be boxes, sorted."""
    used = _characters(content)
    if used <= _text():
        return []
    folders = fonts()
    return [c for c in sorted(used - _text() - _in_files(folders)) if _is_box(c, folders)]


def _characters(content: Any) -> set[str]:
    if isinstance(content, str):
        return {c for c in content if c.isprintable()}
    values = content.values() if isinstance(content, dict) else content if isinstance(content, list | tuple) else ()
    return set().union(*map(_characters, values))


@cache
def _text() -> frozenset[str]:
    return _in_file(_data() / "DejaVuSans.ttf")


@cache
def _in_files(folders: tuple[Path, ...]) -> frozenset[str]:
    """Return what the files have, but for the font of boxes."""
    files = (file for folder in folders for file in sorted(folder.rglob("*")) if file.suffix.lower() in _SUFFIXES)
    return frozenset().union(*(_in_file(file) for file in files if not file.name.startswith("LastResort")))


def _in_file(file: Path) -> frozenset[str]:
    from matplotlib.ft2font import FT2Font  # noqa: PLC0415 - only a PDF needs it

    try:
        return frozenset(map(chr, FT2Font(str(file)).get_charmap()))
    except (RuntimeError, OSError):
        # Not a font that could be used: typst passes over it too.
        return frozenset()


@cache
def _is_box(character: str, folders: tuple[Path, ...]) -> bool:
    """Ask whether typst finds a character in none of its families: behind them all stands the font of boxes."""
    if unicodedata.east_asian_width(character) in "WF" and unicodedata.category(character) in ("Lo", "Po", "Ps", "Pe"):
        # Ideographs, kana and Hangul by the thousand: the fonts inside typst have none of them.
        return True
    import typst  # noqa: PLC0415 - 30 MB that only a report needs

    real = (name for name in _families(folders) if name != _LAST_RESORT)
    names = ", ".join(json.dumps(name, ensure_ascii=False) for name in (*real, _LAST_RESORT))
    source = f'#set text(font: ({names}))\n#text("\\u{{{ord(character):x}}}")'
    compile_files: Any = typst.compile
    made = compile_files({"main.typ": source.encode()}, font_paths=list(folders), ignore_system_fonts=True, timestamp=0)
    return b"LastResort" in bytes(made)


@cache
def _families(folders: tuple[Path, ...]) -> tuple[str, ...]:
    import typst  # noqa: PLC0415 - as above

    return tuple(typst.Fonts(include_system_fonts=False, font_paths=list(folders)).families())


@cache
def _data() -> Path:
    import matplotlib as mpl  # noqa: PLC0415 - as above

    return Path(mpl.get_data_path()) / "fonts" / "ttf"
