"""The commands that simulate nothing: `shaftwork scenes`, `check`, `latex` and `export`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import Data, Say, command, load

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

FORMS = ("kirchhoff", "state", "second-order", "lagrange", "field")


@command("the ready scenes, a line each with the source", model=False, machines=True)
def scenes(_: Namespace, say: Say) -> Data:
    """The ready scenes, a line each."""
    from shaftwork.scenes import SCENES

    width = max(len(name) for name in SCENES)
    for scene in SCENES.values():
        say(f"{scene.name:{width}}  {scene.title} ({scene.source})")
    fields = ("name", "title", "source", "t_end", "signals", "chosen", "phases")
    return {"scenes": [{field: getattr(scene, field) for field in fields} for scene in SCENES.values()]}


@command("structure, states, time constants, stiffness, chosen engine", machines=True)
def check(options: Namespace, say: Say) -> Data:
    """What can be said of a network before anything is simulated."""
    from shaftwork.cli.check_report import structure_report
    from shaftwork.pipeline.arguments import FALLBACK_END

    net, scene = load(options)
    model, t_end = net.compile(), scene.t_end if scene else FALLBACK_END
    say(structure_report(net, model, t_end))
    engine, why = model.choose_engine(t_end)
    return {
        "network": net.name,
        "parts": len(model.form.graph.parts),
        "nodes": len(model.form.graph.nodes),
        "states": model.states,
        "problems": [{"severity": problem.severity, "text": str(problem)} for problem in net.check()],
        "engine": engine,
        "why": why,
    }


def latex_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork latex`."""
    parser.add_argument("--form", choices=FORMS, help="which equations (default: the first two)")
    parser.add_argument("--phase", metavar="WORDS", help="of one phase, such as 'gap open, load stuck'")
    parser.add_argument("--notation", metavar="NAME", help="letters of popenda, marinkovic or modelica")
    parser.add_argument("--values", action="store_true", help="numbers instead of symbols")
    parser.add_argument("--document", action="store_true", help="a whole document that pdflatex compiles")


@command("print the equations as LaTeX", latex_options)
def latex(options: Namespace, say: Say) -> Data:
    """The equations of a phase: of those that the source of a scene has, or of the one in which the motion begins."""
    from shaftwork.equations.spelling import in_text
    from shaftwork.latex.document import joined

    net, scene = load(options)
    phases = (options.phase,) if options.phase else (scene.phases if scene else ()) or (net.start_phase(),)
    title = scene.title if scene else net.name
    texts = [_typeset(net.equations(phase=phase or None), options, title) for phase in phases]
    if options.document:
        say(joined(texts))
        return {}
    for phase, text in zip(phases, texts, strict=True):
        if len(phases) > 1:
            say(rf"\section*{{{in_text(phase)}}}")
        say(text)
    return {}


def _typeset(equations: Equations, options: Namespace, title: str) -> str:
    equations = equations.written_as(options.notation)
    values, whole = options.values, options.document
    if options.form == "lagrange":
        from shaftwork.lagrange.lagrange import lagrangian

        lagrange = lagrangian(equations)
        return lagrange.document(values=values, title=title) if whole else lagrange.latex(values=values)
    form = options.form
    return equations.document(form, values=values, title=title) if whole else equations.latex(form, values=values)
