"""The functions of one set of equations in C: rates, slopes, outputs, what is stored, states from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sympy import Add, Expr, Float, Integer, Symbol

from shaftwork.ccode.c_printing import Statements, function
from shaftwork.ccode.c_texts import ARGUMENTS, dispatcher, signature
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.form import store_name
from shaftwork.formulation.gains import exact_of
from shaftwork.formulation.tree import Row
from shaftwork.network.kinds import Kind

LATER = Symbol("later", real=True)
"""The time behind an instant, at which what is asked of sampled controllers has jumped."""


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
    def assignments(self) -> Mapping[str, Mapping[str, Expr]]:
        """By the name of a function what it assigns, target to expression."""
        outputs = {f"y[{k}]": self.observables.quantity(name) for k, name in enumerate(self.layout.outputs)}
        stored = {f"stored[{k}]": self.observables.store(name) for k, name in enumerate(self.layout.stores)}
        masses = {"masses": self._masses()} if self.layout.has_modes else {}
        return {"rates": self._rates(), "jacobian": self._jacobian(), "outputs": outputs, "stores": stored} | masses

    @cached_property
    def text(self) -> str:
        """The functions that no other set shares."""
        masses = self._masses() if self._ties and not self.layout.has_modes else None
        inertias = [self._function("masses", self.assigned([*masses], [*masses.values()]))] if masses else []
        return "\n".join([*inertias, self._take_up(), self._samples()])

    def _function(self, name: str, lines: Iterable[str]) -> str:
        """A function of this set: its name ends with the number of the set."""
        return function(signature(name, f"_{self.number}"), [*lines])

    def assigned(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """Lines that assign expressions to targets."""
        return self.layout.statements.assigned(targets, expressions)

    def _rates(self) -> Mapping[str, Expr]:
        """The rates of the states, and of what is stored and no state here: all have some in all modes."""
        rates = {f"dx[{place}]": rate for place, rate in zip(self.places, self.rows.rates, strict=True)}
        branches = StateTransfer(self.form).branches
        others = {name: k for k, name in enumerate(self.layout.states) if k not in self.places and name in branches}
        return rates | {f"dx[{k}]": self._store_rate(branches[name]) for name, k in others.items()}

    def _store_rate(self, number: int) -> Expr:
        """The rate of the speed of an inertia, or of the torque of a spring, that follows others."""
        branch, law = self.form.graph.branches[number], self.form.law_of(number)
        if branch.template.kind is Kind.ACROSS_STORE:
            return self.observables.through(number) / law
        part, (first, second) = self.form.graph.parts[branch.part], branch.template.ends
        return law * (self.observables.across(part, first) - self.observables.across(part, second))

    def _jacobian(self) -> Mapping[str, Expr]:
        size, states = len(self.layout.states), list(zip(self.places, self.rows.states, strict=True))
        return {
            f"slopes[{row * size + column}]": slope(rate, state)
            for row, rate in zip(self.places, self.rows.rates, strict=True)
            for symbols in [rate.free_symbols]
            for column, state in states
            if state in symbols
        }

    def _masses(self) -> Mapping[str, Expr]:
        """C + Q K F': the inertias of the states with all that turns with them, an array (n, n) of zeros before."""
        form, n = self.form, len(self.form.across_states)
        entries = {(k, k): form.law_of(branch) for k, branch in enumerate(form.across_states)}
        for link in form.dependent_across:
            loop, cutset = self._row(form.tree.loops, link), self._row(form.tree.cutsets, link)
            for (first, share), (second, gain) in ((one, other) for one in cutset for other in loop):
                at = form.across_states.index(first), form.across_states.index(second)
                entries[at] = entries.get(at, Integer(0)) + share * form.law_of(link) * gain
        return {f"mass[{row * n + column}]": entry for (row, column), entry in entries.items()}

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

    def _samples(self) -> str:
        """What sampled controllers hold after an instant: see `components.sampling`."""
        graph, lines = self.form.graph, list[str]()
        for part in graph.parts:
            if (sampler := part.component.sampler()) is None:
                continue
            names = {key: f"{part.name}.{key}" for key in ("reference", "sample_time")}
            values = {"reference": as_expression(sampler.reference), "sample_time": Float(sampler.period)}
            reference, period = (
                Symbol(name, real=True) if name in graph.parameters else values[key] for key, name in names.items()
            )
            e = [point - self._measured(name) for point, name in zip(sampler.setpoints, sampler.measured, strict=True)]
            e[0] += reference.xreplace({TIME: LATER})
            x = [Symbol(f"{part.name}.x_{k + 1}", real=True) for k in range(len(sampler.A))]
            steps = {f"{part.name}.x_u_{k + 1}": row for k, row in enumerate(np.hstack((sampler.C, sampler.D)))}
            steps |= {symbol.name: row for symbol, row in zip(x, np.hstack((sampler.A, sampler.B)), strict=True)}
            targets = ["const double period", *(f"after[{self.layout.states.index(name)}]" for name in steps)]
            sums = [
                Add(*(float(gain) * one for gain, one in zip(row, [*x, *e], strict=True))) for row in steps.values()
            ]
            lines += ["{", *self.assigned(targets[:1], [period]), "if (is_due(m->t, period)) {"]
            lines += [*self.assigned(targets[1:], sums), "}", "}"]
        return self._function("samples", lines)

    def _measured(self, name: str) -> Expr:
        quantity = self.observables.quantity(name)
        return self.observables.store(name) if quantity is None else quantity

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


def functions_of_sets(name: str, sets: Sequence[Mapping[str, Expr]], statements: Statements) -> Iterator[str]:
    """A function of each set of equations, and the one that calls that of the set of an instance.

    Rows that half of the sets or more have in common stand in one function that theirs call. Rows of fewer sets stay
    with the others of their set: what they have in common with those, such as a sine, is then evaluated once.

    Args:
        name: of the functions, as in `c_texts.ARGUMENTS`.
        sets: what each of them assigns, target to expression.
        statements: writes expressions.
    """
    call = ", ".join(("m", "t", *ARGUMENTS[name]))
    sharers: dict[tuple[str, Expr], list[int]] = {}
    for number, one in enumerate(sets):
        for row in one.items():
            sharers.setdefault(row, []).append(number)
    groups: dict[tuple[int, ...], dict[str, Expr]] = {}
    for (target, expression), numbers in sharers.items():
        together = [tuple(numbers)] if 2 * len(numbers) >= len(sets) else [(number,) for number in numbers]
        for sharing in together:
            groups.setdefault(sharing, {})[target] = expression
    lines: dict[str, list[str]] = {f"_{number}": [] for number in range(len(sets))}
    for k, (sharing, rows) in enumerate(groups.items()):
        suffix = f"_shared_{k}" if len(sharing) > 1 else f"_{sharing[0]}"
        for number in sharing if len(sharing) > 1 else ():
            lines[f"_{number}"].append(f"{name}{suffix}({call});")
        lines.setdefault(suffix, []).extend(statements.assigned([*rows], [*rows.values()]))
    yield from (function(signature(name, suffix), text) for suffix, text in reversed(lines.items()))
    yield dispatcher(name, len(sets))


def stored_symbol(name: str) -> Symbol:
    """What stands for something stored before an event, by its name."""
    return Symbol(f"stored {name}", real=True)
