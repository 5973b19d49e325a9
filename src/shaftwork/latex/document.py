"""The equations as LaTeX: the body for a report or a notebook, and a complete document with units and nomenclature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, get_args

from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError, ShaftworkError
from shaftwork.equations.quantities import INSTEAD
from shaftwork.equations.spelling import in_notebook, in_text, stand_ins, without_marks
from shaftwork.latex.blocks import Block, Blocks
from shaftwork.latex.nomenclature import nomenclature
from shaftwork.latex.printing import aligned
from shaftwork.latex.second_order_blocks import SecondOrderBlocks
from shaftwork.latex.series import shortened

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

Form = Literal["kirchhoff", "state", "second-order", "field"]
PREAMBLE = r"""\documentclass[11pt,a4paper]{article}
\usepackage[utf8]{inputenc}
\usepackage[T1]{fontenc}
\usepackage[margin=25mm]{geometry}
\usepackage{amsmath}
\usepackage{array}
\usepackage{booktabs}
\usepackage{longtable}
\allowdisplaybreaks"""
TITLES = {
    "kirchhoff": "Kirchhoff's equations",
    "state": "State form",
    "second-order": "Second-order form",
    "field": "Along the shafts",
}
BEGIN = r"""\date{}
\begin{document}
\sloppy
\maketitle"""


def typeset(equations: Equations, blocks: Iterable[Block]) -> str:
    """Blocks for a document, below the phase for which they hold."""
    return "\n".join(("\\allowdisplaybreaks", *_phase(equations), *map(_paragraph, blocks)))


def _phase(equations: Equations) -> tuple[str, ...]:
    """The modes for which the equations hold, under a heading; nothing where no part changes its mode."""
    return (f"\\paragraph{{Phase}}\\mbox{{}}\n{in_text(equations.phase)}",) if equations.phase else ()


def _paragraph(block: Block) -> str:
    return f"\\paragraph{{{in_text(block.heading)}}}\\mbox{{}}\n{_content(block)}"


def rendered(equations: Equations, blocks: Iterable[Block]) -> str:
    """Blocks for a notebook, below the phase for which they hold."""
    phase = (f"$\\textbf{{Phase}}$ {in_notebook(equations.phase)}\n",) if equations.phase else ()
    shown = (f"$\\textbf{{{in_notebook(block.heading)}}}$\n{_content(block)}" for block in blocks)
    return "\n".join((*phase, *shown))


def blocks_of(equations: Equations, form: Form | None, *, values: bool) -> tuple[Block, ...]:
    """The blocks that say anything: of one form, or of Kirchhoff's equations and the state form.

    Raises:
        ShaftworkError: there is no such form.
    """
    return printed_blocks(Blocks(equations, values), form)


def printed_blocks(blocks: Blocks, form: Form | None) -> tuple[Block, ...]:
    """The same of blocks that know afterwards which letters have been printed.

    Raises:
        ShaftworkError: there is no such form.
    """
    both = (*blocks.kirchhoff(twists=False), *blocks.state(laws=False)) if form is None else _form(blocks, form)
    derived = () if form == "field" else (blocks.derived(), blocks.orders())
    return tuple(block for block in (*both, *derived) if block.lines)


def _form(blocks: Blocks, form: Form) -> Iterable[Block]:
    """The blocks of one form, without the derived quantities.

    Raises:
        ShaftworkError: there is no such form.
    """
    match form:
        case "kirchhoff":
            return blocks.kirchhoff()
        case "state":
            return blocks.state()
        case "second-order":
            return SecondOrderBlocks(blocks).printed()
        case "field":
            return blocks.fields()
    *names, last = map(repr, get_args(Form))
    raise ShaftworkError(f"There is no form {form!r}; take {', '.join(names)} or {last}.")


def _content(block: Block) -> str:
    remark = f"{block.remark}\n" if block.remark else ""
    rows = without_marks(aligned(shortened(block.lines)))
    return f"{remark}\\begin{{align*}}\n{rows}\n\\end{{align*}}"


def document(equations: Equations, form: Form | None, *, values: bool, title: str | None) -> str:
    """A LaTeX document that compiles as it is, of one form or of all.

    Raises:
        ShaftworkError: there is no such form.
        CompileError: the one form that is asked for does not exist for this network.
    """
    blocks = Blocks(equations, values)
    motions = SecondOrderBlocks(blocks)
    states = {state.name: "state" for state in equations.form.states}
    remarks: tuple[str, ...] = ()
    if form is None:
        sections = {
            TITLES["kirchhoff"]: section((*blocks.kirchhoff(twists=False), blocks.derived(), blocks.orders())),
            TITLES["state"]: section(blocks.state(laws=False)),
        }
        try:
            sections[TITLES["second-order"]] = section(motions.printed())
        except CompileError as reason:
            electrical = ELECTRICAL in equations.form.graph.domains
            why = "the network has electrical nodes." if electrical else str(reason).removesuffix(INSTEAD)
            remarks = (f"There is no second-order form: {why}",)
    else:
        printed = printed_blocks(blocks, form)
        sections = {TITLES[form]: section(printed)}
    matrices = motions.helpers() if TITLES["second-order"] in sections else ()
    helpers = (*blocks.helpers(), *matrices)
    sections["Nomenclature"] = nomenclature(equations, {*blocks.used, *states}, states, helpers=helpers)
    return in_sections(equations, sections, title, remarks)


def joined(documents: Sequence[str]) -> str:
    """One document of several, such as of all phases of a motion, each from a new page on.

    Args:
        documents: complete ones of the same network, at least one.
    """
    end = "\\end{document}\n"
    head, begin, _ = documents[0].partition(BEGIN)
    bodies = "\\clearpage".join(text.partition(BEGIN)[2].removesuffix(end) for text in documents)
    letters = stand_ins("".join(letter for letter in dict.fromkeys(bodies) if letter not in documents[0]))
    return f"{head}{letters}{begin}{bodies}{end}"


def in_sections(
    equations: Equations, sections: Mapping[str, str], title: str | None, remarks: Sequence[str] = ()
) -> str:
    """A LaTeX document of sections that say anything, after the phase and before remarks.

    Args:
        equations: whose phase and notes are printed.
        sections: LaTeX by heading.
        title: of the document; by default the name of the network.
        remarks: sentences before the notes of the equations.
    """
    notes = "\n\n".join(map(in_text, (*remarks, *equations.notes)))
    whole = {"Phase": in_text(equations.phase), **sections, "Remarks": notes}
    printed = "\n".join(f"\\section{{{heading}}}\n{text}" for heading, text in whole.items() if text)
    head = f"\\title{{{in_text(title or equations.form.graph.name)}}}"
    return f"{PREAMBLE}\n{stand_ins(head + printed)}{head}\n{BEGIN}\n{printed}\n\\end{{document}}\n"


def section(blocks: Iterable[Block]) -> str:
    """Blocks that say anything, each under a paragraph heading."""
    return "\n".join(_paragraph(block) for block in blocks if block.lines)
