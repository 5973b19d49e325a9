"""The equations as LaTeX: the body for a report or a notebook, and a complete document with units and nomenclature."""

from __future__ import annotations

from shaftwork.core.errors import ShaftworkError
from shaftwork.equations.blocks import Block, Blocks
from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS
from shaftwork.equations.printing import aligned
from shaftwork.equations.records import Equations, Form
from shaftwork.equations.series import shortened


def body(equations: Equations, form: Form | None = None, *, values: bool = False) -> str:
    """The blocks of one form, or of Kirchhoff's equations and the state form, each under a paragraph heading."""
    blocks = blocks_of(equations, form, values=values)
    return "\n".join(f"\\paragraph{{{block.heading}}}\\mbox{{}}\n{_content(block)}" for block in blocks)


def notebook(equations: Equations) -> str:
    """The body with headings that a notebook renders."""
    blocks = blocks_of(equations, None, values=False)
    return "\n".join(f"$\\textbf{{{block.heading}}}$\n{_content(block)}" for block in blocks)


def blocks_of(equations: Equations, form: Form | None, *, values: bool) -> tuple[Block, ...]:
    """The blocks of a form of the equations that say anything.

    Raises:
        ShaftworkError: there is no such form.
    """
    blocks = Blocks(equations, values)
    match form:
        case "kirchhoff":
            made = tuple(blocks.kirchhoff())
        case "state":
            made = tuple(blocks.state())
        case "second-order":
            made = tuple(blocks.second_order())
        case None:
            made = (*blocks.kirchhoff(), *blocks.state())
        case _:
            raise ShaftworkError(f"There is no form {form!r}; take 'kirchhoff', 'state' or 'second-order'.")
    return tuple(block for block in made if block.lines)


def _content(block: Block) -> str:
    remark = f"{block.remark}\n" if block.remark else ""
    rows = aligned(shortened(block.lines)).replace(INDEX_OPENS, "").replace(INDEX_CLOSES, "")
    return f"{remark}\\begin{{align*}}\n{rows}\n\\end{{align*}}"
