"""Every figure in a sentence of a page is computed, printed by an example, made from the code, or named as given."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from docs.generate import BLOCK, HIDDEN, MADE_PART, NOTEBOOKS, PAGES, ROOT

MEASURED = re.compile(r"<!-- measured: (?P<script>[\w./-]+) -->\n.*?<!-- end -->", re.DOTALL)
"""What a benchmark prints; times differ from machine to machine, so nothing compares them."""
GIVEN = re.compile(r"<!-- given: (?P<figures>.*?) -->", re.DOTALL)
"""Figures that no code makes: those of sources and norms, and definitions."""
NO_FIGURE = re.compile(
    r"`[^`\n]+`|\$\$.*?\$\$|\$[^$\n]+\$|(?<=\])\([^)]*\)|<!--.*?-->"  # code, formulas, targets of links, comments
    r"|^\d\. |\b1/[a-zA-Z]\b"  # numbers of a list, 1/c
    r"|\(\d+[a-z]?\)|\b(?:[Ff]igures?|[Ss]ections?|[Tt]able|eqs?) \d+(?:(?:, | and | to |-)\d+)*(?:\.\d+)*"
    r"|\b(?:19|20)\d\d\b|\b1/min\b|\b(?:IEC|EN|ASTM|Python|fig\.) [\w.-]+|\b[A-Za-zτωφ]+[-_]?\d[\w-]*",  # names: J1
    re.DOTALL | re.MULTILINE,
)
FIGURE = re.compile(r"(?<![\w.])\d+(?:[., ]\d+)*(?:e[-+]?\d+)?(?: ?%)?")
NUMBER = (
    r"(?:(?<!between )(?<!the )two|three|four|five|six|seven|eight|nine|ten|eleven|twelve"
    r"|(?:thir|four|fif|six|seven|eigh|nine)teen|(?:twen|thir|for|fif|six|seven|eigh|nine)(?:ty|tieths?)"
    r"|(?:hundred|thousand|million|dozen)s?|percent|twice|thrice|half|halves|halved|halfway|doubled?|quarters?"
    r"|thirds|(?<=a )third|(?:fif|six|seven|eigh|nin|ten|hundred|thousand)ths?)"
)
WORDS = re.compile(
    rf"\b{NUMBER}\b(?:[\s-]+{NUMBER}\b)*(?:[\s-]+(?:(?:of|a|the|at|in|to|as|for)\s+)?\w+)?", re.IGNORECASE
)
"""A number in words and what it counts; "between two" and "the two" are of the sentence itself."""


def page_of(path: Path) -> str:
    """A page, or a notebook as one; what its cells compute they have to assert, since their outputs are not stored."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".ipynb":
        return text
    cells = (("".join(cell["source"]), cell["cell_type"]) for cell in json.loads(text)["cells"])
    return "\n".join(f"```python\n{source}\n```" if kind == "code" else source for source, kind in cells)


def figures(text: str) -> list[str]:
    """The figures of the sentences and tables of a page that stand in none of its marked places."""
    for pattern in (BLOCK, MADE_PART, MEASURED, HIDDEN, GIVEN, NO_FIGURE):
        text = pattern.sub(" ", text)
    return numbers(text)


def numbers(text: str) -> list[str]:
    """Figures, and numbers in words with what they count."""
    return [*FIGURE.findall(text), *(" ".join(phrase.lower().split()) for phrase in WORDS.findall(text))]


def backed(text: str) -> set[str]:
    """The figures that examples, tables and hidden code of a page hold, and those that it names as given."""
    places = (BLOCK, MADE_PART, MEASURED, HIDDEN, GIVEN, re.compile(r"`[^`\n]+`"))
    return {figure for pattern in places for match in pattern.finditer(text) for figure in numbers(match[0])}


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda page: page.name)
def test_every_figure_in_a_sentence_is_computed_printed_made_or_given(page: Path) -> None:
    text = page_of(page)
    known = backed(text)
    assert [figure for figure in figures(text) if figure not in known] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_is_measured_names_the_script_that_measures_it(page: Path) -> None:
    scripts = [match["script"] for match in MEASURED.finditer(page.read_text(encoding="utf-8"))]
    assert [script for script in scripts if not (ROOT / script).is_file()] == []


def test_a_figure_that_nothing_backs_is_seen() -> None:
    text = "It takes 27.7 ms, 0.5 % of 1e-9, as (14) of 2019 and figure 13 say, or <!--= 3 -->33<!--/--> of `x = 44`.\n"
    assert figures(text) == ["27.7", "0.5 %", "1e-9"]
    words = "Two engines\nand the thirty-two lose half of it between two nodes, <!-- given: half of it -->."
    assert figures(words) == ["two engines", "thirty-two lose", "half of it"]
    assert backed(f"{text}<!-- given: 27.7 -->") >= {"27.7", "33", "44"}
