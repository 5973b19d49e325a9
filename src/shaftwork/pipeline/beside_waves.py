"""Parts that change their mode beside shafts of travelling waves, which follow no modes: one law for all of them."""

from __future__ import annotations

from shaftwork.components.friction import ROUNDED
from shaftwork.components.modes import ALL_IN_ONE
from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.network.graph import CircuitGraph, GraphPart, build_graph
from shaftwork.network.netlist import Netlist
from shaftwork.network.wording import listed, title

REMEDY = "Take another model of the shaft, such as Lumped(20) or Spectral(8)"


def with_one_law(netlist: Netlist, graph: CircuitGraph) -> Netlist:
    """The network with the laws of all modes in one, for the parts that have several and of which none is chosen.

    Raises:
        ParameterError: what a part does in its modes cannot be one law: a freewheel, a rigid gap.
    """
    free = {item.part.name for item in netlist.placed if not item.choices}
    modal = [part.name for part in graph.parts if part.modes and part.name in free]
    made = netlist.with_choices(dict.fromkeys(modal, ALL_IN_ONE))
    for part in build_graph(made).parts if modal else ():
        if part.name in free and _joins(part, rubs=False) and not part.branches:
            raise ParameterError(
                f"{title(part.component)} changes its mode, which travelling waves do not follow. {REMEDY}."
            )
    return made


def warn_of_rounding(graph: CircuitGraph) -> None:
    """Say which parts do not stick, as they would without travelling waves."""
    if names := [part.name for part in graph.parts if part.branches and _joins(part, rubs=True)]:
        warn(
            f"'{graph.name}': beside travelling waves ({listed(waving(graph))}) nothing sticks; the friction of "
            f"{listed(names)} is rounded over {ROUNDED:g} rad/s. {REMEDY}, where that matters.",
            AccuracyWarning,
        )


def waving(graph: CircuitGraph) -> tuple[str, ...]:
    """Names of the parts that waves travel along."""
    histories = (branch.index for branch in graph.branches if branch.template.is_history)
    return tuple(dict.fromkeys(graph.part_of(index).name for index in histories))


def _joins(part: GraphPart, *, rubs: bool) -> bool:
    """Whether a part joins its nodes in a mode: as friction does, which gives way to both sides, or otherwise."""
    options = (mode for modes in part.modes for mode in modes.options if mode.form != modes.options[0].form)
    return any((len(mode.gives_way) == 2) is rubs for mode in options)
