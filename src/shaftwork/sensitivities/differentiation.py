"""State equations and quantities with exact derivatives by states and parameters, from their expressions.

What goes over to new equations has derivatives, too: those of what `StateTransfer` does. With H(x) all that the new
equations store in states x, v what was stored, K the coefficients and F, Q the loops and cutsets, the states that take
v up obey, for every speed and every torque of a spring among them,

    K (x - v) + sum_K Q K (H - v) = 0,        (x - v) / K - sum_S F (H - v) / K = 0,

the sums over what follows from the states. The differential of this, an impact included, gives dx from dv.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Add, Dummy, Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import vectorised_list
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.discontinuities import switches, switches_of
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import State, StateForm
from shaftwork.formulation.gains import Number, exact_of
from shaftwork.formulation.observables import Observables


def rows_of(model: CompiledModel) -> Rows:
    """The symbolic equations of a model.

    Raises:
        CompileError: it has none.
    """
    if model.rows is None:
        raise CompileError(
            f"'{model.form.graph.name}' has no symbolic equations to differentiate: it is too large, too closely "
            "coupled, or holds waves. Take fewer elements, such as model=Lumped(10), or differences of two runs."
        )
    return model.rows


class Values:
    """Expressions as a function of times, states and parameters.

    Args:
        rows: whose states and parameters are the arguments.
        expressions: k of them.
    """

    def __init__(self, rows: Rows, expressions: Sequence[Expr]) -> None:
        self._expressions, self._arguments = tuple(expressions), (TIME, *rows.states, *rows.parameters)

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return vectorised_list(self._arguments, self._expressions)

    def __call__(self, times: Array, states: Array, p: Array) -> Array:
        """(s, k) at times (s,) in s, states (s, n), parameters (p,)."""
        columns = np.empty((len(times), len(self._expressions)))
        with np.errstate(all="ignore"):  # the pieces of a law that do not hold may have no value
            for k, values in enumerate(self._function(times, *states.T, *p.tolist()) if self._expressions else ()):
                columns[:, k] = values
        return columns


class SlopeMatrix:
    """Derivatives of expressions by symbols, as a function of time, states and parameters.

    Args:
        rows: whose states and parameters are the arguments.
        expressions: k of them.
        symbols: m of them.
    """

    def __init__(self, rows: Rows, expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> None:
        self._rows, self.shape = rows, (len(expressions), len(symbols))
        self.entries = {
            (k, m): entry
            for k, expression in enumerate(expressions)
            for free in (expression.free_symbols,)
            for m, symbol in enumerate(symbols)
            if symbol in free and (entry := slope(expression, symbol)) != 0
        }
        self._values = Values(rows, tuple(self.entries.values()))

    def __call__(self, t: float, x: Array, p: Array) -> Array:
        """(k, m) at a time in s, states (n,), parameters (p,)."""
        return np.asarray(self.along(np.array([t]), x[None, :], p)[0])

    def differentiated(self, symbols: Sequence[Symbol], t: float, x: Array, p: Array) -> Array:
        """(symbols, k, m) the derivatives of all entries by symbols, at a time in s, states (n,), parameters (p,)."""
        matrices = np.zeros((len(symbols), *self.shape))
        if self.entries:
            rows, columns = np.array(list(self.entries)).T
            matrices[:, rows, columns] = SlopeMatrix(self._rows, tuple(self.entries.values()), symbols)(t, x, p).T
        return matrices

    def along(self, times: Array, states: Array, p: Array) -> Array:
        """(s, k, m) at times (s,) in s, states (s, n), parameters (p,)."""
        matrices = np.zeros((len(times), *self.shape))
        if self.entries:
            rows, columns = np.array(list(self.entries)).T
            matrices[:, rows, columns] = self._values(times, states, p)
        return matrices


class StateTransferJacobian:
    """Stores of one set of equations, and its states from what was stored, both with their derivatives.

    Args:
        form: the state form.
        rows: its explicit rows.
        parameters: m symbols by which to differentiate.
    """

    def __init__(self, form: StateForm, rows: Rows, parameters: Sequence[Symbol]) -> None:
        self._form, self._rows, self._by = form, rows, (rows.states, tuple(parameters), (TIME,))
        transfer, expressed = StateTransfer(form), Observables(form, rows)
        self.names = transfer.names
        """Every store and angle, as in `StateTransfer`."""
        self._branches = transfer.branches
        self._stored = {name: expressed.store(name) for name in self.names}

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
        """Slopes of the balances by states, parameters, time and what was stored."""
        before = {name: Dummy(real=True) for name in self._stored}
        balances = tuple(self._balances({name: after - before[name] for name, after in self._stored.items()}))
        wider = replace(self._rows, states=(*self._rows.states, *before.values()))
        return tuple(SlopeMatrix(wider, balances, by) for by in (*self._by, tuple(before.values())))

    def _balances(self, missing: Mapping[str, Expr]) -> Iterator[Expr]:
        """The equations above, in their states' order, from how far each store is from what was stored."""
        form, names = self._form, {branch: name for name, branch in self._branches.items()}
        for state in form.states:
            if state.kind == "integral":
                yield missing[state.name]
                continue
            sign, other, power = self._others(state)
            weights = exact_of(gain for _, gain in other)
            beside = (w * self._law(k) ** power * missing[names[k]] for w, (k, _) in zip(weights, other, strict=True))
            yield self._law(state.branch) ** power * missing[state.name] + sign * Add(*beside)

    def _others(self, state: State) -> tuple[int, list[tuple[int, Number]], int]:
        """What follows from a state: the sign of its sum, branches with their gains, and the power of coefficients."""
        tree, branch = self._form.tree, state.branch
        if state.kind == "across":
            rows = ((link, tree.cutsets[link]) for link in self._form.dependent_across)
            return 1, [(link, row[branch]) for link, row in rows if branch in row], 1
        row = tree.loops[branch]
        return -1, [(other, row[other]) for other in self._form.dependent_through if other in row], -1

    def _law(self, branch: int) -> Expr:
        of = self._form.graph.branches[branch]
        return self._form.graph.in_network_symbols(of.template.law, of)

    def taken(self, t: float, x: Array, p: Array, stored: Array, slopes: Array, dt: Array) -> Array:
        """(n, m) total derivatives of the states (n,) that take up what was stored.

        Args:
            t: time at which inputs are read, s.
            x: (n,) the states.
            p: (p,) parameters.
            stored: (stores,) what was stored, in the order of `names`.
            slopes: (stores, m) its total derivatives.
            dt: (m,) those of the time.
        """
        wider = np.concatenate([x, stored])
        by_states, by_parameters, by_time, by_stored = (slope(t, wider, p) for slope in self._takes)
        return np.asarray(-np.linalg.solve(by_states, by_stored @ slopes + by_parameters + by_time * dt))


