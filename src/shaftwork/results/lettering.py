"""Letters in pictures: fonts that have those of a name, or what stands in their place."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL = "DejaVu Sans"
"""The font that matplotlib brings along."""
NO_LETTERS = "Last Resort"
"""Begins the names of fonts that have a box in place of every letter."""


def lettered(figure: Figure) -> None:
    """Give the texts of a figure fonts that have all their letters, where any are installed."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if fonts := _fonts_of("".join(sorted({*text.get_text()})))[0]:
            text.set_fontfamily([USUAL, *fonts])


def replaced(text: str) -> str:
    """A text in which letters that no installed font has are their numbers, as "U+6A5F"."""
    missing = _fonts_of("".join(sorted({*text})))[1]
    return "".join(f"U+{ord(letter):04X}" if letter in missing else letter for letter in text)


@lru_cache(maxsize=256)
def _fonts_of(letters: str) -> tuple[tuple[str, ...], str]:
    """Fonts that have the letters which the usual one lacks, and the letters that none has."""
    from matplotlib.font_manager import findfont, fontManager

    missing = _lacking(findfont(USUAL), letters.replace("\n", ""))
    fonts: list[str] = []
    plain = (font for font in fontManager.ttflist if font.style == "normal" and font.weight in (400, "normal"))
    for font in sorted(plain, key=lambda font: font.name):
        if not missing:
            break
        if font.name.startswith(NO_LETTERS) or len(left := _lacking(font.fname, missing)) == len(missing):
            continue
        fonts.append(font.name)
        missing = left
    return tuple(fonts), missing


def _lacking(path: str, letters: str) -> str:
    """The letters that a font does not have."""
    from matplotlib.ft2font import FT2Font

    there = FT2Font(path).get_charmap()
    return "".join(letter for letter in letters if ord(letter) not in there)
