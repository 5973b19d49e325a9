"""Sections on the network: its drawing, parts, assumptions, equations, nomenclature and model file."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ModelFileError, NetworkError
from shaftwork.equations.spelling import in_text, without_marks
from shaftwork.latex.document import section as printed_section
from shaftwork.latex.nomenclature import breakable, condensed, laws, parameters, variables
from shaftwork.modelfiles.storage import netlist_text
from shaftwork.network.netlist import REFERENCE
from shaftwork.reporting.latex_parts import PAGE, columns, listed, number, paragraphs, picture
from shaftwork.reporting.subject import ReportSection, Subject

if TYPE_CHECKING:
    from shaftwork.drawing.canvas import Drawing
    from shaftwork.equations.records import Equations
    from shaftwork.latex.blocks import Block
    from shaftwork.pipeline.network import Network


def drawing(subject: Subject) -> ReportSection:
    """The drive train, its analogue circuit and, where there is one that can be read, the dual circuit."""
    if len(subject.network.parts) > PAGE.parts:
        return ReportSection(
            notes=(f"Drawings of more than {PAGE.parts} parts cannot be read on a page and are left out.",)
        )
    figures = {"train": _on_a_page(subject.network), "circuit": _on_a_page(subject.network, as_circuit=True)}
    analogy = (
        "In the analogue circuit speed is voltage and torque is current: an inertia is a capacitor, a compliance an "
        "inductor, a damper a resistor."
    )
    text = paragraphs(
        picture("train", "Drive train"), in_text(analogy), picture("circuit", "Analogue circuit (speed as voltage)")
    )
    try:
        dual = subject.network.dual()
    except NetworkError as reason:
        why = str(reason.problems[0]) if reason.problems else str(reason)
        return ReportSection(text, figures, notes=(f"The dual circuit is left out, as there is none: {why}",))
    if len(dual.parts) > PAGE.parts:
        return ReportSection(text, figures)
    figures["dual"] = _on_a_page(subject.network, as_circuit=True, analogy="force-voltage")
    words = in_text("In the dual circuit torque is voltage and speed is current: an inertia is an inductor.")
    return ReportSection(paragraphs(text, words, picture("dual", "Dual circuit (torque as voltage)")), figures)


def _on_a_page(network: Network, **form: Any) -> Drawing:
    """A drawing whose rows are as long as it needs to be no higher than a page, with the largest letters possible."""
    for width in (680.0, 900.0, 1200.0, 1600.0):
        drawing = network.draw(width=width, **form)
        left, bottom, right, top = drawing.size
        if top - bottom <= 1.2 * (right - left):
            break
    return drawing


def parts(subject: Subject) -> ReportSection:
    """The parts with their nodes, then the values of their parameters, the laws and the records that are given."""
    rows = (
        (
            breakable(placed.part.name),
            breakable(type(placed.part).__name__),
            ", ".join(breakable("frame" if node == REFERENCE else node) for node in placed.nodes),
        )
        for placed in subject.network.netlist().placed
    )
    text = paragraphs(
        columns(("Part", "Kind", "At the nodes"), rows, (3, 3, 5)),
        parameters(subject.equations, subject.origins, [blocks.used for blocks, _ in subject.printed]),
        laws(subject.equations[0], subject.origins),
        *_records(subject),
    )
    return ReportSection(text)


def _records(subject: Subject) -> Iterator[str]:
    """Tables of what parts have as records, such as the orders of a torque; those of like parts once."""
    owners: dict[tuple[str, Any], list[str]] = {}
    for part in subject.network.parts:
        for name, declared in part.declared.items():
            record = getattr(part, name)
            # models of shafts are among the assumptions
            if declared.record is not None and is_dataclass(record) and not isinstance(part, Shaft):
                owners.setdefault((declared.meaning, record), []).append(part.name)
    for (meaning, record), names in owners.items():
        values = {field.name: getattr(record, field.name) for field in fields(record)}
        lists = {name: value for name, value in values.items() if isinstance(value, tuple) and value}
        scalars = [f"{name} = {value:.6g}" for name, value in values.items() if isinstance(value, float) and value]
        said = f"{meaning.capitalize()} of {', '.join(names)}"
        yield in_text(f"{said}{': ' if scalars else ''}{', '.join(scalars)}.")
        heads = [in_text(name.capitalize()) for name in lists]
        if len({len(value) for value in lists.values()}) == 1 and all(map(_plain, lists.values())):
            rows = [[number(value, 6) for value in row] for row in zip(*lists.values(), strict=True)]
            yield columns(heads, rows, (1,) * len(lists))
        elif lists:
            rows = [[in_text(name), in_text(str(value))] for name, value in lists.items()]
            yield columns(("Values", ""), rows, (1, 6))


def _plain(values: Sequence[object]) -> bool:
    """Whether these are numbers, and not rows of them."""
    return all(isinstance(value, float) for value in values)


def assumptions(subject: Subject, notes: Sequence[str]) -> ReportSection:
    """What was chosen, what the equations leave out, how long shafts are divided, and what could not be computed."""
    shafts = (part for part in subject.network.parts if isinstance(part, Shaft))
    models = (f"The shaft {shaft.name} is modelled as {shaft.model!r}." for shaft in shafts)
    left_out = dict.fromkeys(note for equations in subject.equations for note in equations.notes)
    return ReportSection(listed((*subject.assumptions, *models, *left_out, *dict.fromkeys(notes))))


def equations(subject: Subject) -> ReportSection:
    """Kirchhoff's equations and the state form, phase by phase; laws stand once, where they first hold."""
    printed: set[tuple[str, str]] = set()
    texts = [_of_phase(blocks.equations, new, printed) for blocks, new in subject.printed]
    several = len(subject.printed_phases) < len(subject.durations)
    said = [
        f"The motion has {len(subject.durations)} combinations of modes; those that last longest are printed."
        if several and not subject.phases
        else "",
        "A later phase has those equations only that are new in it, and its states; the other equations of its "
        "states and parts are those above."
        if len(texts) > 1
        else "",
    ]
    return ReportSection(paragraphs(in_text(" ".join(filter(None, said))), *texts))


