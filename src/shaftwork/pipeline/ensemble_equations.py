"""One set of equations of many variants: programs, and whether modes are consistent with the motion in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.codegen.expressed import Expressed
from shaftwork.codegen.lanes import LaneFunction, LaneProgram, lane_function, lane_program
from shaftwork.codegen.stores import Stores
from shaftwork.core.errors import CompileError
from shaftwork.integrate.lanes import Lanes
from shaftwork.pipeline.assemblies import Assembly, ModeNames
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.moments import CLEAR, EPS, GOLDEN, NOTHING, ROUNDINGS
from shaftwork.pipeline.prepared import NOMINAL
from shaftwork.pipeline.settling import AHEAD, AHEAD_OF_RUN, FEW
from shaftwork.results.measures import Measure

WITHIN = 1e-9
"""A guard that is beyond its limit by more than this part of its largest value has been missed."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Entry:
    """Where variants enter a phase.

    Args:
        good: (k,) whether its modes are consistent with the motion.
        offsets: (guards, k) how far beyond zero each guard has to go.
    """

    good: Mask
    offsets: Array


class Equations:
    """The equations of one combination of modes.

    Args:
        model: the compiled network.
        assembly: the equations of the modes, or None where nothing changes its mode.
        modes: the combination.
        first: a variant, of which sizes are taken.
        names: of the parameters that vary.
        measures: what is read.
        span: start and end of the motion, s.

    Raises:
        CompileError: variants cannot run side by side in them.
    """

    def __init__(
        self,
        model: Model,
        assembly: Assembly | None,
        modes: ModeNames,
        first: Mapping[str, float],
        names: Sequence[str],
        measures: Sequence[Measure],
        span: tuple[float, float],
    ) -> None:
        self.model = model if assembly is None else assembly.model
        self._stores = Stores(self.model.form) if assembly is None else assembly.stores
        rows, p = self.model.rows, self.model.vector(first) if assembly is None else None
        numbers = {element.number: element.modes[name].value for element, name in _pairs(assembly, modes)}
        if p is None and assembly is not None:
            p = assembly.vector(first, numbers)
        source = self.model.prepare(p).symbolic() if assembly is None else assembly.program
        program = getattr(source, "program", source)
        if rows is None or program is None or not self.model.states or (assembly is not None and assembly.clocks):
            raise CompileError("These equations have no program of their own.")
        self._base = p
        places = {name: k for k, name in enumerate(self.model.parameters)}
        self._places = [(places[name], column) for column, name in enumerate(names) if name in places]
        self.sides = np.zeros(0) if assembly is None else assembly.sides(modes)
        self._watched = np.flatnonzero(self.sides)
        self._sizes = np.array(self.model.prepare(p).atol if assembly is None else assembly.sizes(p))
        self._tick = ROUNDINGS * float(np.spacing(max(map(abs, span))))
        self._ahead = AHEAD_OF_RUN * (span[1] - span[0])
        self._expressed = Expressed(self.model.form, rows)
        quantities = [self._expressed.quantity(measure.quantity) for measure in measures]
        self._quantities = [found for found in quantities if found is not None]
        if len(self._quantities) < len(quantities):
            raise CompileError("A measure is of a power, an energy or a place along a shaft.")
        powers = {"mean": 1, "rms": 2}
        integrated = [row for row, measure in enumerate(measures) if measure.kind in powers]
        self.integral_of = {row: k for k, row in enumerate(integrated)}
        integrands = [self._quantities[row] ** powers[measures[row].kind] for row in integrated]
        self.program: LaneProgram = lane_program(program, rows, integrands)
        self.shown: LaneFunction = lane_function(rows, self._quantities)

    def parameters(self, columns: Array) -> Array:
        """(parameters, k) for the values (names, k) of those that vary, with what is derived from them."""
        p = np.repeat(np.asarray(self._base)[:, None], columns.shape[1], axis=1)
        for place, column in self._places:
            p[place] = columns[column]
        return self.program.parameters(p)

    @cached_property
    def stored(self) -> LaneFunction:
        """All that is stored, in the order of the names of `codegen.stores.Stores`."""
        rows = self.model.rows
        assert rows is not None  # noqa: S101 (checked when the equations were made)
        return lane_function(rows, [self._expressed.store(name) for name in self._stores.names])

    @cached_property
    def state_rows(self) -> list[int]:
        """For each state, its place among all that is stored."""
        return [self._stores.names.index(name) for name in self.model.states]

    @cached_property
    def through_rows(self) -> list[int]:
        """Places of the torques and currents among all that is stored."""
        return [k for k, name in enumerate(self._stores.names) if name in self._stores.through]

    @cached_property
    def other_rows(self) -> list[int]:
        """Places of the speeds, voltages and angles among all that is stored."""
        return [k for k, name in enumerate(self._stores.names) if name not in self._stores.through]

    def _motion(self, t: Array, x: Array, p: Array) -> tuple[Array, Array]:
        made = self.program.motion(t, x, p)
        return made[: len(x)], made[len(x) :]

    def entered(self, t: Array, x: Array, p: Array) -> Entry:
        """Whether every guard is on its own side, or on its limit and about to be, as `Settling` would find.

        Args:
            t: (k,) s.
            x: (n, k) states.
            p: (parameters, k).
        """
        if not len(self.sides):
            return Entry(np.ones(t.size, dtype=bool), np.zeros((0, t.size)))
        here = self._course(t, x, p)
        (rates, now), (near, moved) = here
        bands = np.abs(near[1] - now)
        inside = self.sides[:, None] * now < -bands
        step = self._step(rates)
        on_limit = self.sides[:, None] * now <= bands
        falls, known = np.zeros_like(inside), np.zeros_like(inside)
        ways = (t, x, rates), (t + self._tick, moved, near[0])
        for _ in range(2):  # where nothing moves yet, its acceleration tells
            ways = self._later(step, *ways[0], p), self._later(step, *ways[1], p)
            gain, other = (self.sides[:, None] * (way[3] - first) for way, first in zip(ways, (now, near[1]), strict=True))
            sure = np.abs(gain) > np.maximum(np.abs(gain - other), FEW * bands / ROUNDINGS)
            falls |= ~known & sure & (gain < 0)
            known |= sure
            ways = ways[0][:3], ways[1][:3]
        good = (inside | (on_limit & falls))[self._watched].all(axis=0)
        value = self.sides[:, None] * now
        clear = np.where(2 * value > -CLEAR * bands, np.maximum(value, 0.0) + CLEAR * bands, bands)
        return Entry(good, np.maximum(clear, NOTHING))

    def _course(self, t: Array, x: Array, p: Array) -> tuple[tuple[Array, Array], tuple[tuple[Array, Array], Array]]:
        """Rates and guards here, and rounding away from here, with the states there."""
        rates, now = self._motion(t, x, p)
        way = np.array([(-1.0) ** k for k in range(len(x))])[:, None]
        part = way * np.array([(0.5 + k * GOLDEN % 1) * ROUNDINGS * EPS for k in range(len(x))])[:, None]
        least = part * self._sizes[:, None] / NOMINAL
        moved = x + part * np.abs(x) + least + way * self._tick * np.abs(rates)
        return (rates, now), (self._motion(t + self._tick, moved, p), moved)

    def _step(self, rates: Array) -> Array:
        """(k,) how far in s the further course is looked at."""
        with np.errstate(divide="ignore"):
            return np.minimum(self._ahead, (AHEAD * self._sizes[:, None] / np.abs(rates)).min(axis=0))

    def _later(self, step: Array, t: Array, x: Array, rates: Array, p: Array) -> tuple[Array, Array, Array, Array]:
        later = x + step * rates
        return t + step, later, *self._motion(t + step, later, p)

    def beyond_doubt(self, t: Array, x: Array, p: Array, before: Equations, guard: int) -> Mask:
        """(k,) whether the motion leaves the guard behind by which these modes were entered.

        That is known where these modes do not watch it, or watch its other side; `entered` looks at all the others.
        """
        same = before.model is self.model and self.sides[guard] == before.sides[guard] != 0.0
        return np.full(t.size, not same) & np.isfinite(x).all(axis=0) & np.isfinite(self._motion(t, x, p)[0]).all(axis=0)

    def stays(self, lanes: Lanes, p: Array, offsets: Array) -> Mask:
        """(k,) whether every guard was on its own side at all times at which a lane was looked at."""
        if not len(self._watched):
            return np.ones(lanes.good.size, dtype=bool)
        x = lanes.x[:, : len(self.model.states)].swapaxes(0, 1)
        guards = self.program.guard_values(lanes.t, x, p)[self._watched] * self.sides[self._watched][:, None, None]
        allowed = WITHIN * np.abs(guards).max(axis=1, keepdims=True) + 2.0 * offsets[self._watched][:, None]
        return np.asarray((guards <= allowed).all(axis=(0, 1)))


def _pairs(assembly: Assembly | None, modes: ModeNames) -> list[tuple[object, str]]:
    return [] if assembly is None else list(zip(assembly.elements, modes, strict=True))
