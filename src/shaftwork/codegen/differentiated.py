"""One set of equations with all that sensitivities take: rates, quantities, their slopes, and where laws turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from sympy import Expr, Symbol

from shaftwork.codegen.derivatives import SlopeMatrix, Values
from shaftwork.codegen.elements import Array
from shaftwork.codegen.state_transfer_jacobian import StateTransferJacobian
from shaftwork.components.laws import switches, switches_of
from shaftwork.components.laws import t as TIME
from shaftwork.reduction.explicit_rows import Rows
from shaftwork.reduction.form import StateForm


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
        by_states, by_parameters, by_time = (made(t, x, p)[0] for made in self._by)
        return by_states, by_parameters, float(by_time[0])


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
        past = [made.replace(lambda node: _switches_by(node, arguments), _later) for made in self._expressions]
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
        found = (
            argument - level
            for argument, levels in pairs
            if not moving.isdisjoint(argument.free_symbols)
            for level in levels
        )
        return tuple(dict.fromkeys(found))

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
