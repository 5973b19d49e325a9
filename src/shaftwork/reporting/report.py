"""`report`: sections in their order, with the user's words, as one document."""

from __future__ import annotations

import datetime as dt
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.core.files import in_a_folder
from shaftwork.equations.spelling import in_text, stand_ins
from shaftwork.latex.document import BEGIN, PREAMBLE
from shaftwork.pipeline.network import Network, network_of
from shaftwork.reporting import motion_sections, network_sections, vibration_sections
from shaftwork.reporting.latex_parts import columns, listed, paragraphs
from shaftwork.reporting.report_arguments import (
    Contents,
    checked,
    checked_head,
    refuse_foreign,
    refuse_idle,
    refuse_unknown,
    section_names,
)
from shaftwork.reporting.subject import ReportSection, Subject
from shaftwork.reporting.words import as_latex, read
from shaftwork.reporting.writers import html_page, write_latex, write_pdf
from shaftwork.results.fatigue import twisted
from shaftwork.results.plotting import MOST_SIGNALS
from shaftwork.results.solution import Solution
from shaftwork.scenes.catalog import LITERATURE, Scene

if TYPE_CHECKING:
    from shaftwork.reporting.subject import Picture

SECTIONS: Mapping[str, tuple[str, Callable[[Subject], ReportSection]]] = {
    "drawing": ("Drive train and circuit", network_sections.drawing),
    "parts": ("Parts and values", network_sections.parts),
    "assumptions": ("Assumptions", lambda subject: network_sections.assumptions(subject, ())),
    "equations": ("Equations", network_sections.equations),
    "conditions": ("Initial and operating conditions", motion_sections.conditions),
    "frequencies": ("Natural frequencies", vibration_sections.frequencies),
    "campbell": ("Campbell diagram", vibration_sections.campbell),
    "torsional": ("Torsional vibration", vibration_sections.torsional),
    "motion": ("Motion", motion_sections.motion),
    "extremes": ("Extremes", motion_sections.extremes),
    "energy": ("Energy balance and accuracy", motion_sections.energy),
    "cycles": ("Load cycles and life", motion_sections.cycles),
    "shaft models": ("Models of the shaft compared", vibration_sections.shaft_models),
    "nomenclature": ("Nomenclature", network_sections.nomenclature),
    "references": ("References", lambda subject: ReportSection(listed((*subject.references, *_standards(subject))))),
    "model file": ("Model file", network_sections.model_file),
}
"""What a report can have, in its order, each with its heading."""
WORDS = ("introduction", "conclusions")
"""Sections that are the user's words alone: the first one, and the one before the nomenclature."""
_PLACES = (WORDS[0], *SECTIONS, WORDS[1])
WRITTEN_LAST = "assumptions"
"""They name what could not be computed for the other sections."""
HEAD = rf"""{PREAMBLE.replace("margin=25mm", "margin=22mm")}
\usepackage{{float}}
\floatplacement{{figure}}{{H}}
\usepackage{{graphicx}}
\usepackage{{calc}}
\usepackage[hidelinks]{{hyperref}}
% a section and a table begin where some rows have room
\makeatletter
\newcommand{{\roomfor}}[1]{{\par\if@nobreak\else\ifdim\dimexpr\pagegoal-\pagetotal<#1\relax\newpage\fi\fi}}
\ifdefined\AddToHook
\AddToHook{{env/longtable/before}}{{\roomfor{{35mm}}}}
\AddToHook{{cmd/section/before}}{{\roomfor{{50mm}}}}
\fi
\makeatother
\providecommand{{\tightlist}}{{\setlength{{\itemsep}}{{0pt}}\setlength{{\parskip}}{{0pt}}}}"""
STANDARDS = {
    "rainflow": "ASTM E1049-85: Standard practices for cycle counting in fatigue analysis. ASTM International",
    "torsional": "IACS UR M68: Dimensions of propulsion shafts and their permissible torsional vibration stresses. "
    "International Association of Classification Societies",
}
"""What counts load cycles, and what permits stresses of shafts."""
FORMATS = ("pdf", "html", "tex")


