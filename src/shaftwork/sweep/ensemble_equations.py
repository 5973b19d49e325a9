"""One set of equations of many variants: its compiled code, and whether modes are consistent with the motion in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.taylor.heyoka_expressions import Translator
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.observables import Observables
from shaftwork.pipeline.model import Model
from shaftwork.results.measures import EXTREMES, POWERS, Measure
from shaftwork.sweep.lane_step import LaneProgram, LaneStep, lane_function, lane_program
from shaftwork.sweep.lane_steps import Index, Mask

ModeNames = tuple[str, ...]
"""The mode of every element; empty where no part changes its mode."""


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
        self._expressed = Observables(model.form, model.rows)
        quantities = [self._expressed.quantity(measure.quantity) for measure in measures]
        read = [expression for expression in quantities if expression is not None]
        if len(read) < len(quantities):
            raise CompileError("A measure is of a power, an energy or a place along a shaft.")
        self._extremes = [row for row, measure in enumerate(measures) if measure.kind in EXTREMES]
        integrated = [row for row, measure in enumerate(measures) if measure.kind in POWERS]
        self.integral_of = {row: k for k, row in enumerate(integrated)}
        """By measure, which of the integrals behind the states is its."""
        self.program: LaneProgram = lane_program(program, model.rows, read)
        self.step = LaneStep(self.program, tuple(measure.kind for measure in measures))
        self._parts = {"rates": self.program.rates, "guards": self.program.guards, "shown": self.program.quantities}
        stored = [self._expressed.store(name) for name in stores.names] if self.program.guards else []
        self._parts["stored"] = _lane_expressions(self._rows, stored)
        expressions = tuple(one for part in self._parts.values() for one in part)
        self._points = lane_function(expressions, self.program.variables)
        """What is asked for at the ends of phases."""

    def extreme(self, row: int) -> int:
        """Which of the quantities that a step shows is that of a measure that is an extreme."""
        return self._extremes.index(row)

    def guard(self, number: int) -> int:
        """Which of the quantities that a step shows is a guard."""
        return len(self._extremes) + number

    def motion(self, t: Array, x: Array, p: Array) -> tuple[Array, Array]:
        """Rates (n, k) and guards (guards, k) at times (k,), states (n, k), parameters (parameters, k)."""
        parts = self._part(t, x, p)
        return parts["rates"], parts["guards"]

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


def _lane_expressions(rows: Rows, expressions: Sequence[Expr]) -> tuple[Any, ...]:
    """Expressions of a network in heyoka's terms.

    Raises:
        CompileError: one has no counterpart in heyoka.
    """
    translator = Translator(rows.states, TIME, tuple(Symbol(p.name, real=True) for p in rows.parameters))
    translated = tuple(translator.expression(expression) for expression in expressions)
    if translator.switches or translator.held:
        raise CompileError("A store switches by a condition, which variants side by side do not follow.")
    return translated


@dataclass(frozen=True, eq=False)
class PhaseEntry:
    """Where variants enter a phase.

    Args:
        good: (k,) whether its modes are consistent with the motion.
        offsets: (guards, k) how far beyond zero each guard has to go.
    """

    good: Mask
    offsets: Array


class EnsembleEquations:
    """The equations of one combination of modes.

    Args:
        code: its programs.
        base: the parameter vector of a variant.
        sizes: (n,) nominal size of each state, as of that variant.
        names: of the parameters that vary.
    """

    def __init__(self, code: EnsembleCode, base: Array, sizes: Sequence[float], names: Sequence[str]) -> None:
        self.code, self._base, self.sizes = code, base, np.array(sizes)
        places = {name: k for k, name in enumerate(code.model.parameters)}
        self._places = [(places[name], column) for column, name in enumerate(names) if name in places]
        self.sides: Array = np.zeros(0)
        """(guards,) on which each guard is met; 0 where it ends none of the modes."""

    @property
    def watched(self) -> Index:
        """The guards that end one of the modes."""
        return np.flatnonzero(self.sides)

    def parameters(self, columns: Array) -> Array:
        """(parameters, k) for the values (names, k) of those that vary, with what is derived from them."""
        p = np.repeat(np.asarray(self._base)[:, None], columns.shape[1], axis=1)
        for place, column in self._places:
            p[place] = columns[column]
        return self.code.program.parameters(p)

    def entered(self, t: Array, x: Array, p: Array) -> PhaseEntry:  # noqa: ARG002
        """Whether the modes are consistent with the motion in lanes (k,): without guards they are."""
        return PhaseEntry(np.ones(t.size, dtype=bool), np.zeros((0, t.size)))

    def leaves_behind(self, before: EnsembleEquations, guard: int) -> bool:
        """Whether the guard by which these modes were entered is met no more; `entered` looks at all the others."""
        return before.code is not self.code or not self.sides[guard] == before.sides[guard] != 0.0


class Met(IntEnum):
    """What a lane has met where that is no guard: nothing, the end of the motion, or what it cannot pass."""

    NOTHING = -1
    THE_END = -2
    A_LIMIT = -3


@dataclass(frozen=True, eq=False)
class VariantGroup:
    """Variants in the same modes, ready to go on.

    Args:
        modes: of every element; empty where nothing changes its mode.
        lanes: (k,) numbers of the variants.
        t: (k,) s.
        x: (n, k) states.
    """

    modes: ModeNames
    lanes: Index
    t: Array
    x: Array

    def some(self, on: Mask | Index) -> VariantGroup:
        """Those of the lanes (k,) that are marked, or those that are named."""
        return VariantGroup(self.modes, self.lanes[on], self.t[on], self.x[:, on])


def joined(groups: Sequence[VariantGroup]) -> list[VariantGroup]:
    """Groups in the same modes as one."""
    alike: dict[ModeNames, list[VariantGroup]] = {}
    for group in groups:
        if group.lanes.size:
            alike.setdefault(group.modes, []).append(group)
    return [
        VariantGroup(
            modes,
            np.concatenate([one.lanes for one in several]),
            np.concatenate([one.t for one in several]),
            np.concatenate([one.x for one in several], axis=1),
        )
        for modes, several in alike.items()
    ]
