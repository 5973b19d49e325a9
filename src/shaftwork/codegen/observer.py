"""The names of all quantities of a compiled model, and their values along a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.recovery import History, signals_of
from shaftwork.components.base import Signal
from shaftwork.core.domains import ROTATION
from shaftwork.core.times import just_after, just_before
from shaftwork.network.graph import CircuitGraph, GraphPart
from shaftwork.reduction.form import StateForm


class ModelObserver:
    """Recovers every quantity of a network from its states.

    Args:
        form: the state form.
        bind: makes the array program with the parameter vector of the run; called when a quantity is first read.
        jumps: times at which inputs jump: there they are read after the jump, as the states are, and where a time is
            listed twice in a row, first before it.
    """

    def __init__(self, form: StateForm, bind: Callable[[], BoundArrays], jumps: Sequence[float] = ()) -> None:
        self._form, self._bind, self._jumps = form, bind, np.asarray(jumps, dtype=float)
        self._graph: CircuitGraph = form.graph
        self._last: tuple[tuple[int, int], History] | None = None

    @cached_property
    def _signals(self) -> dict[str, tuple[GraphPart, Signal]]:
        parts = self._graph.parts
        return {f"{p.name}.{name}": (p, made) for p in parts for name, made in signals_of(self._graph, p).items()}

    @cached_property
    def _integrals(self) -> dict[str, int]:
        return {state.name: k for k, state in enumerate(self._form.states) if state.kind == "integral"}

    @cached_property
    def _nodes(self) -> dict[str, int]:
        pairs = zip(self._graph.nodes, self._graph.domains, strict=True)
        return {f"{name}.{domain.across.name}": k for k, (name, domain) in enumerate(pairs)}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit; where a part and a node share a name, the part's is meant."""
        units = {f"{name}": domain.across.unit for name, domain in zip(self._nodes, self._graph.domains, strict=True)}
        units |= {name: _unit(signal) for name, (_, signal) in self._signals.items()}
        units |= {s.name: s.unit for s in self._form.states if s.kind == "integral"}
        units |= {f"{part.name}.power": "W" for part in self._graph.parts}
        return units | {f"{part.name}.energy": "J" for part in self._graph.parts}

    def history(self, t: Array, x: Array) -> History:
        """All branch quantities along a trajectory; the last one asked for is kept."""
        key = (id(t), id(x))
        if self._last is None or self._last[0] != key:
            self._last = (key, History(self._bind(), self._one_sided(t), x))
        return self._last[1]

    def signal(self, name: str, t: Array, x: Array) -> Array:
        """(k,) a quantity by its name in `units`."""
        history = self.history(t, x)
        if name in self._signals:
            return history.signal(*self._signals[name])
        if name in self._integrals:
            return np.asarray(x[:, self._integrals[name]])
        if name in self._nodes:
            return np.asarray(history.potentials[self._nodes[name]])
        owner, quantity = name.rsplit(".", 1)
        part = next(part for part in self._graph.parts if part.name == owner)
        return history.absorbed(part) if quantity == "power" else history.stored(part)

    def _one_sided(self, t: Array) -> Array:
        """The times, moved by some rounding units to one side of a jump."""
        if not self._jumps.size:
            return t
        at = np.flatnonzero(np.isin(t, self._jumps))
        moved = t.copy()
        for k in at:
            first_of_two = k + 1 < len(t) and t[k + 1] == t[k]
            moved[k] = just_before(float(t[k])) if first_of_two else just_after(float(t[k]))
        return moved

    def powers(self, t: Array, x: Array) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
        """Stored energy, lost power and supplied power by part."""
        history = History(self._bind(), t, x)
        parts = self._graph.parts
        stored = {part.name: history.stored(part) for part in parts if part.component.role != "source"}
        lost = {part.name: history.lost(part) for part in parts if part.component.role != "source"}
        supplied = {part.name: -history.lost(part) for part in parts if part.component.role == "source"}
        return stored, lost, supplied


def _unit(signal: Signal) -> str:
    domain = signal.domain or ROTATION
    quantity = {"across": domain.across, "twist": domain.integral}.get(signal.kind, domain.through)
    return quantity.unit
