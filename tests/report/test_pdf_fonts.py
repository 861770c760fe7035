"""Characters that the PDF cannot draw are said, and drawn as soon as a font is given for them."""

import re

import pytest
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen

from app.report.document import Document, Text
from app.report.package import Report
from app.report.pdf_fonts import FOLDER, undrawable


def report(words: str) -> Report:
    return Report(Document(title="Report", subject=words, facts=(), version="1", blocks=(Text(text=words),)), {})


def fonts_in(pdf: bytes) -> set[bytes]:
    return set(re.findall(rb"/BaseFont/[A-Z]{6}\+([A-Za-z0-9-]+)", pdf))


@pytest.fixture
def square_font(tmp_path):
    """A folder with a font that has U+691C and a space, as squares."""
    pen = TTGlyphPen(None)
    for k, corner in enumerate(((0, 0), (0, 700), (700, 700), (700, 0))):
        (pen.lineTo if k else pen.moveTo)(corner)
    pen.closePath()
    glyph = pen.glyph()
    font = FontBuilder(1000, isTTF=True)
    font.setupGlyphOrder([".notdef", "space", "square"])
    font.setupCharacterMap({0x20: "space", 0x691C: "square"})
    font.setupGlyf({".notdef": glyph, "space": TTGlyphPen(None).glyph(), "square": glyph})
    font.setupHorizontalMetrics(dict.fromkeys((".notdef", "space", "square"), (800, 0)))
    font.setupHorizontalHeader(ascent=800, descent=-200)
    font.setupNameTable({"familyName": "Squares", "styleName": "Regular", "psName": "Squares-Regular"})
    font.setupOS2(sTypoAscender=800, sTypoDescender=-200)
    font.setupPost()
    font.save(tmp_path / "squares.ttf")
    return tmp_path


def test_which_characters_have_no_font():
    assert undrawable({"a": ["Иван Петров, Ελληνικά, Łódź, Größe, \N{GRINNING FACE}", 3, None]}) == []
    # Hebrew, Arabic and Devanagari are in the fonts as well; ideographs, kana, Hangul and most pictures are not.
    assert undrawable(["עברית العربية"]) == []
    assert undrawable(["検査 かな 한글 \N{WRENCH}"]) == sorted("検査かな한글\N{WRENCH}")


def test_the_pdf_says_what_it_cannot_draw():
    plain, lacking = report("Prüfer Иван").pdf(), report("検査").pdf()
    assert not any(b"LastResort" in name for name in fonts_in(plain))
    assert any(b"LastResort" in name for name in fonts_in(lacking))
    # One sentence more; the HTML shows the characters themselves and does not say it.
    assert len(lacking) > len(plain)
    html = report("検査").html().decode()
    assert "検査" in html
    assert "boxes stand" not in html


def test_a_folder_of_fonts_draws_them(square_font, monkeypatch):
    monkeypatch.setenv(FOLDER, str(square_font))
    assert undrawable("検査") == ["査"]
    made = report("検").pdf()
    assert any(name.startswith(b"Squares") for name in fonts_in(made))
    assert not any(b"LastResort" in name for name in fonts_in(made))
    assert made == report("検").pdf()
