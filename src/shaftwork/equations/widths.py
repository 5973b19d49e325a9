"""About how wide a formula is in print, to know where to break it."""

from __future__ import annotations

import re
from collections.abc import Iterator

from shaftwork.equations.notation import without_marks

TOKEN = re.compile(r"\\[A-Za-z]+|\\.|.", re.DOTALL)
WIDTHS = {
    **dict.fromkeys("+-=<>", 2.5),
    **dict.fromkeys("()[].:!|", 0.65),
    **dict.fromkeys(",;", 0.8),
    **dict.fromkeys(" &$", 0.0),
    **dict.fromkeys((r"\left", r"\right", r"\biggl", r"\biggr", r"\displaystyle"), 0.25),
    r"\,": 0.3,
    r"\ ": 0.6,
    r"\quad": 1.9,
    r"\qquad": 3.8,
    r"\Delta": 1.5,
    r"\dots": 2.3,
    r"\cdot": 1.3,
}
"""Widths in units of an ordinary letter, about 5.7 points at a font size of 11 points."""
LETTER, CAPITAL, GREEK, DIGIT = 1.0, 1.35, 1.1, 0.95
SCRIPT_SIZE, SCRIPT_SPACE = 0.75, 0.1
FUNCTION = re.compile(r"\\(tanh|cosh|sinh|cos|sin|tan|exp|log|sqrt|operatorname|max|min|sign)$")


def printed_width(latex: str) -> float:
    """The width of a formula in ordinary letters: scripts are smaller, a fraction is as wide as its wider part."""
    return _width(iter(TOKEN.findall(without_marks(latex))), one=False)


def _width(tokens: Iterator[str], *, one: bool) -> float:
    """Width of all tokens up to the end of the group, or of the next item alone."""
    total = 0.0
    for item in tokens:
        if item == " " and one:
            continue
        if item == "}":
            break
        total += _item(item, tokens)
        if one:
            break
    return total


def _item(item: str, tokens: Iterator[str]) -> float:
    match item:
        case "{":
            return _width(tokens, one=False)
        case "_" | "^":
            return SCRIPT_SPACE + SCRIPT_SIZE * _width(tokens, one=True)
        case r"\frac":
            return 0.4 + max(_width(tokens, one=True), _width(tokens, one=True))
        case r"\begin" | r"\end":
            _width(tokens, one=True)
            return 0.0
        case r"\mathrm" | r"\text" | r"\mathbf" | r"\mathsf" | r"\dot" | r"\ddot" | r"\operatorname":
            return 0.0  # the group that follows has the width
    if item in WIDTHS:
        return WIDTHS[item]
    if FUNCTION.match(item):
        return 0.9 * len(item)
    if item.isdigit():
        return DIGIT
    return GREEK if item.startswith("\\") else CAPITAL if item.isupper() else LETTER
