"""Formulas of the built site: MathML, which browsers draw by themselves, without a script and without the internet.

mkdocs calls `on_page_content` for each page (`hooks` in mkdocs.yml).
"""

from __future__ import annotations

import re
from html import unescape
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL)
"""What pymdownx.arithmatex (generic) makes of $...$ and $$...$$."""
LEFT_OVER = re.compile(r">\s*(?:\\[A-Za-z]*|&|&amp;)\s*<")
"""A command or a separator that the converter did not know, and shows as it stands."""


def on_page_content(content: str, **_: Any) -> str:
    """The HTML of a page with its LaTeX formulas as MathML.

    Args:
        content: the HTML of the page's text.

    Raises:
        ValueError: a formula has a command that MathML is not made of.
    """
    return FORMULA.sub(_mathml, content)


def _mathml(formula: re.Match[str]) -> str:
    latex, block = unescape(formula["latex"]).strip(), formula["tag"] == "div"
    drawn = convert(latex, display="block" if block else "inline")
    if unknown := LEFT_OVER.search(drawn):
        raise ValueError(
            f"The formula {latex} would show {unknown[0][1:-1]!r} as it stands. Write it in other commands."
        )
    return f'<div class="formula">{drawn}</div>' if block else drawn
