"""`report`: sections in their order, with the user's words, as one document."""

from __future__ import annotations

import datetime as dt
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from shaftwork.core.errors import ParameterError
from shaftwork.equations.spelling import in_text
from shaftwork.latex.document import BEGIN, PREAMBLE
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import Point
from shaftwork.pipeline.network import Network, network_of
from shaftwork.reporting import motion_sections, network_sections, vibration_sections
from shaftwork.reporting.latex_parts import columns, listed, paragraphs
from shaftwork.reporting.subject import Subject
from shaftwork.reporting.writers import as_latex, html_page, write_latex, write_pdf
from shaftwork.results.fatigue import SNLine
from shaftwork.results.solution import Solution
from shaftwork.scenes.catalog import LITERATURE, Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.drawing.canvas import Drawing

SECTIONS: Mapping[str, tuple[str, Callable[[Subject], str]]] = {
    "drawing": ("Drive train and circuit", network_sections.drawing),
    "parts": ("Parts and values", network_sections.parts),
    "assumptions": ("Assumptions", network_sections.assumptions),
    "equations": ("Equations", network_sections.equations),
    "conditions": ("Initial conditions", motion_sections.conditions),
    "frequencies": ("Natural frequencies", vibration_sections.frequencies),
    "campbell": ("Campbell diagram", vibration_sections.campbell),
    "torsional": ("Torsional vibration", vibration_sections.torsional),
    "motion": ("Motion", motion_sections.motion),
    "extremes": ("Extremes", motion_sections.extremes),
    "energy": ("Energy balance and accuracy", motion_sections.energy),
    "cycles": ("Load cycles and life", motion_sections.cycles),
    "shaft models": ("Models of the shaft compared", vibration_sections.shaft_models),
    "nomenclature": ("Nomenclature", network_sections.nomenclature),
    "references": ("References", lambda subject: listed(subject.references)),
    "model file": ("Model file", network_sections.model_file),
}
"""What a report can have, in its order, each with its heading."""
WORDS = ("introduction", "conclusions")
"""Sections that are the user's words alone: the first one, and the one before the nomenclature."""
WRITTEN_LAST = "assumptions"
"""They name what could not be computed for the other sections."""
HEAD = rf"""{PREAMBLE.replace("margin=25mm", "margin=22mm")}
\usepackage{{float}}
\usepackage{{graphicx}}
\providecommand{{\tightlist}}{{\setlength{{\itemsep}}{{0pt}}\setlength{{\parskip}}{{0pt}}}}"""
FORMATS = ("pdf", "html", "tex")
MOST_SIGNALS = 12
"""States drawn when nobody chooses."""


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
    figures: Mapping[str, Figure | Drawing]
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
        return f"{HEAD}\n{title}{begin}\n{identity}\n{body}\n\\end{{document}}\n"

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
            ParameterError: another end.
            MissingExtraError: pandoc, or Typst for PDF, is not installed (extra `report`).
        """
        path = Path(path)
        match path.suffix.lower():
            case ".pdf":
                write_pdf(self, path)
            case ".html":
                path.write_text(self.html, encoding="utf-8")
            case ".tex":
                write_latex(self, path)
            case _:
                raise ParameterError(f"A report is no '{path.suffix}'. Take .{', .'.join(FORMATS)}.")

    def __repr__(self) -> str:
        headings = ", ".join(heading for heading, _ in self.sections)
        return f"Report '{self.title}'\n{textwrap.fill(headings, 100, initial_indent='  ', subsequent_indent='  ')}"


class Contents(TypedDict, total=False):
    """What a report can have besides the network and its motion.

    Args:
        signals: quantities to draw and to list; by default those of the scene, or the states.
        phases: combinations of modes whose equations are printed; by default those that last longest.
        at: the point about which frequencies are computed, as for `Network.modes`.
        speeds: (k,) rad/s, of a Campbell diagram.
        orders: its excitations per turn, by default 1, 2 and 3.
        sn: the S-N line of what is twisted, or one for each quantity.
        origins: where values come from, by part or by "part.parameter": a column of the table of values.
        assumptions: what was chosen and why, a sentence each.
        references: literature, a line each.
        comparison: of models of a shaft, from `studies.work_precision`.
        torsional: a torsional vibration calculation.
    """

    signals: Sequence[str]
    phases: Sequence[str]
    at: Point
    speeds: Sequence[float]
    orders: Sequence[float]
    sn: SNLine | Mapping[str, SNLine]
    origins: Mapping[str, str]
    assumptions: Sequence[str]
    references: Sequence[str]
    comparison: Any
    torsional: Any


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
    text: Mapping[str, str] | None = None,
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
        text: your own words in Markdown, by section; "introduction" and "conclusions" are sections of their own.
        sections: those wanted, by name; by default all that have anything to say.
        **contents: what else it has, see `Contents`.

    Raises:
        ParameterError: there is no such section.
        NetworkError, SimulationError: the network cannot be assembled, or its motion failed.
        MissingExtraError: matplotlib is not installed, or pandoc for words in Markdown.

    Examples:
        >>> import shaftwork as sw
        >>> sw.report(sw.scenes.SCENES["crane-start"], author="A. Engineer", sections=["parts", "extremes"])
        Report 'Crane travel drive, start and steady travel'
          Parts and values, Extremes
    """
    words, wanted = _checked(text or {}, sections)
    _refuse_wrong(contents)
    if solution is not None and t_end is not None:
        raise ParameterError("solution= and t_end= both say how long the motion is. Leave out one of them.")
    scene = subject if isinstance(subject, Scene) else None
    about = _subject(subject, solution, t_end, source, contents)
    headed = title if title is not None else scene.title if scene else about.network.name
    today = dt.datetime.now().astimezone().date().isoformat()
    return Report(
        title=headed[:1].upper() + headed[1:],
        author=author,
        date=date if date is not None else today,
        revision=revision,
        source=about.source,
        sections=tuple(_written(about, words, wanted)),
        figures=about.figures,
        curves=about.curves,
        solution=about.solution,
    )


