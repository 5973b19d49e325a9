"""The functions of one set of equations in C: rates, slopes, outputs, what is stored, states from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Integer, Symbol

from shaftwork.ccode.c_printing import Statements, function
from shaftwork.ccode.c_texts import signature
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.law_slopes import slope
from shaftwork.formulation.form import store_name
from shaftwork.formulation.gains import exact_of
from shaftwork.formulation.tree import Row
from shaftwork.network.kinds import Kind


@dataclass(frozen=True)
class ArrayLayout:
    """What stands in which place of the arrays of the C code.

    Args:
        states: names of the states of all sets of equations.
        stores: names of everything that is stored.
        outputs: names of the outputs.
        has_modes: whether there are impacts, which need the inertias of the states.
        statements: writes expressions.
    """

    states: tuple[str, ...]
    stores: tuple[str, ...]
    outputs: tuple[str, ...]
    has_modes: bool
    statements: Statements


class SetFunctions:
    """The functions of one set of equations.

    Args:
        number: of the set.
        equations: the set.
        layout: of all sets.
    """

    def __init__(self, number: int, equations: EquationSet, layout: ArrayLayout) -> None:
        self.number, self.layout = number, layout
        self.form, self.rows, self.observables = equations.form, equations.rows, equations.observables
        self.places = [layout.states.index(state.name) for state in self.form.states]
        """Where its states are among those of all sets."""

    @property
    def _ties(self) -> bool:
        """Whether inertias among the states carry others."""
        return bool(self.form.dependent_across and self.form.across_states)

    @property
    def _slack(self) -> bool:
        """Whether springs among the states carry others."""
        return bool(self.form.dependent_through and self.form.through_states)

    @cached_property
    def text(self) -> str:
        """All functions."""
        parts = [self._rates(), self._jacobian(), self._outputs(), self._stores()]
        parts += [self._masses()] if self._ties or self.layout.has_modes else []
        parts += [self._take_up()]
        return "\n".join(parts)

    def written(self, name: str, targets: Sequence[str], expressions: Sequence[Expr]) -> str:
        """A function of this set that assigns expressions to targets: its name ends with the number of the set."""
        return self._function(name, [*self.assigned(targets, expressions)])

    def _function(self, name: str, lines: Sequence[str]) -> str:
        return function(signature(name, f"_{self.number}"), lines)

    def assigned(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """Lines that assign expressions to targets."""
        return self.layout.statements.assigned(targets, expressions)

    def _rates(self) -> str:
        expressions = list(self.rows.rates)
        targets = [f"dx[{place}]" for place in self.places]
        for name in self.layout.states:
            if name in self._dependent:  # so that all states of a motion have rates in all of its modes
                targets.append(f"dx[{self.layout.states.index(name)}]")
                expressions.append(self._dependent[name])
        return self.written("rates", targets, expressions)

    @cached_property
    def _dependent(self) -> Mapping[str, Expr]:
        """The rates of what is stored and no state here, by name."""
        names = [name for name in self.layout.states if name not in {state.name for state in self.form.states}]
        return {
            name: self._store_rate(branch)
            for name, branch in StateTransfer(self.form).branches.items()
            if name in names
        }

    def _store_rate(self, number: int) -> Expr:
        """The rate of the speed of an inertia, or of the torque of a spring, that follows others."""
        branch, law = self.form.graph.branches[number], self.form.law_of(number)
        if branch.template.kind is Kind.ACROSS_STORE:
            return self.observables.through(number) / law
        part, (first, second) = self.form.graph.parts[branch.part], branch.template.ends
        return law * (self.observables.across(part, first) - self.observables.across(part, second))

    def _jacobian(self) -> str:
        targets, slopes, size = list[str](), list[Expr](), len(self.layout.states)
        for row, rate in zip(self.places, self.rows.rates, strict=True):
            symbols = rate.free_symbols
            for column, state in zip(self.places, self.rows.states, strict=True):
                if state in symbols:
                    targets.append(f"slopes[{row * size + column}]")
                    slopes.append(slope(rate, state))
        return self.written("jacobian", targets, slopes)

    def _outputs(self) -> str:
        expressions = [self.observables.quantity(name) for name in self.layout.outputs]
        targets = [f"y[{k}]" for k in range(len(expressions))]
        return self.written("outputs", targets, expressions)

    def _stores(self) -> str:
        expressions = [self.observables.store(name) for name in self.layout.stores]
        targets = [f"stored[{k}]" for k in range(len(expressions))]
        return self.written("stores", targets, expressions)

    def _masses(self) -> str:
        """C + Q K F': the inertias of the states with all that turns with them, an array (n, n) of zeros before."""
        form, n = self.form, len(self.form.across_states)
        entries = {(k, k): form.law_of(branch) for k, branch in enumerate(form.across_states)}
        for link in form.dependent_across:
            loop, cutset = self._row(form.tree.loops, link), self._row(form.tree.cutsets, link)
            for (first, share), (second, gain) in ((one, other) for one in cutset for other in loop):
                at = form.across_states.index(first), form.across_states.index(second)
                entries[at] = entries.get(at, Integer(0)) + share * form.law_of(link) * gain
        targets = [f"mass[{row * n + column}]" for row, column in entries]
        return self.written("masses", targets, [*entries.values()])

    def _row(self, rows: Mapping[int, Row], link: int) -> list[tuple[int, Expr]]:
        """Gains of states of speed in the loop or the cutset of a link."""
        row = {tree: gain for tree, gain in rows[link].items() if tree in self.form.across_states}
        return list(zip(row, exact_of(row.values()), strict=True))

    def _take_up(self) -> str:
        """The states that take up what was stored with the least change: see `codegen.state_transfer`."""
        form = self.form
        lines = [*self._speeds_taken_up()] if self._ties else []
        lines += self._torques_taken_up() if self._slack else []
        tied = {"across": self._ties, "through": self._slack, "integral": ()}
        free = [(place, state) for place, state in zip(self.places, form.states, strict=True) if not tied[state.kind]]
        lines += self.assigned([f"x[{place}]" for place, _ in free], [stored_symbol(state.name) for _, state in free])
        return self._function("take_up", lines)

    def _speeds_taken_up(self) -> Iterator[str]:
        """(C + Q K F') x = C v + Q K (v_K - F_E' e)."""
        form, n = self.form, len(self.form.across_states)
        right = {k: form.law_of(k) * self._stored(k) for k in form.across_states}
        for link in form.dependent_across:
            row = form.tree.loops[link]
            pairs = zip(row, exact_of(row.values()), strict=True)
            prescribed = Add(*(gain * self.rows.across[tree] for tree, gain in pairs if tree in form.across_inputs))
            for tree, share in self._row(form.tree.cutsets, link):
                right[tree] += share * form.law_of(link) * (self._stored(link) - prescribed)
        yield f"double mass[{n * n}] = {{0.0}}, right[{n}];"
        yield f"masses_{self.number}(m, t, stored, mass);"
        yield from self._block([f"right[{k}]" for k in range(n)], [*right.values()])
        yield f"solve({n}, mass, 1, right);"
        yield from (f"x[{place}] = right[{k}];" for k, place in enumerate(self.places[form.speeds]))

    def _torques_taken_up(self) -> Iterator[str]:
        """(1 / L + F' Q / S) x = i / L - F' (i_S + Q_SW w) / S."""
        form, n = self.form, len(self.form.through_states)
        number = {branch: k for k, branch in enumerate(form.through_states)}
        entries = {(k, k): 1 / form.law_of(branch) for branch, k in number.items()}
        right = {k: self._stored(branch) / form.law_of(branch) for branch, k in number.items()}
        for tree in form.dependent_through:
            shares = {link: row[tree] for link, row in form.tree.cutsets.items() if tree in row}
            cutset = list(zip(shares, exact_of(shares.values()), strict=True))
            gains = {link: form.tree.loops[link][tree] for link in number if tree in form.tree.loops[link]}
            given = Add(*(share * self._given(link) for link, share in cutset if link not in number))
            for link, gain in zip(gains, exact_of(gains.values()), strict=True):
                right[number[link]] -= gain * (self._stored(tree) + given) / form.law_of(tree)
                for other, share in cutset:
                    if other in number:
                        at = number[link], number[other]
                        entries[at] = entries.get(at, Integer(0)) + gain * share / form.law_of(tree)
        yield f"double slack[{n * n}] = {{0.0}}, twist[{n}];"
        yield from self._block([f"slack[{row * n + column}]" for row, column in entries], [*entries.values()])
        yield from self._block([f"twist[{k}]" for k in range(n)], [*right.values()])
        yield f"solve({n}, slack, 1, twist);"
        yield from (f"x[{place}] = twist[{k}];" for k, place in enumerate(self.places[form.torques]))

    def _block(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """Assignments with names of their own."""
        yield "{"
        yield from (f"    {line}" for line in self.assigned(targets, expressions))
        yield "}"

    def _given(self, link: int) -> Expr:
        """What a source gives by the time alone; what follows from the states gives nothing at once."""
        through = self.rows.through.get(link, Integer(0))
        return Integer(0) if through.free_symbols & {*self.rows.states} else through

    def _stored(self, branch: int) -> Expr:
        return stored_symbol(store_name(self.form.graph, self.form.graph.branches[branch]))


def stored_symbol(name: str) -> Symbol:
    """What stands for something stored before an event, by its name."""
    return Symbol(f"stored {name}", real=True)