@dataclass(frozen=True, eq=False)
class Report:
    """A report on a network: shown in notebooks, `save` writes PDF, HTML and LaTeX.

    Args:
        title: of the document.
        author: who answers for it.
        date: in words.
        revision: of the document.
        source: where the system comes from.
        sections: headings and their LaTeX.
        figures: pictures by the name under which sections include them.
        curves: of those that show a motion, the quantities; HTML has them as plots that can be zoomed.
        solution: the motion.
    """

    title: str
    author: str
    date: str
    revision: str
    source: str
    sections: tuple[tuple[str, str], ...]
    figures: Mapping[str, Picture]
    curves: Mapping[str, tuple[str, ...]]
    solution: Solution | None

    @cached_property
    def latex(self) -> str:
        """The whole document, for pdflatex; it includes its figures by their names."""
        facts = {"Revision": self.revision, "Source": self.source, "Computed with": f"Shaftwork {version('shaftwork')}"}
        rows = [(in_text(name), in_text(text)) for name, text in facts.items() if text]
        body = "\n".join(f"\\section{{{in_text(heading)}}}\n{text}" for heading, text in self.sections)
        author = f"\\author{{{in_text(self.author)}}}\n" if self.author else ""
        begin = BEGIN.replace(r"\date{}", rf"\date{{{in_text(self.date)}}}")
        title = f"\\title{{{in_text(self.title)}}}\n{author}"
        identity = columns(("Document", ""), rows, (1, 4))
        letters = stand_ins(f"{title}{begin}{identity}{body}")
        return f"{HEAD}\n{letters}{title}{begin}\n{identity}\n{body}\n\\end{{document}}\n"

    @cached_property
    def html(self) -> str:
        """One page that opens without the internet: formulas in MathML, plots that can be zoomed, drawings.

        Raises:
            MissingExtraError: pandoc is not installed (extra `report`).
        """
        return html_page(self)

    def save(self, path: str | Path) -> None:
        """Write it; the format follows from the end of the name: .pdf, .html, or .tex with its figures beside it.

        Raises:
            ParameterError: another end, or it is in no folder that there is.
            ShaftworkError: the file cannot be written, as on a full disk.
            MissingExtraError: pandoc, or Typst for PDF, is not installed (extra `report`).
        """
        place = in_a_folder(path)
        ending = place.suffix.lower()
        if ending.removeprefix(".") not in FORMATS:
            raise ParameterError(f"A report is no '{place.suffix}'. Take .{', .'.join(FORMATS)}.")
        try:
            match ending:
                case ".pdf":
                    write_pdf(self, place)
                case ".html":
                    place.write_text(self.html, encoding="utf-8")
                case ".tex":
                    write_latex(self, place)
        except OSError as error:
            raise ShaftworkError(f"'{place}' cannot be written: {error}. Make room, or give another name.") from None

    def __repr__(self) -> str:
        headings = ", ".join(heading for heading, _ in self.sections)
        return f"Report '{self.title}'\n{textwrap.fill(headings, 100, initial_indent='  ', subsequent_indent='  ')}"


def report(
    subject: Network | Scene,
    *,
    t_end: float | None = None,
    solution: Solution | None = None,
    title: str | None = None,
    author: str = "",
    date: str | None = None,
    revision: str = "",
    source: str | None = None,
    text: Mapping[str, str | Path] | None = None,
    sections: Sequence[str] | None = None,
    **contents: Unpack[Contents],
) -> Report:
    """A report on a network, with everything that someone needs who answers for its numbers.

    Args:
        subject: a network, or a scene, whose title, source, choices, end time and signals are taken.
        t_end: end of the motion, s; without it and without `solution` a network is reported without a motion.
        solution: the motion, in place of a run from rest to `t_end`.
        title: of the document; by default the network's name.
        author: who answers for it.
        date: in words; by default today's.
        revision: of the document.
        source: where the system comes from.
        text: your own words in Markdown by section, or a `Path` to them; "introduction" and "conclusions" are sections
            of their own. Pictures are PNG and JPEG files beside the words, or in the current folder.
        sections: those wanted, by name; by default all that have anything to say.
        **contents: what else it has, see `Contents`.

    Raises:
        ParameterError: an argument is not what it must be; the message says what would be right.
        NetworkError, SimulationError: the network cannot be assembled, or its motion failed.
        MissingExtraError: matplotlib is not installed, or pandoc for words in Markdown.

    Examples:
        >>> import shaftwork as sw
        >>> sw.report(sw.scenes.SCENES["crane-start"], author="A. Engineer", sections=["parts", "extremes"])
        Report 'Crane travel drive, start and steady travel'
          Parts and values, Extremes
    """
    words = _words(text)
    wanted = tuple(SECTIONS) if sections is None else section_names("sections", sections, _PLACES)
    checked_head(title=title, author=author, date=date, revision=revision, source=source)
    if solution is not None and t_end is not None:
        raise ParameterError("solution= and t_end= both say how long the motion is. Leave out one of them.")
    about = _subject(subject, solution, t_end, source, checked(contents))
    by_default = subject.title if isinstance(subject, Scene) else about.network.name
    written = _written(about, words, wanted)
    if not written:
        raise ParameterError(f"sections = {sections!r} say nothing. Those of a motion need t_end= or solution=.")
    return _document(about, written, by_default if title is None else title, author, date, revision)


