"""The command that writes a report: `shaftwork report`."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shaftwork.cli.command import (
    Data,
    Say,
    command,
    end_of,
    end_option,
    folder_option,
    load,
    solver_options,
    start_options,
)
from shaftwork.cli.folder import Folder
from shaftwork.cli.frequencies import calculation_of, calculation_options, orders_option
from shaftwork.cli.run import motion_of
from shaftwork.cli.settings import named, once, point, speeds_in
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
    solver_options(parser)
    start_options(parser)
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
    origins = 'where the values of a part or parameter come from, as in "J1=drawing 4711"; as often as needed'
    parser.add_argument("--origins", metavar="NAME=WORDS", action="append", default=[], help=origins)
    about = (
        "a speed, twist or torque of the point about which frequencies are computed: J1.omega=8.5; as often as needed"
    )
    parser.add_argument("--at", metavar="NAME=X", action="append", default=[], help=about)
    orders_option(parser)
    torsional = "the torsional calculation over --speeds; without it these make a Campbell diagram alone"
    parser.add_argument("--torsional", action="store_true", help=torsional)
    calculation_options(parser)


@command("a report to be signed: drawings, equations, motion, extremes", report_options)
def report(options: Namespace, say: Say) -> Data:
    """The report of a scene or a model file."""
    from shaftwork.reporting.report import report as report_on
    from shaftwork.reporting.writers import file_of

    net, scene = load(options)
    endings = [ending for ending in FORMATS if getattr(options, ending)] or ["pdf", "html"]
    chosen = {
        name: value
        for name in ("title", "author", "revision", "date", "sections", "signals")
        if (value := getattr(options, name)) is not None
    }
    chosen |= _contents(options, net)
    subject = replace(scene, build=lambda: net) if scene else net
    page = _live_page(options, subject, endings)
    if scene or options.t_end is not None:
        chosen["solution"] = motion_of(net, end_of(options, scene), options.signals or (), options)
    elif options.initial or options.steady:
        raise ParameterError("--initial and --steady say how a motion starts. Say with --t-end how long it is.")
    document = report_on(subject, text=once("--text", options.text), **chosen)
    figures = [f"report-{file_of(name, figure, 'pdf')}" for name, figure in document.figures.items()]
    names = [
        *(f"report.{ending}" for ending in endings),
        *(figures if "tex" in endings else []),
        *([LIVE] if page else []),
    ]
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


def _contents(options: Namespace, net: Network) -> dict[str, Any]:
    """What a report has by its options besides the motion.

    Raises:
        ParameterError: one is wrong, or has no effect.
    """
    contents: dict[str, Any] = {}
    if options.origins:
        contents["origins"] = once("--origins", (named(text, "--origins", "'J1=drawing'") for text in options.origins))
    if options.at:
        contents["at"] = point(options.at)
    if options.speeds is not None:
        contents |= {"speeds": speeds_in(options.speeds), "orders": options.orders}
    if options.torsional:
        contents["torsional"] = calculation_of(options, net)
    elif options.cross_section or options.permissible or options.misfire or options.rated is not None or options.exact:
        raise ParameterError(
            "--cross-section, --permissible, --rated, --misfire and --exact are of --torsional. Give it, too."
        )
    return contents


def names_in(text: str) -> tuple[str, ...]:
    """Names with commas between them."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _words(text: str) -> tuple[str, Path]:
    section, sign, name = text.partition("=")
    if not sign:
        raise ArgumentTypeError(f"{text!r} must be SECTION=FILE.md, such as introduction=words.md.")
    return section, Path(name)
