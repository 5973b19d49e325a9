"""Formulas of the built site: MathML, which browsers draw by themselves, without a script and without the internet.

mkdocs calls `on_page_markdown` and `on_page_content` for each page (`hooks` in mkdocs.yml). Printed LaTeX is shown as
formulas, with its source folded below.
"""

from __future__ import annotations

import re
from html import unescape
from textwrap import indent
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL)
"""What pymdownx.arithmatex (generic) makes of $...$ and $$...$$."""
LEFT_OVER = re.compile(r">\s*(?:\\[A-Za-z]*|&|&amp;)\s*<")
"""A command or a separator that the converter did not know, and shows as it stands."""
TEXT = re.compile(r"\\text\{((?:[^{}]|\{[^{}]*\})*)\}")
"""Words in a formula; the converter does not read formulas within them, "J$_{2}$"."""


PRINTED = re.compile(r"^```latex\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""What an example printed as LaTeX."""
PARAGRAPH = re.compile(r"\\paragraph\{(.*?)\}\\mbox\{\}")
ALIGNED = re.compile(r"\\begin\{align\*\}.*?\\end\{align\*\}", re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page with the LaTeX that its examples print as formulas, and folded below as it is."""
    return PRINTED.sub(_shown, markdown)


def _shown(printed: re.Match[str]) -> str:
    formulas = ALIGNED.sub(
        lambda aligned: f"\n$$\n{aligned[0]}\n$$\n", printed[1].replace("\\allowdisplaybreaks\n", "")
    )
    return f'{PARAGRAPH.sub(_titled, formulas)}\n??? note "LaTeX"\n\n{indent(printed[0], "    ")}\n'


def _titled(paragraph: re.Match[str]) -> str:
    return f"\n**{paragraph[1]}**\n"


def on_page_content(content: str, **_: Any) -> str:
    """The HTML of a page with its LaTeX formulas as MathML.

    Args:
        content: the HTML of the page's text.

    Raises:
        ValueError: a formula has a command that MathML is not made of.
    """
    return FORMULA.sub(_mathml, content)


def _mathml(formula: re.Match[str]) -> str:
    latex, block = TEXT.sub(_apart, unescape(formula["latex"]).strip()), formula["tag"] == "div"
    drawn = convert(latex, display="block" if block else "inline")
    if unknown := LEFT_OVER.search(drawn):
        raise ValueError(
            f"The formula {latex} would show {unknown[0][1:-1]!r} as it stands. Write it in other commands."
        )
    return f'<div class="formula">{drawn}</div>' if block else drawn


def _apart(text: re.Match[str]) -> str:
    pieces = enumerate(text[1].split("$"))
    return "".join(f"{{}}{piece}" if number % 2 else f"\\text{{{piece}}}" for number, piece in pieces if piece)
