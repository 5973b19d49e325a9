"""Words of the user: Markdown as LaTeX with its pictures. What a document cannot have is refused, not dropped."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from shaftwork.core.errors import ParameterError, imported

# a backslash of a path is no command, and what another language would say is read as the letters that it is
DIALECT = "markdown-raw_tex-raw_html-raw_attribute-yaml_metadata_block-strikeout-task_lists-citations"
OPTIONS = ("--shift-heading-level-by=1", "--syntax-highlighting=none")
"""A heading is one below that of its section."""
ENDINGS = (".png", ".jpg", ".jpeg")
"""Of pictures that PDF, HTML and pdflatex can all show."""
SCHEMES = ("http", "https", "mailto")
"""Where a link may lead."""
SCHEME = re.compile(r"\s*([A-Za-z][A-Za-z0-9+.-]*):")
START = {"t": "RawInline", "c": ["latex", r"\mbox{}"]}
"""Stands before the first word of a cell: pandoc takes a number there for an argument of the command before it."""


def as_latex(section: str, words: str, folder: Path) -> tuple[str, dict[str, Path]]:
    """Markdown as LaTeX, and the pictures that it shows, by the names under which it includes them.

    Args:
        section: before which the words stand.
        words: in Markdown.
        folder: of its pictures.

    Raises:
        ParameterError: a picture is not there, or none that a document can show; or a link leads somewhere else than
            to a page or an address.
        MissingExtraError: pandoc is not installed.
    """
    pandoc = imported("pypandoc", "report", "Report")
    document = json.loads(pandoc.convert_text(words, "json", format=DIALECT))
    pictures: dict[str, Path] = {}
    for element in _elements(document["blocks"]):
        match element["t"]:
            case "Image":
                path = _picture(section, element["c"][2][0], folder)
                name = f"{section.replace(' ', '-')}-{len(pictures) + 1}{path.suffix.lower()}"
                pictures[name] = path
                element.update(t="RawInline", c=["latex", rf"\includegraphics[width=0.8\linewidth]{{{name}}}"])
            case "Link":
                _refuse_strange(section, element["c"][2][0])
            case "Table":
                _begin_cells(element["c"])
    latex = pandoc.convert_text(json.dumps(document), "latex", format="json", extra_args=list(OPTIONS))
    return str(latex), pictures


def _elements(tree: Any) -> Iterator[dict[str, Any]]:
    """All elements of a document as pandoc writes it."""
    if isinstance(tree, dict):
        if "t" in tree:
            yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for branch in tree:
            yield from _elements(branch)


def _picture(section: str, target: str, folder: Path) -> Path:
    """The file of a picture.

    Raises:
        ParameterError: there is none.
    """
    shown = f"text of section {section!r}: the picture {target!r}"
    if SCHEME.match(target) or target.startswith("//"):
        raise ParameterError(
            f"{shown} is not on this machine, and a report fetches nothing. Save it and name its file."
        )
    path = folder / unquote(target)
    if path.suffix.lower() not in ENDINGS:
        raise ParameterError(f"{shown} must be a file {', '.join(ENDINGS)}. Save it as one of them.")
    if not path.is_file():
        raise ParameterError(f"{shown} is not there: {path.resolve()} is no file. Correct its name.")
    return path


def _refuse_strange(section: str, target: str) -> None:
    """Refuse a link that would run something, or open a file of the reader's.

    Raises:
        ParameterError: it is one.
    """
    # browsers read over blanks and control signs within the scheme
    scheme = SCHEME.match("".join(sign for sign in unquote(target) if sign.isprintable() and not sign.isspace()))
    if scheme is None or scheme[1].lower() not in SCHEMES:
        raise ParameterError(
            f"text of section {section!r}: the link {target!r} leads to no page. Links may begin with: "
            f"{', '.join(SCHEMES)}."
        )


def _begin_cells(table: Any) -> None:
    """Put a mark before the first word of each cell."""
    _, _, _, (_, head), bodies, (_, foot) = table
    rows = [*head, *(row for _, _, heads, body in bodies for row in (*heads, *body)), *foot]
    for _, cells in rows:
        for cell in cells:
            blocks = cell[4]
            if blocks and blocks[0]["t"] in ("Plain", "Para"):
                blocks[0]["c"].insert(0, START)


def read(text: Mapping[str, str | Path]) -> dict[str, tuple[str, Path]]:
    """Words by section, and the folder of their pictures.

    Raises:
        ParameterError: they are no text, or in a file that cannot be read.
    """
    words = {}
    for section, said in text.items():
        if isinstance(said, Path):
            try:
                words[section] = said.read_text(encoding="utf-8"), said.parent
            except (OSError, UnicodeDecodeError) as error:
                raise ParameterError(f"text of section {section!r}: {str(said)!r} cannot be read: {error}.") from None
        elif isinstance(said, str):
            words[section] = said, Path()
        else:
            raise ParameterError(f"text of section {section!r}: {said!r} must be a text in Markdown, or a Path to one.")
    return words