def _document(
    about: Subject, written: Mapping[str, ReportSection], title: str, author: str, date: str | None, revision: str
) -> Report:
    today = dt.datetime.now().astimezone().date().isoformat()
    return Report(
        title=title[:1].upper() + title[1:],
        author=author,
        date=today if date is None else date,
        revision=revision,
        source=about.source,
        sections=tuple((heading, section.text) for heading, section in written.items()),
        figures={name: figure for section in written.values() for name, figure in section.figures.items()},
        curves={name: signals for section in written.values() for name, signals in section.curves.items()},
        solution=about.solution,
    )


def _words(text: Mapping[str, str | Path] | None) -> dict[str, tuple[str, Path]]:
    """The user's own words by section."""
    if text is not None and not isinstance(text, Mapping):
        raise ParameterError(f"text = {text!r} must say by section, {{'introduction': 'words in Markdown'}}.")
    section_names("text", tuple(text or ()), _PLACES)
    return read(text or {})


def _subject(
    subject: Network | Scene, solution: Solution | None, t_end: float | None, source: str | None, contents: Contents
) -> Subject:
    """What the sections are written of; a scene says what the user does not."""
    scene = subject if isinstance(subject, Scene) else None
    network = subject() if isinstance(subject, Scene) else network_of(subject)
    end = t_end if t_end is not None else scene.t_end if scene else None
    if solution is not None:
        refuse_foreign(solution, network)
    refuse_unknown(contents.get("origins", {}), network)
    motion = network.simulate(end) if solution is None and end is not None else solution
    refuse_idle(contents, motion)
    origin = source if source is not None else scene.source if scene else ""
    literature = (full for short, full in LITERATURE.items() if short in origin)
    return Subject(
        network=network,
        solution=motion,
        source=origin,
        signals=tuple(contents.get("signals", scene.signals if scene else _states(motion))),
        phases=tuple(contents.get("phases", ())),
        at=contents.get("at"),
        speeds=contents.get("speeds", ()),
        orders=contents.get("orders", (1, 2, 3)),
        sn=contents.get("sn"),
        origins=contents.get("origins", {}),
        assumptions=(*(scene.chosen if scene else ()), *contents.get("assumptions", ())),
        references=(*contents.get("references", ()), *literature),
        comparison=contents.get("comparison"),
        torsional=contents.get("torsional"),
    )


def _states(solution: Solution | None) -> tuple[str, ...]:
    """The first states that can be read; of none where there is no motion."""
    names = tuple(name for name in solution.states if name in solution) if solution else ()
    return names[:MOST_SIGNALS]


def _written(about: Subject, words: Mapping[str, tuple[str, Path]], wanted: Sequence[str]) -> dict[str, ReportSection]:
    """The sections that say anything, by heading."""
    introduction, conclusions = WORDS
    said = {name: ReportSection(*as_latex(name, *text)) for name, text in words.items()}
    written = {name: SECTIONS[name][1](about) for name in SECTIONS if name in wanted and name != WRITTEN_LAST}
    notes = [note for section in written.values() for note in section.notes]
    if WRITTEN_LAST in wanted:
        written[WRITTEN_LAST] = network_sections.assumptions(about, notes)
    order = list(SECTIONS)
    order.insert(order.index("nomenclature"), conclusions)
    headings = {name: SECTIONS[name][0] if name in SECTIONS else name.capitalize() for name in (introduction, *order)}
    sections = {
        heading: _joined(said.get(name, ReportSection()), written.get(name, ReportSection()))
        for name, heading in headings.items()
    }
    if WRITTEN_LAST not in wanted:
        sections["Left out"] = ReportSection(listed(dict.fromkeys(notes)))
    return {heading: section for heading, section in sections.items() if section.text}


def _standards(subject: Subject) -> Iterator[str]:
    """Rules and methods that sections refer to."""
    if subject.solution is not None and twisted(subject.solution.reader):
        yield STANDARDS["rainflow"]
    if subject.torsional is not None:
        yield STANDARDS["torsional"]


def _joined(words: ReportSection, section: ReportSection) -> ReportSection:
    """A section with the words of the user before it."""
    return replace(section, text=paragraphs(words.text, section.text), figures={**words.figures, **section.figures})
