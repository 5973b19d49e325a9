"""Compiled code for many variants of one set of equations, whatever the numbers of the modes are."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from sympy import Add, Expr

from shaftwork.codegen.elements import Array
from shaftwork.codegen.expressed import Expressed
from shaftwork.codegen.lanes import LaneFunction, LaneProgram, lane_function, lane_program
from shaftwork.codegen.stores import Stores
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import slope
from shaftwork.core.errors import CompileError
from shaftwork.pipeline.ensemble.extremes import DATA
from shaftwork.pipeline.model import Model
from shaftwork.reduction.rows import Rows
from shaftwork.results.measures import Measure

EXTREMES = {"max": (1.0,), "min": (-1.0,), "peak": (1.0, -1.0)}
"""Measures that are the largest value of a quantity, times these signs."""
POWERS = {"mean": 1, "rms": 2}
"""Measures that are integrals of a quantity to some power."""


class EnsembleCode:
    """The programs of one set of equations.

    Args:
        model: the equations.
        program: the heyoka program for one variant.
        stores: what the equations store.
        measures: what is read.

    Raises:
        CompileError: variants cannot run side by side in them.
    """

    def __init__(self, model: Model, program: Any, stores: Stores, measures: Sequence[Measure]) -> None:
        if model.rows is None or program is None or not model.states:
            raise CompileError("These equations have no program of their own.")
        self.model, self._rows, self._stores = model, model.rows, stores
        self._expressed = Expressed(model.form, model.rows)
        quantities = [self._expressed.quantity(measure.quantity) for measure in measures]
        self._quantities = [found for found in quantities if found is not None]
        if len(self._quantities) < len(quantities):
            raise CompileError("A measure is of a power, an energy or a place along a shaft.")
        self._extremes = [row for row, measure in enumerate(measures) if measure.kind in EXTREMES]
        integrated = [row for row, measure in enumerate(measures) if measure.kind in POWERS]
        self.integral_of = {row: k for k, row in enumerate(integrated)}
        """By measure, which of the integrals behind the states is its."""
        integrands = [self._quantities[row] ** POWERS[measures[row].kind] for row in integrated]
        self.program: LaneProgram = lane_program(program, model.rows, integrands)

    def jets(self, t: Array, x: Array, p: Array) -> dict[int, Array]:
        """By measure that is an extreme, what it reads and the first and second derivative by time, (3, m, k).

        Args:
            t: (m, k) times, s.
            x: (n, m, k) states.
            p: (parameters, k).
        """
        made = self._jets(t, x, p)
        return {row: made[DATA * k : DATA * (k + 1)] for k, row in enumerate(self._extremes)}

    @cached_property
    def _jets(self) -> LaneFunction:
        jets = [made for row in self._extremes for made in _jet(self._quantities[row], self._rows)]
        return lane_function(self._rows, jets)

    @cached_property
    def shown(self) -> LaneFunction:
        """What the measures read."""
        return lane_function(self._rows, self._quantities)

    @cached_property
    def stored(self) -> LaneFunction:
        """All that is stored, in the order of the names of `codegen.stores.Stores`."""
        return lane_function(self._rows, [self._expressed.store(name) for name in self._stores.names])

    @cached_property
    def state_rows(self) -> list[int]:
        """For each state, its place among all that is stored."""
        return [self._stores.names.index(name) for name in self.model.states]

    @cached_property
    def kinds(self) -> tuple[list[int], list[int]]:
        """Places of torques and currents among all that is stored, and of the rest."""
        through = [k for k, name in enumerate(self._stores.names) if name in self._stores.through]
        return through, [k for k in range(len(self._stores.names)) if k not in through]


def _jet(quantity: Expr, rows: Rows) -> tuple[Expr, ...]:
    """A quantity and its derivatives by time along the motion."""
    made = [quantity]
    for _ in range(1, DATA):
        parts = (slope(made[-1], state) * rate for state, rate in zip(rows.states, rows.rates, strict=True))
        made.append(slope(made[-1], TIME) + Add(*parts))
    return tuple(made)