class ValueWithSlopes:
    """An expression with its slopes.

    Args:
        rows: of the states and parameters in it.
        expression: what is read.
        parameters: m symbols by which to differentiate.
    """

    def __init__(self, rows: Rows, expression: Expr, parameters: Sequence[Symbol]) -> None:
        self.value = Values(rows, (expression,))
        self._by = tuple(SlopeMatrix(rows, (expression,), by) for by in (rows.states, tuple(parameters), (TIME,)))

    def slopes(self, t: float, x: Array, p: Array) -> tuple[Array, Array, float]:
        """Its slopes by states (n,), by parameters (m,) and by time."""
        by_states, by_parameters, by_time = (slopes(t, x, p)[0] for slopes in self._by)
        return by_states, by_parameters, float(by_time[0])

    def along(self, times: Array, states: Array, p: Array) -> tuple[Array, Array]:
        """Its slopes by states (k, n) and by parameters (k, m), at times (k,) in s."""
        by_states, by_parameters, _ = self._by
        return by_states.along(times, states, p)[:, 0], by_parameters.along(times, states, p)[:, 0]


class Differentiated:
    """Equations that are ready for sensitivities.

    Args:
        form: the state form.
        rows: its explicit rows.
        parameters: m symbols by which to differentiate.
        quantities: expressions that are read, by name.
        integrands: expressions that are integrated beside the states.
    """

    def __init__(
        self,
        form: StateForm,
        rows: Rows,
        parameters: Sequence[Symbol],
        quantities: Mapping[str, Expr],
        integrands: Sequence[Expr],
    ) -> None:
        self._form, self._rows, self._parameters = form, rows, tuple(parameters)
        self._shown: dict[Expr, ValueWithSlopes] = {}
        self.quantities = quantities
        self._expressions = rates = (*rows.rates, *integrands)
        self._rates = Values(rows, rates)
        self._by_states = SlopeMatrix(rows, rates, rows.states)
        self._by_parameters = SlopeMatrix(rows, rates, self._parameters)

    def rates(self, times: Array, states: Array, p: Array) -> Array:
        """(k, N) of the states, and behind them the integrands, at times (k,) in s and states (k, n)."""
        return self._rates(times, states, p)

    def rates_past(self, arguments: Sequence[Expr], later: float, t: float, x: Array, p: Array) -> Array:
        """(N,) the same at one time where laws that switch by certain arguments are read at a later one, in s."""
        wider = replace(self._rows, states=(*self._rows.states, _LATER))
        past = [one.replace(lambda node: _switches_by(node, arguments), _later) for one in self._expressions]
        return np.asarray(Values(wider, past)(np.array([t]), np.append(x, later)[None, :], p)[0])

    def coefficients(self, times: Array, states: Array, p: Array) -> tuple[Array, Array]:
        """Slopes of the rates by states (k, N, n) and by parameters (k, N, m)."""
        return self._by_states.along(times, states, p), self._by_parameters.along(times, states, p)

    def shown(self, expression: Expr) -> ValueWithSlopes:
        """An expression with its slopes; made once."""
        if expression not in self._shown:
            self._shown[expression] = ValueWithSlopes(self._rows, expression, self._parameters)
        return self._shown[expression]

    @cached_property
    def takeover(self) -> StateTransferJacobian:
        """What is stored, and how the states take it up."""
        return StateTransferJacobian(self._form, self._rows, self._parameters)

    @property
    def _read(self) -> tuple[Expr, ...]:
        return (*self._expressions, *self.quantities.values())

    @cached_property
    def turns(self) -> tuple[Expr, ...]:
        """What makes a rate or a quantity jump or bend where its sign changes with the motion."""
        moving = frozenset(self._rows.states)  # only asked for membership
        pairs = (pair for expression in self._read for pair in switches(expression))
        turning = (
            argument - level
            for argument, levels in pairs
            if not moving.isdisjoint(argument.free_symbols)
            for level in levels
        )
        return tuple(dict.fromkeys(turning))

    @cached_property
    def turning(self) -> Values:
        """`turns` as a function."""
        return Values(self._rows, self.turns)


_LATER = Symbol("later", real=True)


def _later(node: Expr) -> Expr:
    return node.xreplace({TIME: _LATER})


def _switches_by(node: Expr, arguments: Sequence[Expr]) -> bool:
    # a comparison may have its sides exchanged where symbols of the network sort in another order
    return any(argument in arguments or -argument in arguments for argument, _ in switches_of(node))
