"""The names of all quantities of a network that can be read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from shaftwork.components.base import Signal
from shaftwork.core.domains import ROTATION
from shaftwork.network.graph import GROUND, GraphPart, signals_of
from shaftwork.reduction.form import StateForm


class Names:
    """The names of all quantities of a model; made once for all motions in the same equations.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self._form, self._graph = form, form.graph

    @cached_property
    def signals(self) -> dict[str, tuple[GraphPart, Signal]]:
        """Signals of parts."""
        parts = self._graph.parts
        return {f"{p.name}.{name}": (p, made) for p in parts for name, made in signals_of(self._graph, p).items()}

    @cached_property
    def integrals(self) -> dict[str, int]:
        """States that are integrals, by number."""
        return {state.name: k for k, state in enumerate(self._form.states) if state.kind == "integral"}

    @cached_property
    def nodes(self) -> dict[str, int]:
        """Speeds of nodes and the like, by number of the node."""
        pairs = zip(self._graph.nodes, self._graph.domains, strict=True)
        return {f"{name}.{domain.across.name}": k for k, (name, domain) in enumerate(pairs)}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit; where a part and a node share a name, the part's is meant."""
        units = {f"{name}": domain.across.unit for name, domain in zip(self.nodes, self._graph.domains, strict=True)}
        units |= {name: _unit(signal) for name, (_, signal) in self.signals.items()}
        units |= {s.name: s.unit for s in self._form.states if s.kind == "integral"}
        units |= {f"{part.name}.power": "W" for part in self._graph.parts}
        return units | {f"{part.name}.energy": "J" for part in self._graph.parts}

    @property
    def wiring(self) -> Mapping[str, str]:
        """See `CircuitGraph.wiring`."""
        return self._graph.wiring

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """Names of the nodes that a signal of a part or the speed of a node is of, the reference not among them."""
        if name not in self.signals:
            return (self._graph.node_name(self.nodes[name]),) if name in self.nodes else ()
        part, signal = self.signals[name]
        numbers = (part.nodes[end] for end in signal.ends if end is not None)
        return tuple(self._graph.node_name(number) for number in numbers if number != GROUND)


def _unit(signal: Signal) -> str:
    domain = signal.domain or ROTATION
    quantity = {"across": domain.across, "twist": domain.integral}.get(signal.kind, domain.through)
    return quantity.unit
