"""`shaftwork check`."""

from __future__ import annotations

from argparse import Namespace

from shaftwork.cli.command import FALLBACK_END, Command, Data, Say
from shaftwork.cli.models import load


def run(options: Namespace, say: Say) -> Data:
    """What can be said of a network before anything is simulated."""
    from shaftwork.pipeline.report import structure_report

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


COMMAND = Command(
    "check", "structure, states, time constants, stiffness, and the engine that auto would take", run, machines=True
)
