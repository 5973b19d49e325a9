"""A report as PDF, HTML and LaTeX with its figures."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.core.errors import ShaftworkError, imported
from shaftwork.drawing.canvas import Drawing
from shaftwork.reporting.plots import plots

if TYPE_CHECKING:
    from shaftwork.reporting.report import Report
    from shaftwork.reporting.subject import Picture

EXTRA = "report"
INCLUDED = re.compile(r"\\includegraphics\[[^]]*\]\{([^}]*)\}")
MARK = "PLOT-OF-"
"""Before the name of a plot, where it will stand in the page."""
PAGE = Path(__file__).with_name("page.css")
SHEET = Path(__file__).with_name("sheet.typ")


def html_page(report: Report) -> str:
    """The report as one page."""
    drawn = plots(report)
    latex = INCLUDED.sub(lambda place: f"{MARK}{place[1]}." if place[1] in drawn else place[0], report.latex)
    with tempfile.TemporaryDirectory() as folder:
        _write_figures(report, Path(folder), "svg", besides=drawn)
        options = ("--mathml", "--toc", "--toc-depth=2", "--number-sections", "--embed-resources", f"--css={PAGE}")
        pictures = (f"--resource-path={folder}", "--default-image-extension=svg")
        page = _converted(latex, "latex", "html5", "--standalone", *options, *pictures)
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
    latex = INCLUDED.sub(lambda place: place[0].replace(f"{{{place[1]}}}", f"{{{path.stem}-{place[1]}}}"), report.latex)
    path.write_text(latex, encoding="utf-8")


def _converted(text: str, source: str, target: str, *options: str) -> str:
    """A text from one language of documents to another.

    Raises:
        MissingExtraError: pandoc is not installed.
        ShaftworkError: it cannot read the text.
    """
    pandoc = imported("pypandoc", EXTRA, "Report")
    try:
        return str(pandoc.convert_text(text, target, format=source, extra_args=list(options)))
    except RuntimeError as error:
        raise ShaftworkError(f"pandoc cannot read the report: {' '.join(str(error).split())}. Take .tex.") from None


def _write_figures(
    report: Report, folder: Path, ending: str, *, named: str = "{}", besides: Collection[str] = ()
) -> None:
    for name, figure in report.figures.items():
        if name not in besides:
            path = folder / named.format(file_of(name, figure, ending))
            if isinstance(figure, Path):
                shutil.copyfile(figure, path)
            elif isinstance(figure, Drawing):
                figure.save(path)
            else:
                figure.savefig(path)


def file_of(name: str, figure: Picture, ending: str) -> str:
    """The file of a figure by its name; a picture of the user's has its own ending in it."""
    return name if isinstance(figure, Path) else f"{name}.{ending}"
