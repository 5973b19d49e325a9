"""`shaftwork check`."""

from __future__ import annotations

from argparse import Namespace

from shaftwork.cli.command import FALLBACK_END, Command, Data, Say
from shaftwork.cli.models import load


def run(options: Namespace, say: Say) -> Data:
    """What can be said of a network before anything is simulated."""
    from shaftwork.pipeline.report import structure_report

    net, scene = load(options)
    say(structure_report(net, scene.t_end if scene else FALLBACK_END))
    return {}


COMMAND = Command("check", "structure, states, time constants, stiffness, and the engine that auto would take", run)
