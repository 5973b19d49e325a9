"""`shaftwork latex`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import Command, Data, Say
from shaftwork.cli.models import load

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

FORMS = ("kirchhoff", "state", "second-order", "lagrange")


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--form", choices=FORMS, help="which equations (default: the first two)")
    parser.add_argument("--phase", metavar="WORDS", help="of one phase, such as 'gap open, load stuck'")
    parser.add_argument("--values", action="store_true", help="numbers instead of symbols")
    parser.add_argument("--document", action="store_true", help="a whole document that pdflatex compiles")


def run(options: Namespace, say: Say) -> Data:
    """The equations, or those of one phase, or of each phase that the source of a scene has equations for."""
    net, scene = load(options)
    if options.phase:
        say(_typeset(net.equations(phase=options.phase), options))
    elif options.document or not (scene and scene.phases):
        say(_typeset(net.equations(), options))
    else:
        for phase in scene.phases:
            say(rf"\section*{{{phase}}}")
            say(_typeset(net.equations(phase=phase), options))
    return {}


def _typeset(equations: Equations, options: Namespace) -> str:
    if options.form == "lagrange":
        from shaftwork.equations.lagrange import lagrangian

        made = lagrangian(equations)
        return made.document(values=options.values) if options.document else made.latex(values=options.values)
    if options.document:
        return equations.document(values=options.values)
    return equations.latex(form=options.form, values=options.values)


COMMAND = Command("latex", "print the equations as LaTeX", run, arguments)
