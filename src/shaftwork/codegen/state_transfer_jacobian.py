"""What parameters do to the states that new equations start with: the derivative of what `StateTransfer` does.

With H(x) all that the new equations store in states x, v what was stored, K the coefficients and F, Q the loops and
cutsets, the states that take v up obey, for every speed and every torque of a spring among them,

    K (x - v) + sum_K Q K (H - v) = 0,        (x - v) / K - sum_S F (H - v) / K = 0,

the sums over what follows from the states. The differential of this, an impact included, gives dx from dv.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from sympy import Add, Dummy, Expr, Symbol

from shaftwork.codegen.derivatives import SlopeMatrix, Values
from shaftwork.codegen.elements import Array
from shaftwork.components.laws import t as TIME
from shaftwork.network.kinds import Kind
from shaftwork.reduction.explicit_rows import Rows
from shaftwork.reduction.form import State, StateForm, store_name
from shaftwork.reduction.gains import Number, exact_of
from shaftwork.reduction.observables import Observables


class StateTransferJacobian:
    """Stores of one set of equations, and its states from what was stored, both with their derivatives.

    Args:
        form: the state form.
        rows: its explicit rows.
        parameters: m symbols by which to differentiate.
    """

    def __init__(self, form: StateForm, rows: Rows, parameters: Sequence[Symbol]) -> None:
        self._form, self._rows, self._by = form, rows, (rows.states, tuple(parameters), (TIME,))
        kinds = (Kind.ACROSS_STORE, Kind.THROUGH_STORE)
        stores = (branch for branch in form.graph.branches if branch.template.kind in kinds)
        expressed = Observables(form, rows)
        self._branches = {store_name(form.graph, branch): branch.index for branch in stores}
        self._stored = {name: expressed.store(name) for name in self._branches}
        self._stored |= {state.name: Symbol(state.name, real=True) for state in form.states if state.kind == "integral"}
        self.names = tuple(self._stored)
        """Every store and angle, as in `StateTransfer`."""

    @cached_property
    def _shows(self) -> tuple[Values, tuple[SlopeMatrix, ...]]:
        stored = tuple(self._stored.values())
        return Values(self._rows, stored), tuple(SlopeMatrix(self._rows, stored, by) for by in self._by)

    def given(self, t: float, x: Array, p: Array, dx: Array, dt: Array) -> tuple[Array, Array]:
        """All that is stored (stores,) in the order of `names`, and its total derivatives (stores, m).

        Args:
            t: time at which inputs are read, s.
            x: (n,) states.
            p: (p,) parameters.
            dx: (n, m) total derivatives of the states.
            dt: (m,) those of the time.
        """
        values, slopes = self._shows
        by_states, by_parameters, by_time = (slope(t, x, p) for slope in slopes)
        return values(np.array([t]), x[None, :], p)[0], by_states @ dx + by_parameters + by_time * dt

    @cached_property
    def _takes(self) -> tuple[SlopeMatrix, ...]:
        """Slopes of the balances by states, parameters, time and what is held."""
        held = {name: Dummy(real=True) for name in self._stored}
        balances = tuple(self._balances({name: shown - held[name] for name, shown in self._stored.items()}))
        wider = replace(self._rows, states=(*self._rows.states, *held.values()))
        return tuple(SlopeMatrix(wider, balances, by) for by in (*self._by, tuple(held.values())))

    def _balances(self, missing: Mapping[str, Expr]) -> Iterator[Expr]:
        """The equations above, in their states' order, from how far each store is from what was stored."""
        form, names = self._form, {branch: name for name, branch in self._branches.items()}
        for state in form.states:
            if state.kind == "integral":
                yield missing[state.name]
                continue
            own, other, power = self._others(state)
            weights = exact_of(gain for _, gain in other)
            beside = (w * self._law(k) ** power * missing[names[k]] for w, (k, _) in zip(weights, other, strict=True))
            yield self._law(state.branch) ** power * missing[state.name] + own * Add(*beside)

    def _others(self, state: State) -> tuple[int, list[tuple[int, Number]], int]:
        """What follows from a state: the sign of its sum, branches with their gains, and the power of coefficients."""
        tree, branch = self._form.tree, state.branch
        if state.kind == "across":
            rows = ((link, tree.cutsets[link]) for link in self._form.dependent_across)
            return 1, [(link, row[branch]) for link, row in rows if branch in row], 1
        row = tree.loops[branch]
        return -1, [(other, row[other]) for other in self._form.dependent_through if other in row], -1

    def _law(self, branch: int) -> Expr:
        made = self._form.graph.branches[branch]
        return self._form.graph.in_network_symbols(made.template.law, made)

    def taken(self, t: float, x: Array, p: Array, held: Array, slopes: Array, dt: Array) -> Array:
        """(n, m) total derivatives of the states (n,) that take up what was held.

        Args:
            t: time at which inputs are read, s.
            x: (n,) the states.
            p: (p,) parameters.
            held: (stores,) what was held, in the order of `names`.
            slopes: (stores, m) its total derivatives.
            dt: (m,) those of the time.
        """
        by_states, by_parameters, by_time, by_held = (made(t, np.concatenate([x, held]), p) for made in self._takes)
        return np.asarray(-np.linalg.solve(by_states, by_held @ slopes + by_parameters + by_time * dt))