def _of_phase(equations: Equations, blocks: tuple[Block, ...], printed: set[tuple[str, str]]) -> str:
    blocks = tuple(_new(blocks, printed))
    if not equations.phase:
        return printed_section(blocks)
    names = condensed([(f"${equations.symbol_names[state.name]}$",) for state in equations.form.states])
    states = ", ".join(name for (name,) in names) or "none"
    title = f"\\subsection{{{in_text(equations.phase)}}}"
    return paragraphs(title, without_marks(f"States: {states}."), printed_section(blocks))


def _new(blocks: tuple[Block, ...], printed: set[tuple[str, str]]) -> Iterator[Block]:
    """Blocks with those lines alone that no earlier phase has; what is printed now is entered there."""
    for block in blocks:
        lines = tuple(line for line in block.lines if (block.heading, line.text) not in printed)
        printed.update((block.heading, line.text) for line in lines)
        if lines:
            yield replace(block, lines=lines)


def nomenclature(subject: Subject) -> ReportSection:
    """The variables of all printed equations with their units."""
    states = {state.name: "state" for equations in subject.equations for state in equations.form.states}
    used = {*(name for blocks, _ in subject.printed for name in blocks.used), *states}
    helpers = tuple(row for blocks, _ in subject.printed for row in blocks.helpers())
    return ReportSection(variables(subject.equations, used, states, helpers=helpers))


def model_file(subject: Subject) -> ReportSection:
    """The network as a model file, from which the calculation can be repeated."""
    try:
        text = netlist_text(subject.network.netlist())
    except ModelFileError as reason:
        return ReportSection(notes=(f"There is no model file: {reason}",))
    lines = [line for line in text.splitlines() if line]
    wrapped = [piece for line in lines for piece in textwrap.wrap(line, PAGE.letters, break_on_hyphens=False)]
    said = "Lines that are too long for the page are wrapped." if len(wrapped) > len(lines) else ""
    body = "\n".join(wrapped).replace(r"\end{verbatim}", "\\end\n{verbatim}")  # a name may hold it
    verbatim = f"\\begingroup\\footnotesize\n\\begin{{verbatim}}\n{body}\n\\end{{verbatim}}\n\\endgroup"
    return ReportSection(paragraphs(said, verbatim))
