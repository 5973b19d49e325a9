"""Compiled code for many variants of one set of equations, whatever the numbers of the modes are."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.lane_program import LaneProgram, lane_expressions, lane_function, lane_program
from shaftwork.codegen.lane_step import LaneStep, Use
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.core.errors import CompileError
from shaftwork.pipeline.model import Model
from shaftwork.reduction.symbolic_observables import SymbolicObservables
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

    def __init__(self, model: Model, program: Any, stores: StateTransfer, measures: Sequence[Measure]) -> None:
        if model.rows is None or program is None or not model.states:
            raise CompileError("These equations have no program of their own.")
        self.model, self._rows, self._stores = model, model.rows, stores
        self._expressed = SymbolicObservables(model.form, model.rows)
        quantities = [self._expressed.quantity(measure.quantity) for measure in measures]
        read = [found for found in quantities if found is not None]
        if len(read) < len(quantities):
            raise CompileError("A measure is of a power, an energy or a place along a shaft.")
        self._extremes = [row for row, measure in enumerate(measures) if measure.kind in EXTREMES]
        integrated = [row for row, measure in enumerate(measures) if measure.kind in POWERS]
        self.integral_of = {row: k for k, row in enumerate(integrated)}
        """By measure, which of the integrals behind the states is its."""
        self.program: LaneProgram = lane_program(program, model.rows, read)
        uses = [Use(EXTREMES.get(measure.kind, ()), POWERS.get(measure.kind, 0)) for measure in measures]
        self.step = LaneStep(self.program, tuple(uses))
        self._parts = {"rates": self.program.rates, "guards": self.program.guards, "shown": self.program.quantities}
        stored = [self._expressed.store(name) for name in stores.names] if self.program.guards else []
        self._parts["stored"] = lane_expressions(self._rows, stored)
        made = tuple(one for part in self._parts.values() for one in part)
        self._points = lane_function(made, self.program.variables)
        """What is asked for at the ends of phases."""

    def extreme(self, row: int) -> int:
        """Which of the quantities that a step shows is that of a measure that is an extreme."""
        return self._extremes.index(row)

    def guard(self, number: int) -> int:
        """Which of the quantities that a step shows is a guard."""
        return len(self._extremes) + number

    def motion(self, t: Array, x: Array, p: Array) -> tuple[Array, Array]:
        """Rates (n, k) and guards (guards, k) at times (k,), states (n, k), parameters (parameters, k)."""
        made = self._part(t, x, p)
        return made["rates"], made["guards"]

    def stored(self, t: Array, x: Array, p: Array) -> Array:
        """All that is stored, in the order of the names of `StateTransfer`; arguments as for `motion`."""
        return self._part(t, x, p)["stored"]

    def shown(self, t: Array, x: Array, p: Array) -> Array:
        """What the measures read; arguments as for `motion`."""
        return self._part(t, x, p)["shown"]

    def _part(self, t: Array, x: Array, p: Array) -> dict[str, Array]:
        ends = np.cumsum([len(part) for part in self._parts.values()])[:-1]
        return dict(zip(self._parts, np.split(self._points(t, x, p), ends), strict=True))

    @cached_property
    def state_rows(self) -> list[int]:
        """For each state, its place among all that is stored."""
        return [self._stores.names.index(name) for name in self.model.states]

    @cached_property
    def kinds(self) -> tuple[list[int], list[int]]:
        """Places of torques and currents among all that is stored, and of the rest."""
        through = [k for k, name in enumerate(self._stores.names) if name in self._stores.through]
        return through, [k for k in range(len(self._stores.names)) if k not in through]
