"""What parts, nodes and stores show, as expressions in states, parameters and time: what the guards of modes read.

Reactions are among them, the torque through a stuck brake for instance. That of a tree branch is the sum over its
cutset, in which an inertia that follows others takes its torque from their rates:

    i_tree = -Q i_link,   i_K = K F' dx_C/dt
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from sympy import Add, Expr, Integer, Symbol, nan, oo, zoo

from shaftwork.components.base import Signal
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, End, across_of, integral_of, through_of
from shaftwork.components.discontinuities import parts
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import replaced
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Modes
from shaftwork.core.errors import Diagnostic, NetworkError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import StateForm, store_name
from shaftwork.formulation.gains import exact_of
from shaftwork.network.graph import GROUND, GraphBranch, GraphPart, signals_of
from shaftwork.network.kinds import Kind


def _no_limit(name: str) -> Diagnostic:
    message = f"a law that acts on '{name}' has no finite value where '{name}' holds still, so that nothing holds it."
    return Diagnostic("law with a pole", message, "Give the law a finite value at rest.", (name,))


class Observables:
    """Expressions of what parts show, in one set of equations.

    Args:
        form: the state form.
        rows: its explicit rows.
    """

    def __init__(self, form: StateForm, rows: Rows) -> None:
        self.form, self.graph, self.rows = form, form.graph, rows
        stores = (*form.across_states, *form.through_states)  # an angle of the same branch has another rate
        self._rates = dict(zip(stores, rows.rates, strict=False))
        self._through: dict[int, Expr] = {}

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """What the expressions are made of, besides time and parameters."""
        return self.rows.states

    def quantity(self, name: str) -> Expr | None:
        """A quantity by its name, such as "shaft.tau"; None for an energy, a power or what does not exist."""
        owner, _, quantity = name.rpartition(".")
        part = next((part for part in self.graph.parts if part.name == owner), None)
        if part is not None and (signal := signals_of(self.graph, part).get(quantity)) is not None:
            return signal.sign * self._signal(part, signal)
        if any(state.name == name and state.kind == "integral" for state in self.form.states):
            return Symbol(name, real=True)
        return self._nodes.get(name)

    def store(self, name: str) -> Expr:
        """What is stored, by the name of its state, whether it is one or not."""
        if any(state.name == name for state in self.form.states):
            return Symbol(name, real=True)
        stores = (b for b in self.graph.branches if b.template.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE))
        branch = next(store for store in stores if store_name(self.graph, store) == name)
        if branch.template.kind is Kind.THROUGH_STORE:
            return self.through(branch.index)
        return self._between(self.graph.parts[branch.part], branch.template.ends)

    def _signal(self, part: GraphPart, signal: Signal) -> Expr:
        if signal.kind == "across":
            return self._between(part, signal.ends)
        if signal.kind == "through":
            return self.into(part, signal.ends[0])
        springs = (branch for branch in self._of(part) if branch.template.kind is Kind.THROUGH_STORE)
        spring = next(branch for branch in springs if signal.label in ("", branch.template.label))
        through = self.through(spring.index)
        return through if signal.kind == "store" else through / self.form.law_of(spring.index)

    @cached_property
    def _nodes(self) -> dict[str, Expr]:
        speeds: dict[str, Expr] = {}
        for part in self.graph.parts:
            for port, node in part.nodes.items():
                if node != GROUND:
                    name = f"{self.graph.nodes[node]}.{self.graph.domains[node].across.name}"
                    speeds.setdefault(name, self.across(part, port))
        return speeds

    def guard(self, part: GraphPart, element: Modes, expression: Expr) -> Expr:
        """An expression of a guard, in the symbols of its component, in states, the network's parameters and time.

        Raises:
            NetworkError: it has no finite value: a law of another part has a pole where this part holds still.
        """
        ends = part.ends_of(element)
        values: dict[Symbol, Expr] = {}
        for symbol in expression.free_symbols - {TIME}:
            if symbol == ACROSS:
                values[symbol] = self._between(part, ends)
            elif symbol == THROUGH:
                values[symbol] = self.into(part, ends[0])
            elif symbol == INTEGRAL:
                values[symbol] = self._integral(part, element.angle)
            else:
                values[symbol] = self._named(part, symbol)
        guard = replaced(expression, values)
        if not {zoo, oo, nan}.isdisjoint(parts((guard,))):
            raise NetworkError(f"'{self.graph.name}' cannot be assembled", (_no_limit(part.name),))
        return guard

    def _named(self, part: GraphPart, symbol: Symbol) -> Expr:
        for port in part.nodes:
            if symbol == across_of(port):
                return self.across(part, port)
        for branch in self._of(part):
            label = branch.template.label
            if symbol == through_of(label):
                return self.through(branch.index)
            if symbol == integral_of(label):
                return self._integral(part, label)
        return self.graph.symbol_of(part, symbol.name)

    def _between(self, part: GraphPart, ends: tuple[End, End]) -> Expr:
        return self.across(part, ends[0]) - self.across(part, ends[1])

    def across(self, part: GraphPart, port: End) -> Expr:
        """The across variable of a port against the reference."""
        node = part.node_at(port)
        row = None if node == GROUND else self.form.tree.potentials[node]
        if row is None:
            return Integer(0)
        members = [tree for tree in row if self.graph.branches[tree].template.kind is not Kind.COUPLING]
        exact = exact_of(row[tree] for tree in members)
        return Add(*(gain * self._tree_across(tree) for tree, gain in zip(members, exact, strict=True)))

    def _tree_across(self, tree: int) -> Expr:
        if tree in self.rows.across:
            return self.rows.across[tree]
        # a spring in series with others: its speed is the rate of its torque over its stiffness
        rates = Add(*(gain * self._rate_of_through(link) for link, gain in self._cutsets.get(tree, ())))
        return -rates / self.form.law_of(tree)

    def _rate_of_through(self, link: int) -> Expr:
        if link in self.form.through_states:
            return self._rates[link]
        return slope(self.rows.through[link], TIME)

    def into(self, part: GraphPart, port: End) -> Expr:
        """What the node at a port gives to the part."""
        total: list[Expr] = []
        for branch in self._of(part):
            for coefficient, plus, minus in branch.template.balances or ((Integer(1), *branch.template.ends),):
                sign = (plus == port) - (minus == port)
                if sign:
                    factor = self.graph.in_network_symbols(coefficient, branch)
                    total.append(sign * factor * self.through(branch.index))
        return Add(*total)

    def through(self, branch: int) -> Expr:
        """The through variable of a branch; of a coupling its lambda."""
        if branch not in self._through:
            self._through[branch] = self._through_of(branch)
        return self._through[branch]

    def _through_of(self, branch: int) -> Expr:
        if branch in self.rows.through:
            return self.rows.through[branch]
        if branch in self.form.dependent_across:
            rates = (gain * self._rate_of_across(tree) for tree, gain in self._loop(branch))
            return self.form.law_of(branch) * Add(*rates)
        if branch in self.form.tree.loops:  # a redundant joint carries nothing
            return Integer(0)
        return -Add(*(gain * self.through(link) for link, gain in self._cutsets.get(branch, ())))

    def _rate_of_across(self, tree: int) -> Expr:
        if tree in self.form.across_sources:
            return slope(self.rows.across[tree], TIME)
        return self._rates.get(tree, Integer(0)) if tree in self.form.across_states else Integer(0)

    def _loop(self, link: int) -> list[tuple[int, Expr]]:
        row = self.form.tree.loops[link]
        return list(zip(row, exact_of(row.values()), strict=True))

    @cached_property
    def _cutsets(self) -> dict[int, list[tuple[int, Expr]]]:
        entries = [(tree, link, gain) for link, row in self.form.tree.cutsets.items() for tree, gain in row.items()]
        cutsets: dict[int, list[tuple[int, Expr]]] = {}
        for (tree, link, _), gain in zip(entries, exact_of(gain for _, _, gain in entries), strict=True):
            cutsets.setdefault(tree, []).append((link, gain))
        return cutsets

    def _integral(self, part: GraphPart, label: str) -> Expr:
        labels = {branch.index: branch.template.label for branch in self._of(part)}
        for state in self.form.states:
            if state.kind == "integral" and state.branch in labels and label in ("", labels[state.branch]):
                return Symbol(state.name, real=True)
        raise AssertionError(f"{part.name} has no angle")  # its laws read one in every form

    def _of(self, part: GraphPart) -> list[GraphBranch]:
        return [self.graph.branches[k] for k in part.branches]


@dataclass(frozen=True)
class Observable:
    """What a symbol stands for: "across" of a node, "into" a part at a port, "through" a branch, "state" by number.

    Args:
        kind: as above.
        number: of the node, the part, the branch or the state.
        port: of "into".
    """

    kind: Literal["across", "into", "through", "state"]
    number: int
    port: End = None


class NamedReadings(Observables):
    """Symbols in place of expressions, for networks that have no rows: each is recovered from the states.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self.form, self.graph = form, form.graph
        self.quantities: dict[Observable, Symbol] = {}

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """One for each of `quantities`, in their order."""
        return tuple(self.quantities.values())

    def _symbol(self, quantity: Observable) -> Symbol:
        return self.quantities.setdefault(quantity, Symbol(f"quantity {len(self.quantities)}", real=True))

    def across(self, part: GraphPart, port: End) -> Expr:
        """The across variable of a port against the reference."""
        node = part.node_at(port)
        return Integer(0) if node == GROUND else self._symbol(Observable("across", node))

    def into(self, part: GraphPart, port: End) -> Expr:
        """What the node at a port gives to the part."""
        return self._symbol(Observable("into", self.graph.parts.index(part), port))

    def through(self, branch: int) -> Expr:
        """The through variable of a branch."""
        return self._symbol(Observable("through", branch))

    def _integral(self, part: GraphPart, label: str) -> Expr:
        state = super()._integral(part, label)
        return self._symbol(Observable("state", [each.name for each in self.form.states].index(state.name)))