def _subject(
    subject: Network | Scene, solution: Solution | None, t_end: float | None, source: str | None, contents: Contents
) -> Subject:
    """What the sections are written of; a scene says what the user does not."""
    scene = subject if isinstance(subject, Scene) else None
    network = subject() if isinstance(subject, Scene) else network_of(subject)
    end = t_end if t_end is not None else scene.t_end if scene else None
    _refuse_foreign(solution, network)
    motion = network.simulate(end) if solution is None and end is not None else solution
    origin = source if source is not None else scene.source if scene else ""
    _refuse_unknown(contents.get("origins", {}), network)
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


def _checked(words: Mapping[str, str], sections: Sequence[str] | None) -> tuple[Mapping[str, str], tuple[str, ...]]:
    """The user's words and the sections wanted.

    Raises:
        ParameterError: there is no such section.
    """
    names = (WORDS[0], *SECTIONS, WORDS[1])
    if isinstance(sections, str):
        raise ParameterError(f"sections = {sections!r} must be a list of names, such as [{sections!r}].")
    for name, said in words.items():
        if not isinstance(said, str):
            raise ParameterError(f"text: what is said to {name!r}, {said!r}, must be a text in Markdown.")
    for argument, chosen in (("text", words), ("sections", sections or ())):
        for name in chosen:
            if name not in names:
                raise ParameterError(f"{argument}: there is no section {name!r}. There are: {', '.join(names)}.")
    return words, tuple(SECTIONS if sections is None else sections)


def _refuse_wrong(contents: Contents) -> None:
    """Refuse what a report has not, and a text where a list is meant.

    Raises:
        ParameterError: it is so.
    """
    for name, value in contents.items():
        if name not in Contents.__annotations__:
            raise ParameterError(f"report: there is no {name!r}. There are: {', '.join(Contents.__annotations__)}.")
        if name in ("signals", "phases", "assumptions", "references") and isinstance(value, str):
            raise ParameterError(f"{name} = {value!r} must be a list of texts, such as [{value!r}].")


def _refuse_foreign(solution: Solution | None, network: Network) -> None:
    """Refuse the motion of another network.

    Raises:
        ParameterError: it has other parts, or other values of their parameters.
    """
    if solution is None:
        return
    there = {part.name: part.values for part in network.parts}
    named = {name.rpartition(".") for name in solution.parameters}
    strange = [part for part, _, _ in named if part not in there]
    other = [
        f"{part}.{name}"
        for part, _, name in named
        if isinstance(value := there.get(part, {}).get(name), float | int)
        and not isinstance(value, bool)
        and not math.isclose(value, solution.parameters[f"{part}.{name}"], rel_tol=TYPED)
    ]
    if strange or other:
        what = f"part '{strange[0]}'" if strange else f"'{min(other)}' has another value"
        raise ParameterError(
            f"solution is a motion of another network than '{network.name}': {what}. Give the network that it is of."
        )


def _refuse_unknown(origins: Mapping[str, str], network: Network) -> None:
    """Refuse an origin of a part or parameter that there is not.

    Raises:
        ParameterError: there is none of this name.
    """
    there = {part.name: [f"{part.name}.{name}" for name in part.declared] for part in network.parts}
    for name, origin in origins.items():
        if not isinstance(origin, str):
            raise ParameterError(f"origins: {origin!r}, where {name!r} comes from, must be a text.")
        if name not in there and all(name not in parameters for parameters in there.values()):
            near = there.get(name.rpartition(".")[0]) or list(there)
            raise ParameterError(f"origins: there is no part or parameter {name!r}. There are: {', '.join(near[:20])}.")


def _states(solution: Solution | None) -> tuple[str, ...]:
    """The first states that can be read; of none where there is no motion."""
    names = tuple(name for name in solution.states if name in solution) if solution else ()
    return names[:MOST_SIGNALS]


def _written(about: Subject, words: Mapping[str, str], wanted: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Headings and LaTeX of the sections that say anything."""
    introduction, conclusions = WORDS
    order = sorted(SECTIONS, key=lambda name: name == WRITTEN_LAST)
    written = {name: SECTIONS[name][1](about) if name in wanted else "" for name in order}
    said = {name: as_latex(text) for name, text in words.items()}
    if introduction in said:
        yield introduction.capitalize(), said[introduction]
    for name, (heading, _) in SECTIONS.items():
        if name == "nomenclature" and conclusions in said:
            yield conclusions.capitalize(), said[conclusions]
        if text := paragraphs(said.get(name, ""), written[name]):
            yield heading, text
    if about.notes and WRITTEN_LAST not in wanted:
        yield "Left out", listed(dict.fromkeys(about.notes))
