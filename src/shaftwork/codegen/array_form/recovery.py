"""From states back to everything else: across and through variable of every branch, and the signals of every part."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.undefined_laws import without_value
from shaftwork.components.base import Profile, Signal
from shaftwork.components.branches import INTEGRAL, RATE, End
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.observables import Observable
from shaftwork.network.graph import CircuitGraph, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate


class BranchHistory:
    """All branch quantities at given times.

    Args:
        bound: the array program for one parameter vector.
        t: (k,) times.
        x: (k, n) states.
    """

    def __init__(self, bound: BoundArrays, t: Array, x: Array) -> None:
        self.bound, self.t, self.x = bound, t, np.ascontiguousarray(x.T)
        self.form = bound.program.form

    @cached_property
    def values(self) -> tuple[Array, Array]:
        """Outputs y and inputs u, each (., k).

        Raises:
            SimulationError: a law has no value.
        """
        y, u = self.bound.values(self.t, self.x)
        if not np.isfinite(u).all() and (error := without_value(self.bound, self.t, self.x.T)) is not None:
            raise error
        return y, u

    @cached_property
    def inputs(self) -> tuple[Array, Array, Array]:
        """u, its derivative by time alone, and x', each (., k).

        Raises:
            SimulationError: a law has no value.
        """
        y, u = self.values
        slopes = self.bound.program.inputs.source_rates(self.t, y, self.x, self.bound.p)
        return u, slopes, self.bound.rates(self.t, self.x, y, u)

    @cached_property
    def across(self) -> Array:
        """(branches, k) across variables."""
        form, part = self.form, self.bound.part
        u, slopes, rate = self.inputs
        laws = len(form.laws)
        tree = np.zeros((len(form.graph.branches), len(self.t)))
        tree[list(form.across_states)] = self.x[form.speeds]
        tree[list(form.across_inputs)] = u[laws:]
        tree[list(form.tree_conductances)] = part.conductance_x @ self.x[: len(form.states)] + part.conductance_u @ u
        if series := list(form.dependent_through):
            rates = np.zeros_like(tree)
            rates[list(form.through_states)] = rate[form.torques]
            rates[list(form.laws)] = slopes[:laws]
            tree[series] = -(part.cutsets[series] @ rates) / part.coefficients[series][:, None]
        return np.asarray(tree + part.loops.T @ tree)

    @cached_property
    def through(self) -> Array:
        """(branches, k) through variables; of a coupling its lambda."""
        form, part = self.form, self.bound.part
        u, slopes, rate = self.inputs
        laws = len(form.laws)
        links = np.zeros((len(form.graph.branches), len(self.t)))
        links[list(form.through_states)] = self.x[form.torques]
        links[list(form.laws)] = u[:laws]
        conductances = list(form.link_conductances)
        links[conductances] = part.coefficients[conductances][:, None] * self.across[conductances]
        if dependent := list(form.dependent_across):
            rates = np.zeros_like(links)
            rates[list(form.across_states)] = rate[form.speeds]
            rates[list(form.across_inputs)] = slopes[laws:]
            links[dependent] = part.coefficients[dependent][:, None] * (part.loops.T @ rates)[dependent]
        return np.asarray(links - part.cutsets @ links)

    @cached_property
    def potentials(self) -> Array:
        """(nodes + 1, k) across variables of the nodes against the reference, which is the last row."""
        nodes = self.bound.program.assembly.potentials(self.bound.p) @ np.where(
            self._is_tree[:, None], self.across, 0.0
        )
        return np.vstack([nodes, np.zeros((1, len(self.t)))])

    @property
    def _is_tree(self) -> Any:
        mask = np.ones(len(self.form.graph.branches), dtype=bool)
        mask[list(self.form.tree.loops)] = False
        return mask

    def quantity(self, wanted: Observable) -> Array:
        """(k,) what a guard reads."""
        match wanted.kind:
            case "across":
                return np.asarray(self.potentials[wanted.number])
            case "into":
                return self._through_port(self.form.graph.parts[wanted.number], str(wanted.port))
            case "through":
                return np.asarray(self.through[wanted.number])
        return np.asarray(self.x[wanted.number])

    def stored(self, part: GraphPart) -> Array:
        """(k,) energy in the stores of a part, J."""
        energy = np.zeros(len(self.t))
        for index in branches_with_power(self.form.graph, part):
            coefficient = self.bound.part.coefficients[index]
            match self.form.graph.branches[index].template.kind:
                case Kind.ACROSS_STORE:
                    energy += 0.5 * coefficient * self.across[index] ** 2
                case Kind.THROUGH_STORE:
                    energy += 0.5 * self.through[index] ** 2 / coefficient
        return sum((self.of_law(k, template.stored) for k, template in self._sprung(part)), start=energy)

    def _sprung(self, part: GraphPart) -> Iterator[tuple[int, BranchTemplate]]:
        """The branches of a part whose laws store energy."""
        graph = self.form.graph
        templates = ((k, graph.branches[k].template) for k in branches_with_power(graph, part))
        return ((k, template) for k, template in templates if template.stored != 0)

    def of_law(self, index: int, law: Expr) -> Array:
        """(k,) an expression of time, of what is across a branch, its integral and its template's symbols."""
        return self.bound.law_values(index, law, self.t, self.x, self.across[index])

    def absorbed(self, part: GraphPart) -> Array:
        """(k,) power that goes into a part at its ports, W."""
        return self._power(part, part.branches)

    def lost(self, part: GraphPart) -> Array:
        """(k,) power that a part takes in without storing it, W; negative where it supplies.

        Law: of energies V(s, t) in springs and T(s, v, t) in inertias, dV/dt = V_s v + V_t, dT/dt = i v - T_t.
        """
        kinds = (Kind.CONDUCTANCE, Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE)
        branches = self.form.graph.branches
        templates = ((k, branches[k].template) for k in branches_with_power(self.form.graph, part))
        power = self._power(part, (k for k, t in templates if t.through or (t.kind in kinds and not t.line)))
        for k, template in self._sprung(part):
            in_time = self.of_law(k, slope(template.stored, TIME))
            if RATE in template.reads:
                power += in_time - self._power(part, (k,))
            else:
                power -= in_time + self.of_law(k, slope(template.stored, INTEGRAL)) * self.across[k]
        return power

    def lifted(self, part: GraphPart) -> Array:
        """(k,) power that the weights of a part take in, W, and give back when they come down."""
        branches = self.form.graph.branches
        return self._power(part, (k for k in part.branches if branches[k].template.conservative))

    def heat(self, part: GraphPart) -> Array:
        """(k,) power that a part's own dampers and resistors take in, W; the windings of a motor are such."""
        branches = self.form.graph.branches
        return self._power(part, (k for k in part.branches if branches[k].template.kind is Kind.CONDUCTANCE))

    def _power(self, part: GraphPart, branches: Iterable[int]) -> Array:
        with np.errstate(invalid="ignore"):  # 0 times an infinite torque: what reads it takes the limit
            powers = (self.acted_on(part, k) * self.through[k] for k in branches)
            return np.asarray(sum(powers, start=np.zeros(len(self.t))))

    def acted_on(self, part: GraphPart, index: int) -> Array:
        """(k,) what a branch's through variable acts on: their product is the power that the branch takes in."""
        template = self.form.graph.branches[index].template
        if not template.through:
            return np.asarray(self.across[index])
        ends = dict.fromkeys(end for _, *pair in template.terms for end in pair if end is not None)
        speeds = (self._factor(part, template, end) * self.potentials[part.nodes[end]] for end in ends)
        return np.asarray(sum(speeds, start=np.zeros(len(self.t))))

    def signal(self, part: GraphPart, signal: Signal) -> Array:
        """(k,) one of the part's signals."""
        match signal.kind:
            case "across":
                plus, minus = map(part.node_at, signal.ends)
                return np.asarray(signal.sign * (self.potentials[plus] - self.potentials[minus]))
            case "through":
                return signal.sign * self._through_port(part, str(signal.ends[0]))
            case "store":
                return np.asarray(signal.sign * self.through[self._store(part, signal.label)])
            case "twist":
                store = self._store(part, signal.label)
                return np.asarray(self.through[store] / self.bound.part.coefficients[store])

    def profile(self, part: GraphPart, profile: Profile) -> Array:
        """(k, places) a quantity along the part."""
        branches = self.form.graph.branches
        labels = {branches[k].template.label: k for k in part.branches}
        columns = np.zeros((len(self.t), len(profile.of)))
        for place, terms in enumerate(profile.of):
            for factor, name in terms:
                if profile.kind == "across":
                    columns[:, place] += factor * self.potentials[part.nodes[name]]
                elif name in part.nodes:
                    columns[:, place] += factor * self._through_port(part, name)
                elif name in labels:  # no damping has left no branch
                    columns[:, place] += factor * self.through[labels[name]]
        return columns

    def _store(self, part: GraphPart, label: str) -> int:
        templates = ((k, self.form.graph.branches[k].template) for k in part.branches)
        stores = ((k, template) for k, template in templates if template.kind is Kind.THROUGH_STORE)
        return next(k for k, template in stores if label in ("", template.label))

    def _through_port(self, part: GraphPart, port: str) -> Array:
        """(k,) what the node at a port gives to a part: the sum over the branches that begin or end there."""
        total = np.zeros(len(self.t))
        for k in part.branches:
            template = self.form.graph.branches[k].template
            if template.terms:
                total += self._factor(part, template, port) * self.through[k]
            elif port in template.ends:
                total += _sign(template.ends, port) * self.through[k]
        return total

    def _factor(self, part: GraphPart, template: BranchTemplate, port: End) -> float:
        """With which factor a coupling takes its through variable from a port."""
        values = {s: float(self.bound.p[part.parameters[s.name]]) for s in template.symbols}
        there = ((factor, ends) for factor, *ends in template.balances if port in ends)
        return sum(_sign(ends, port) * float(factor.xreplace(values)) for factor, ends in there)


def _sign(ends: Sequence[End], port: End) -> int:
    """1 where a branch begins at a port, -1 where it ends there."""
    return (ends[0] == port) - (ends[1] == port)


class GivenHistory(BranchHistory):
    """All branch quantities where states, inputs and rates are given, each column for itself.

    Args:
        bound: the array program.
        x: (n, k) states.
        u: (m, k) inputs.
        slopes: (m, k) derivatives of the inputs by time alone.
        rate: (n, k) rates of the states.
    """

    def __init__(self, bound: BoundArrays, x: Array, u: Array, slopes: Array, rate: Array) -> None:
        super().__init__(bound, np.zeros(x.shape[1]), x.T)
        self._inputs = u, slopes, rate

    @property
    def inputs(self) -> tuple[Array, Array, Array]:
        """u, its derivative by time alone, and x', each (., k)."""
        return self._inputs


def branches_with_power(graph: CircuitGraph, part: GraphPart) -> tuple[int, ...]:
    """The branches of a part without those of its controller."""
    signals = part.component.signal_ports
    return tuple(k for k in part.branches if signals.isdisjoint(graph.branches[k].template.ends))
