"""A report as PDF, HTML and LaTeX with its figures."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.core.errors import ShaftworkError, imported
from shaftwork.drawing.canvas import Drawing
from shaftwork.reporting.plots import plots

if TYPE_CHECKING:
    from shaftwork.reporting.report import Report

EXTRA = "report"
INCLUDED = re.compile(r"\\includegraphics\[[^]]*\]\{([^}]*)\}")
MARK = "PLOT-OF-"
"""Before the name of a plot, where it will stand in the page."""
UPRIGHT = re.compile(r"\$\\mathrm\{((?:\\text\{(?:[^{}]|\\[{}])*\}|[^{}$\\^_]|\\[_%&# ])+)\}\$")
"""A word that is printed as a formula because it has signs that text must escape."""
IN_TEXT = re.compile(r"\\text\{((?:[^{}]|\\[{}])*)\}")
BEFORE_CELLS = re.compile(r"(\\end(?:head|foot|lastfoot))\b")
"""Commands of a table before its first cell."""
PAGE = Path(__file__).with_name("page.css")
SHEET = Path(__file__).with_name("sheet.typ")


def as_latex(words: str) -> str:
    """Markdown as LaTeX.

    Raises:
        MissingExtraError: pandoc is not installed.
    """
    # a backslash of a path is no command, and a heading is one below that of the section
    return _converted(words, "markdown-raw_tex", "latex", "--shift-heading-level-by=1")


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
        try:
            path.write_bytes(typst.compile(str(sheet)))
        except typst.TypstError as error:
            reason = " ".join(str(error).split())
            raise ShaftworkError(f"The report cannot be set as PDF: {reason}. Take .html or .tex.") from None


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
    if source == "latex":
        # pandoc would take a number that stands behind these for their argument, and it would be lost
        text = UPRIGHT.sub(
            lambda word: IN_TEXT.sub(r"\1", word[1]), text
        )  # a name with braces or quotes is no formula for pandoc
        text = BEFORE_CELLS.sub(r"\1{}", text.replace(r">{\raggedright\arraybackslash}", ""))
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
