"""`shaftwork latex`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import Command, Data, Say
from shaftwork.cli.models import load

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

FORMS = ("kirchhoff", "state", "second-order", "lagrange", "field")


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--form", choices=FORMS, help="which equations (default: the first two)")
    parser.add_argument("--phase", metavar="WORDS", help="of one phase, such as 'gap open, load stuck'")
    parser.add_argument("--notation", metavar="NAME", help="letters of popenda, marinkovic or modelica")
    parser.add_argument("--values", action="store_true", help="numbers instead of symbols")
    parser.add_argument("--document", action="store_true", help="a whole document that pdflatex compiles")


def run(options: Namespace, say: Say) -> Data:
    """The equations of a phase: of those that the source of a scene has, or of the one in which the motion begins."""
    from shaftwork.equations.report import joined

    net, scene = load(options)
    phases = (options.phase,) if options.phase else (scene.phases if scene else ()) or (net.start_phase(),)
    texts = [_typeset(net.equations(phase=phase or None), options) for phase in phases]
    if options.document:
        say(joined(texts))
        return {}
    for phase, text in zip(phases, texts, strict=True):
        if len(phases) > 1:
            say(rf"\section*{{{phase}}}")
        say(text)
    return {}


def _typeset(equations: Equations, options: Namespace) -> str:
    equations = equations.written_as(options.notation)
    if options.form == "lagrange":
        from shaftwork.equations.lagrange import lagrangian

        made = lagrangian(equations)
        return made.document(values=options.values) if options.document else made.latex(values=options.values)
    typeset = equations.document if options.document else equations.latex
    return typeset(options.form, values=options.values)


COMMAND = Command("latex", "print the equations as LaTeX", run, arguments)
