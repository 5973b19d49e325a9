"""The command that writes a report: `shaftwork report`."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.cli.command import Data, Say, command, end_option, folder_option, load
from shaftwork.cli.folder import Folder
from shaftwork.core.errors import ParameterError

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes.catalog import Scene

FORMATS = ("pdf", "html", "tex")
LIVE = "live.html"


def report_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork report`."""
    folder_option(parser, "the report (default: report)")
    end_option(parser, "that of the scene; a model file has no motion without it")
    for ending, text in zip(FORMATS, ("write report.pdf", "write report.html", "write report.tex"), strict=True):
        parser.add_argument(f"--{ending}", action="store_true", help=f"{text} (default: PDF and HTML)")
    for name, text in (("title", "of the document"), ("author", "who answers for it"), ("revision", "of the document")):
        parser.add_argument(f"--{name}", metavar="WORDS", help=text)
    parser.add_argument("--date", metavar="WORDS", help="date in words (default: today)")
    parser.add_argument("--sections", metavar="NAME,...", type=names_in, help="sections wanted (default: all)")
    parser.add_argument("--signals", metavar="NAME,...", type=names_in, help="quantities to draw, such as shaft.tau")
    parser.add_argument(
        "--live",
        metavar="PART.PARAMETER,...",
        type=names_in,
        help="with --html, write live.html besides: a page with sliders for one or two values, computed before",
    )
    parser.add_argument(
        "--text", metavar="SECTION=FILE.md", action="append", default=[], type=_words, help="your words in Markdown"
    )


@command("a report to be signed: drawings, equations, motion, extremes, as PDF and HTML", report_options)
def report(options: Namespace, say: Say) -> Data:
    """The report of a scene or a model file."""
    from shaftwork.reporting.report import report as made_of

    net, scene = load(options)
    endings = [ending for ending in FORMATS if getattr(options, ending)] or ["pdf", "html"]
    chosen = {
        name: value
        for name in ("title", "author", "revision", "date", "sections", "signals", "t_end")
        if (value := getattr(options, name)) is not None
    }
    subject = replace(scene, build=lambda: net) if scene else net
    page = _live_page(options, subject, endings)
    document = made_of(subject, text=dict(options.text), **chosen)
    figures = [f"report-{name}.pdf" for name in document.figures] if "tex" in endings else []
    names = [*(f"report.{ending}" for ending in endings), *figures, *([LIVE] if page else [])]
    folder = Folder(options.out or Path("report"), names, options.line)
    with folder.new_files(say) as place:
        for ending in endings:
            document.save(place / f"report.{ending}")
        if page:
            (place / LIVE).write_text(page, encoding="utf-8")
    return {}


def _live_page(options: Namespace, subject: Network | Scene, endings: Sequence[str]) -> str:
    """The page of `--live`; empty without it.

    Raises:
        ParameterError: it would stand beside no page, or there is no such parameter.
    """
    if options.live is None:
        return ""
    if "html" not in endings:
        raise ParameterError(f"--live writes {LIVE} beside report.html. Give --html, too.")
    from shaftwork.live.session import Session

    return Session(subject, t_end=options.t_end, signals=options.signals).page(options.live)


def names_in(text: str) -> tuple[str, ...]:
    """Names with commas between them."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _words(text: str) -> tuple[str, str]:
    section, sign, name = text.partition("=")
    if not sign:
        raise ArgumentTypeError(f"{text!r} must be SECTION=FILE.md, such as introduction=words.md.")
    try:
        return section, Path(name).read_text(encoding="utf-8")
    except OSError as error:
        raise ArgumentTypeError(f"{name!r} cannot be read: {error}.") from None
