"""Pages of HTML: the one that a server brings, and one with answers in it that needs no server."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from itertools import product
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from shaftwork.core.errors import ParameterError, imported
from shaftwork.core.parameters import whole
from shaftwork.live.page_requests import WANTED
from shaftwork.live.sliders import Slider, chosen

if TYPE_CHECKING:
    from shaftwork.live.session import Session

WEB = Path(__file__).parent / "web"
SCRIPTS = ("stage.js", "plot.js", "page.js")
COUNTS = {1: (21,), 2: (11, 11)}
"""Values along each slider of a page without a server, when nobody chooses."""


def plotly_script() -> str:
    """The script of plotly.

    Raises:
        MissingExtraError: plotly is not installed.
    """
    return str(imported("plotly.offline", "live", "A live page").get_plotlyjs())


def served_page(session: Session) -> str:
    """The page that asks the server it comes from."""
    style = '<link rel="stylesheet" href="page.css">'
    scripts = "".join(f'<script src="{name}"></script>\n' for name in ("plotly.js", *SCRIPTS))
    return _filled(session, style, scripts, None)


def static_page(session: Session, sliders: Sequence[str], counts: Sequence[int] = ()) -> str:
    """The page with its answers in it; see `Session.page`."""
    axes = chosen(session.sliders, sliders)
    if len(axes) not in COUNTS:
        raise ParameterError(
            f"sliders = {', '.join(sliders)}: a page without a server has one or two, such as shaft.c."
        )
    grid = _grid(axes, counts or COUNTS[len(axes)])
    wanted = [name for name in WANTED if name != "layout"]
    answers = [session.answer({"set": dict(zip(sliders, at, strict=True)), "want": wanted}) for at in product(*grid)]
    precomputed = {
        "sliders": [{"name": name, "values": values} for name, values in zip(sliders, grid, strict=True)],
        "answers": answers,
        "layout": session.layout,
    }
    style = f"<style>\n{_text('page.css')}</style>"
    sources = (plotly_script(), *map(_text, SCRIPTS))
    return _filled(session, style, "".join(f"<script>{_inside(source)}</script>\n" for source in sources), precomputed)


def _grid(axes: Sequence[Slider], counts: Sequence[int]) -> list[list[float]]:
    """The values along each slider.

    Raises:
        ParameterError: counts are none, or there are too many answers.
    """
    if len(counts) != len(axes) or any(whole(count, least=2) is None for count in counts):
        raise ParameterError(f"counts = {counts!r} must be a whole number from 2 on for each slider, such as (11, 11).")
    grid = [axis.values(count) for axis, count in zip(axes, counts, strict=True)]
    total = len(grid[0]) * (len(grid[1]) if len(grid) > 1 else 1)
    if total > (most := 400):  # each takes some 100 kB
        raise ParameterError(f"counts = {tuple(counts)} are {total} answers; a page has at most {most}.")
    return grid


def _filled(session: Session, style: str, scripts: str, answers: Any) -> str:
    return Template(_text("page.html")).substitute(
        title=escape(session.title),
        style=style,
        drawing=session.drawing({}),
        setup=_data(session.setup),
        answers=_data(answers),
        scripts=scripts,
    )


def _data(value: Any) -> str:
    """Plain data inside of a page, where no text may end it."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")


def _inside(script: str) -> str:
    """A script inside of a page: no text in it may look like its end."""
    return script.replace("</script", "<\\/script")


def _text(name: str) -> str:
    return (WEB / name).read_text(encoding="utf-8")
