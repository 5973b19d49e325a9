"""Sections on the network: its drawing, parts, assumptions, equations, nomenclature and model file."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ModelFileError
from shaftwork.equations.spelling import in_text, without_marks
from shaftwork.latex.document import section
from shaftwork.latex.nomenclature import breakable, condensed, laws, parameters, variables
from shaftwork.modelfiles.storage import netlist_text
from shaftwork.network.netlist import REFERENCE
from shaftwork.reporting.latex_parts import columns, listed, paragraphs, picture

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations
    from shaftwork.latex.blocks import Block
    from shaftwork.reporting.subject import Subject

COLUMNS = 82
"""Letters of a line of the model file, which a page has room for."""
MOST_DRAWN = 60
"""Parts up to which a drawing can be read on a page."""


def drawing(subject: Subject) -> str:
    """The drive train and its analogue circuit."""
    if len(subject.network.parts) > MOST_DRAWN:
        subject.notes.append(f"Drawings of more than {MOST_DRAWN} parts cannot be read on a page and are left out.")
        return ""
    subject.figures["train"] = subject.network.draw()
    subject.figures["circuit"] = subject.network.draw(as_circuit=True)
    analogy = (
        "In the analogue circuit speed is voltage and torque is current: an inertia is a capacitor, a compliance an "
        "inductor, a damper a resistor."
    )
    return paragraphs(
        picture("train", "Drive train"), in_text(analogy), picture("circuit", "Analogue circuit (speed as voltage)")
    )


def parts(subject: Subject) -> str:
    """The parts with their nodes, then the values of their parameters, then the laws that are given."""
    rows = (
        (
            breakable(placed.part.name),
            breakable(type(placed.part).__name__),
            ", ".join(breakable("frame" if node == REFERENCE else node) for node in placed.nodes),
        )
        for placed in subject.network.netlist().placed
    )
    equations = subject.equations[0]
    return paragraphs(
        columns(("Part", "Kind", "At the nodes"), rows, (3, 3, 5)),
        parameters(equations, subject.origins),
        laws(equations),
    )


def assumptions(subject: Subject) -> str:
    """What was chosen, what the equations leave out, and how long shafts are divided."""
    shafts = (part for part in subject.network.parts if isinstance(part, Shaft))
    models = (f"The shaft {shaft.name} is modelled as {shaft.model!r}." for shaft in shafts)
    left_out = dict.fromkeys(note for equations in subject.equations for note in equations.notes)
    return listed((*subject.assumptions, *models, *left_out, *dict.fromkeys(subject.notes)))


def equations(subject: Subject) -> str:
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
    return paragraphs(in_text(" ".join(filter(None, said))), *texts)


def _of_phase(equations: Equations, blocks: tuple[Block, ...], printed: set[tuple[str, str]]) -> str:
    blocks = tuple(_new(blocks, printed))
    if not equations.phase:
        return section(blocks)
    names = condensed([(f"${equations.symbol_names[state.name]}$",) for state in equations.form.states])
    states = ", ".join(name for (name,) in names) or "none"
    title = f"\\subsection{{{in_text(equations.phase)}}}"
    return paragraphs(title, without_marks(f"States: {states}."), section(blocks))


def _new(blocks: tuple[Block, ...], printed: set[tuple[str, str]]) -> Iterator[Block]:
    """Blocks with those lines alone that no earlier phase has; what is printed now is entered there."""
    for block in blocks:
        lines = tuple(line for line in block.lines if (block.heading, line.text) not in printed)
        printed.update((block.heading, line.text) for line in lines)
        if lines:
            yield replace(block, lines=lines)


def nomenclature(subject: Subject) -> str:
    """The variables of all printed equations with their units."""
    states = {state.name: "state" for equations in subject.equations for state in equations.form.states}
    used = {*(name for blocks, _ in subject.printed for name in blocks.used), *states}
    helpers = tuple(row for blocks, _ in subject.printed for row in blocks.helpers())
    return variables(subject.equations, used, states, helpers=helpers)


def model_file(subject: Subject) -> str:
    """The network as a model file, from which the calculation can be repeated."""
    try:
        text = netlist_text(subject.network.netlist())
    except ModelFileError as reason:
        subject.notes.append(f"There is no model file: {reason}")
        return ""
    lines = [part for line in text.rstrip().splitlines() for part in textwrap.wrap(line, COLUMNS) or [""]]
    said = "" if len(lines) == len(text.rstrip().splitlines()) else "Lines that are too long for the page are wrapped."
    body = "\n".join(lines)
    return paragraphs(said, f"\\begin{{verbatim}}\n{body}\n\\end{{verbatim}}")
