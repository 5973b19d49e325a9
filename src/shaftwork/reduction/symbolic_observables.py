"""What parts, nodes and stores show, as expressions in states, parameters and time: the names of `ModelObserver`."""

from __future__ import annotations

from functools import cached_property

from sympy import Expr, Symbol

from shaftwork.components.base import Signal
from shaftwork.network.graph import GROUND, GraphPart, signals_of
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import StateForm, store_name
from shaftwork.reduction.observables import Observables
from shaftwork.reduction.rows import Rows


class SymbolicObservables:
    """Quantities of a network by name, each in the symbols of its rows.

    Args:
        form: the state form.
        rows: its explicit rows.
    """

    def __init__(self, form: StateForm, rows: Rows) -> None:
        self._form, self._graph, self._readings = form, form.graph, Observables(form, rows)

    def quantity(self, name: str) -> Expr | None:
        """A quantity such as "shaft.tau"; None for an energy, a power or what does not exist."""
        owner, _, quantity = name.rpartition(".")
        part = next((part for part in self._graph.parts if part.name == owner), None)
        if part is not None and (signal := signals_of(self._graph, part).get(quantity)) is not None:
            return signal.sign * self._signal(part, signal)
        if any(state.name == name and state.kind == "integral" for state in self._form.states):
            return Symbol(name, real=True)
        return self._nodes.get(name)

    def store(self, name: str) -> Expr:
        """What is stored, by the name of its state, whether it is one or not."""
        if any(state.name == name for state in self._form.states):
            return Symbol(name, real=True)
        branch = next(
            made for made in self._graph.branches if self._is_store(made.index) and self._name(made.index) == name
        )
        if branch.template.kind is Kind.THROUGH_STORE:
            return self._readings.through(branch.index)
        part, (plus, minus) = self._graph.parts[branch.part], branch.template.ends
        return self._readings.across(part, plus) - self._readings.across(part, minus)

    def _is_store(self, branch: int) -> bool:
        return self._graph.branches[branch].template.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE)

    def _name(self, branch: int) -> str:
        return store_name(self._graph, self._graph.branches[branch])

    def _signal(self, part: GraphPart, signal: Signal) -> Expr:
        if signal.kind == "across":
            return self._readings.across(part, signal.ends[0]) - self._readings.across(part, signal.ends[1])
        if signal.kind == "through":
            return self._readings.into(part, signal.ends[0])
        stores = (self._graph.branches[k] for k in part.branches)
        store = next(
            made
            for made in stores
            if made.template.kind is Kind.THROUGH_STORE and signal.label in ("", made.template.label)
        )
        through = self._readings.through(store.index)
        if signal.kind == "store":
            return through
        return through / self._graph.in_network_symbols(store.template.law, store)

    @cached_property
    def _nodes(self) -> dict[str, Expr]:
        found: dict[str, Expr] = {}
        for part in self._graph.parts:
            for port, node in part.nodes.items():
                if node != GROUND:
                    name = f"{self._graph.nodes[node]}.{self._graph.domains[node].across.name}"
                    found.setdefault(name, self._readings.across(part, port))
        return found
