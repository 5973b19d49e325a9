"""Texts as letters with a place for each: measured once, so that boxes, SVG and figures agree."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache

from shaftwork.core.errors import MissingExtraError
from shaftwork.drawing.strokes import Stroke, Text, rectangle

FORMULA = re.compile(r"(?<!\\)\$")
"""What begins and ends a formula."""
FAMILY = "DejaVu Sans"
"""The font, which comes with matplotlib."""
SIZE = 10.0
"""The size at which texts are measured, pt."""


@dataclass(frozen=True)
class Run:
    """Letters in a line.

    Args:
        words: the letters.
        x, y: where they begin, from the left of the text and its base line, pt.
        size: of the letters, pt.
        width: of plain words, pt; 0 for a single sign.
        family: of the font.
        slanted: whether they are oblique.
    """

    words: str
    x: float = 0.0
    y: float = 0.0
    size: float = SIZE
    width: float = 0.0
    family: str = FAMILY
    slanted: bool = False


@dataclass(frozen=True)
class Setting:
    """A text that is set.

    Args:
        width: of the text, pt.
        runs: its letters.
        bars: of fractions and overlines.
    """

    width: float
    runs: tuple[Run, ...]
    bars: tuple[Stroke, ...] = ()


DIGITS = tuple("0123456789")


@lru_cache(maxsize=16384)
def _formula(words: str) -> Setting:
    """A formula. All digits are equally wide, so formulas that differ in digits alone are set once."""
    digits = re.findall("[0-9]", words)
    if len(digits) > 9:
        return _set_by_matplotlib(words)
    places = iter("123456789")
    pattern = _set_by_matplotlib(re.sub("[0-9]", lambda _: next(places), words))
    runs = (replace(run, words=digits[int(run.words) - 1]) if run.words in DIGITS else run for run in pattern.runs)
    return replace(pattern, runs=tuple(runs))


@lru_cache(maxsize=4096)
def _set_by_matplotlib(words: str) -> Setting:
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    scale = 100.0  # so much larger they are set, as matplotlib rounds their heights to whole points
    font = FontProperties(family=FAMILY, size=scale * SIZE, math_fontfamily="dejavusans")
    width, _, _, glyphs, bars = MathTextParser("path").parse(f"${words}$", 72, font)
    runs = []
    for face, size, sign, *_, x, y in glyphs:  # from matplotlib 3.11 on there is one more field
        slanted = "Oblique" in face.style_name or "Italic" in face.style_name
        runs.append(Run(chr(sign), float(x) / scale, float(y) / scale, size / scale, 0.0, face.family_name, slanted))
    corners = ((x / scale, y / scale, (x + length) / scale, (y + height) / scale) for x, y, length, height in bars)
    return Setting(float(width) / scale, tuple(runs), tuple(rectangle(*each, fill=0.0) for each in corners))


@lru_cache(maxsize=16384)
def _plain_width(words: str) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextToPath

    font = FontProperties(family=FAMILY, size=SIZE)
    return float(TextToPath().get_text_width_height_descent(words, font, ismath=False)[0])


@lru_cache(maxsize=16384)
def setting(words: str) -> Setting:
    """A text of size 10, set piece by piece: plain words, and formulas between dollar signs.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        pieces = [
            _formula(piece) if place % 2 else _plain(piece.replace(r"\$", "$"))
            for place, piece in enumerate(FORMULA.split(words))
        ]
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Network.draw()") from None
    x, runs, bars = 0.0, list[Run](), list[Stroke]()
    for piece in pieces:
        runs += [replace(run, x=run.x + x) for run in piece.runs]
        bars += [bar.moved((x, 0.0)) for bar in piece.bars]
        x += piece.width
    return Setting(x, tuple(runs), tuple(bars))


def _plain(words: str) -> Setting:
    inner = words.strip(" ")
    left, space = len(words) - len(words.lstrip(" ")), _plain_width("- -") - _plain_width("--")
    width = _plain_width(inner) if inner else 0.0
    runs = (Run(inner, left * space, width=width),) if inner else ()
    return Setting(width + space * (len(words) - len(inner)), runs)


def width_of(words: str, size: float = SIZE) -> float:
    """The width of a text, pt.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    return setting(words).width * size / SIZE


def box_of(text: Text) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of a text, pt."""
    left = left_of(text)
    return left, text.at[1] - 0.3 * text.size, left + width_of(text.words, text.size), text.at[1] + 0.8 * text.size


def left_of(text: Text) -> float:
    """Where a text begins, pt."""
    width = width_of(text.words, text.size)
    return text.at[0] - {"left": 0.0, "centre": width / 2, "right": width}[text.anchor]


def letters_of(text: Text) -> tuple[tuple[Run, ...], tuple[Stroke, ...]]:
    """The letters of a text and its bars, in points of the drawing."""
    whole, factor, (left, base) = setting(text.words), text.size / SIZE, (left_of(text), text.at[1])
    runs = tuple(
        replace(run, x=left + factor * run.x, y=base + factor * run.y, size=factor * run.size, width=factor * run.width)
        for run in whole.runs
    )
    bars = tuple(
        replace(bar, points=tuple((left + factor * x, base + factor * y) for x, y in bar.points), width=0.0)
        for bar in whole.bars
    )
    return runs, bars
