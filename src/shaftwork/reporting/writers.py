"""A report as PDF, HTML and LaTeX with its figures."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.core.errors import imported
from shaftwork.drawing.canvas import Drawing
from shaftwork.reporting.plots import plots

if TYPE_CHECKING:
    from shaftwork.reporting.report import Report

EXTRA = "report"
INCLUDED = re.compile(r"\\includegraphics\[[^]]*\]\{([^}]*)\}")
MARK = "PLOT-OF-"
"""Before the name of a plot, where it will stand in the page."""
PAGE = Path(__file__).with_name("page.css")
SHEET = Path(__file__).with_name("sheet.typ")


def as_latex(words: str) -> str:
    """Markdown as LaTeX.

    Raises:
        MissingExtraError: pandoc is not installed.
    """
    return _converted(words, "markdown", "latex")


def html_page(report: Report) -> str:
    """The report as one page."""
    drawn = plots(report)
    latex = INCLUDED.sub(lambda found: f"{MARK}{found[1]}." if found[1] in drawn else found[0], report.latex)
    with tempfile.TemporaryDirectory() as folder:
        _write_figures(report, Path(folder), "svg", besides=drawn)
        options = ("--mathml", "--toc", "--toc-depth=2", "--number-sections", "--embed-resources", f"--css={PAGE}")
        found = (f"--resource-path={folder}", "--default-image-extension=svg")
        page = _converted(latex, "latex", "html5", "--standalone", *options, *found)
    for name, plot in drawn.items():
        page = page.replace(f"{MARK}{name}.", plot)
    return page


def write_pdf(report: Report, path: Path) -> None:
    """The report as PDF, by Typst: it needs no TeX, and comes out the same on every machine."""
    typst = imported("typst", EXTRA, "Report.save() as PDF")
    with tempfile.TemporaryDirectory() as folder:
        _write_figures(report, Path(folder), "svg")
        options = ("--standalone", "--number-sections", f"--template={SHEET}", "--default-image-extension=svg")
        sheet = Path(folder) / "report.typ"
        sheet.write_text(_converted(report.latex, "latex", "typst", *options), encoding="utf-8")
        path.write_bytes(typst.compile(str(sheet)))


def write_latex(report: Report, path: Path) -> None:
    """The report as LaTeX, with its figures as PDF beside it, named after it."""
    _write_figures(report, path.parent, "pdf", named=f"{path.stem}-{{}}")
    latex = INCLUDED.sub(lambda found: found[0].replace(f"{{{found[1]}}}", f"{{{path.stem}-{found[1]}}}"), report.latex)
    path.write_text(latex, encoding="utf-8")


def _converted(text: str, source: str, target: str, *options: str) -> str:
    """A text from one language of documents to another.

    Raises:
        MissingExtraError: pandoc is not installed.
    """
    pandoc = imported("pypandoc", EXTRA, "Report")
    return str(pandoc.convert_text(text, target, format=source, extra_args=list(options)))


def _write_figures(
    report: Report, folder: Path, ending: str, *, named: str = "{}", besides: Collection[str] = ()
) -> None:
    for name, figure in report.figures.items():
        if name not in besides:
            path = folder / f"{named.format(name)}.{ending}"
            if isinstance(figure, Drawing):
                figure.save(path)
            else:
                figure.savefig(path)
