"""The machine code of one set of equations for many variants side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from sympy import Add, Dummy, Expr

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.codegen.machine_program import Terms, jumping
from shaftwork.codegen.taylor.heyoka_parameters import Fixed
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.hermite import JET
from shaftwork.numerics.lane_functions import LANES
from shaftwork.numerics.machine_code import LaneBody, lane_function
from shaftwork.results.measures import EXTREMES, POWERS
from shaftwork.sweep.lane_loops import follow
from shaftwork.sweep.lane_step import STAGES, ControlledQuantity, StepWriter
from shaftwork.sweep.lane_tables import LaneCourse, LaneEnd, LaneRow, Met

OF_A_STEP, LOOSEST_TOLERANCE, TIGHTEST_TOLERANCE = 0.1, 1e-7, 1e-13
"""The tolerance of a step as a part of that of the motion, since errors add up, and its bounds: what is measured inside
looser steps is off by more than their ends are, and tighter ones are rounding."""


class LaneProgram:
    """The rates of variants, what is seen of their motion, and what is asked for where they change their modes.

    Args:
        rows: the explicit state equations.
        guards: that end a lane where they rise through zero on their side.
        quantities: what is measured.
        kinds: of each of them the measure that is wanted.
        stored: what goes over to other equations.

    Raises:
        CompileError: a law has no machine code.
    """

    def __init__(
        self,
        rows: Rows,
        guards: Sequence[Expr],
        quantities: Sequence[Expr],
        kinds: Sequence[str],
        stored: Sequence[Expr],
    ) -> None:
        self._parts = {"rates": rows.rates, "guards": tuple(guards), "shown": tuple(quantities), "stored": stored}
        seen = MonitoredQuantities(rows, guards, quantities, kinds)
        points = [one for part in self._parts.values() for one in part]
        expressions = (*seen.slopes, *seen.motion.definitions.values(), *seen.monitored, *points)
        self._fixed = Fixed(rows.parameters, (*rows.states, TIME, *seen.motion.definitions), expressions)
        self._places = {x: ("y", k) for k, x in enumerate(rows.states)}
        self._places |= {symbol: ("p", k) for k, symbol in enumerate(rows.parameters)}
        self._places |= {part: ("p", len(rows.parameters) + k) for part, k in self._fixed.places.items()}
        self.guards, self.switches = len(guards), len(seen.jumps)
        """How many guards there are, and how many switches of laws behind them."""
        self.integrated = [k for k, kind in enumerate(kinds) if kind in POWERS]
        """Which measures are integrals."""
        self._place, self._signs = seen.rows(len(rows.parameters) + len(self._fixed.places)), seen.signs
        here = {"moment": 0, "y": 1, "p": 1 + len(rows.states)}
        try:
            self._points = lane_function(partial(self._write, values=points, definitions={}), here)
            self._compile(seen)
        except NumbaError as error:
            raise CompileError(f"A law has no machine code: {error}") from error

    def _compile(self, seen: MonitoredQuantities) -> None:
        """Compile what follows a motion."""
        place = self._place
        write = partial(lane_function, rows={row.name.lower(): int(place[row]) for row in LaneRow})
        rates = write(partial(self._write, values=seen.slopes, definitions={}))
        jets = write(partial(self._write, values=seen.monitored, definitions=seen.motion.definitions))
        slopes, monitored = (rates.address, int(place[LaneRow.SLOPES])), (jets.address, int(place[LaneRow.MONITORED]))
        steps = seen.steps(slopes, monitored)
        probe = write(steps.probe)
        advance = write(partial(steps.advance, probe=probe.address))
        self._code = rates, jets, probe, advance, write(steps.look)
        counts = seen.states, seen.moving, len(seen.signs), self.guards + self.switches, self.switches
        self._tables = np.array([*place, *(code.address for code in self._code[1:]), *counts])

    def _write(self, body: LaneBody, values: Sequence[Expr], definitions: Mapping[Dummy, Expr]) -> None:
        terms = Terms(body, self._fixed, self._places)
        for symbol, value in definitions.items():
            terms.define(symbol, value)
        for place, value in enumerate(values):
            body.write(place, terms.value(value))

    def parameters(self, p: Array) -> Array:
        """(parameters, k) those of the model and what is fixed by them, from those of the model alone."""
        return np.concatenate([p, self._fixed.values(p)])

    def follow(self, course: LaneCourse, sizes: Array, rtol: float, span: tuple[float, float]) -> LaneEnd:
        """Follow variants up to a guard, their end, or what they cannot pass.

        Args:
            course: of all of them.
            sizes: (n,) nominal, of the states.
            rtol: relative tolerance.
            span: start and end of the motion, s.
        """
        rows, states = self._rows(course, sizes, rtol, span), len(sizes)
        now, probe, there = np.zeros((3, self._place[LaneRow.HEIGHT], LANES))
        now[LaneRow.VARIANT] = -1
        follow(self._tables, rows, now, probe, there, np.zeros((LANES * JET, 10)), float(span[1]))
        best, x = course.best.copy(), self._array(rows, LaneRow.X)
        for (measure, _), values in zip(self._signs, self._array(rows, LaneRow.BEST), strict=True):
            best[measure] = np.maximum(best[measure], values)
        return LaneEnd(
            rows[LaneRow.TIME], x[:states], best, rows[LaneRow.STEP], x[states:], rows[LaneRow.MET].astype(int)
        )

    def _array(self, rows: Array, name: LaneRow) -> Array:
        return rows[self._place[name] : self._place[name + 1]]

    def _rows(self, course: LaneCourse, sizes: Array, rtol: float, span: tuple[float, float]) -> Array:
        """What is loaded of each variant, in columns."""
        rows, measures = np.zeros((self._place[LaneRow.Y], course.t.size)), [measure for measure, _ in self._signs]
        rows[LaneRow.TOLERANCE] = step_tolerance(rtol)
        rows[LaneRow.LONGEST], rows[LaneRow.ACTIVE], rows[LaneRow.MET] = (span[1] - span[0]) / 50, 1.0, Met.GIVEN_UP
        values: dict[LaneRow, Any] = {
            LaneRow.VARIANT: range(course.t.size),
            LaneRow.TIME: course.t,
            LaneRow.HIGH: course.highs,
            LaneRow.END: course.ends,
            LaneRow.STEP: course.steps,
            LaneRow.BEGUN: course.t,
            LaneRow.NOMINAL: sizes[:, None],
            LaneRow.BEST: course.best[measures],
            LaneRow.LOWS: np.inf,
            LaneRow.SIGNS: np.array([sign for _, sign in self._signs])[:, None],
            LaneRow.SIDES: course.sides,
            LaneRow.OFFSETS: course.offsets,
            LaneRow.P: course.p,
        }
        for row, value in values.items():
            self._array(rows, row)[:] = value
        self._array(rows, LaneRow.X)[: len(sizes)] = course.x
        return rows

    def points(self, t: Array, x: Array, p: Array) -> dict[str, Array]:
        """Rates, guards, what is shown and what is stored, (values, k) each, of k variants.

        Args:
            t: (k,) s.
            x: (n, k) states.
            p: (parameters, k) with what is fixed by them.
        """
        counts, blocks = [len(part) for part in self._parts.values()], -(-t.size // LANES)
        count = 1 + len(x) + len(p)
        rows, memory = np.zeros((count, blocks * LANES)), np.empty((blocks, count + sum(counts), LANES))
        rows[0, : t.size], rows[1 : 1 + len(x), : t.size], rows[1 + len(x) :, : t.size] = t, x, p
        memory[:, :count] = rows.reshape(count, blocks, LANES).swapaxes(0, 1)
        run, start, length = self._points.ctypes, memory.ctypes.data, memory.strides[0]
        for block in range(blocks):
            run(start + block * length, count)
        values = memory[:, count:].swapaxes(0, 1).reshape(sum(counts), blocks * LANES)[:, : t.size]
        return dict(zip(self._parts, np.split(values, np.cumsum(counts)[:-1]), strict=True))


class MonitoredQuantities:
    """What is watched in a motion, and which quantities control the step by their error.

    Args:
        rows, guards, quantities, kinds: as for `LaneProgram`.
    """

    def __init__(self, rows: Rows, guards: Sequence[Expr], quantities: Sequence[Expr], kinds: Sequence[str]) -> None:
        self.jumps = jumping(rows.states, (*rows.rates, *quantities))
        self.signs = [(k, sign) for k, kind in enumerate(kinds) for sign in EXTREMES.get(kind, ())]
        """Of extremes the measure and the sign."""
        seen = [*(quantities[k] for k, _ in self.signs), *guards, *self.jumps]
        self._watched, self.states = len(seen) - len(self.signs), len(rows.states)
        integrated = [(quantities[k], POWERS[kind]) for k, kind in enumerate(kinds) if kind in POWERS]
        self.moving = self.states + len(integrated)
        timed = [one for one in dict.fromkeys(seen) if one.has(TIME)]
        self.slopes = (*rows.rates, *(quantity**power for quantity, power in integrated), *timed)
        self.motion, controlled = _Derivatives(rows), dict[Expr, ControlledQuantity]()
        self.monitored = [derivative for one in seen for derivative in self.motion.jet(one)]
        for quantity in dict.fromkeys((*quantities, *timed)):
            columns = tuple(k for k, x in enumerate(rows.states) if x in quantity.free_symbols)
            row = self.moving + timed.index(quantity) if quantity in timed else None
            controlled[quantity] = ControlledQuantity(len(self.monitored), columns, quantity in quantities, row)
            self.monitored += [quantity, *(slope(quantity, rows.states[k]) for k in columns)]
        self._integrals = [(controlled[quantity], power) for quantity, power in integrated]
        self._controlled = controlled

    def steps(
        self, slopes: tuple[Any, int], monitored: tuple[Any, int], kind: type[StepWriter] = StepWriter
    ) -> StepWriter:
        """What makes steps, with what writes slopes and monitored values, and their first rows."""
        signs = [sign for _, sign in self.signs]
        return kind(
            slopes, monitored, len(self.slopes), self.states, self._integrals, [*self._controlled.values()], signs,
            self._watched,
        )  # fmt: skip

    def rows(self, parameters: int) -> Index:
        """Where all arrays stand, one behind the other, with so many parameters; the others have one row."""
        states, moving, slopes, extremes, watched = (
            self.states, self.moving, len(self.slopes), len(self.signs), self._watched,
        )  # fmt: skip
        sizes = {"nominal": states, "x": moving, "y": moving, "new": moving, "last_x": moving}
        sizes |= {"slopes": STAGES * slopes, "fifth": slopes, "third": slopes, "fifths": states, "thirds": states}
        sizes |= {"monitored": len(self.monitored), "last_monitored": JET * (extremes + watched), "best": extremes}
        sizes |= {"lows": extremes, "signs": extremes, "sides": watched, "offsets": watched, "p": parameters}
        return np.cumsum([0, *(sizes.get(row.name.lower(), 1) for row in LaneRow if row is not LaneRow.HEIGHT)])


def step_tolerance(rtol: float) -> float:
    """The tolerance of a step for that of the motion."""
    return min(max(OF_A_STEP * rtol, TIGHTEST_TOLERANCE), LOOSEST_TOLERANCE)


def lane_program(
    rows: Rows, guards: tuple[Expr, ...], quantities: tuple[Expr, ...], kinds: tuple[str, ...], stored: tuple[Expr, ...]
) -> LaneProgram:
    """The program for all networks with these expressions; arguments as for `LaneProgram`."""
    key = rows.states, rows.parameters, rows.rates, guards, quantities, kinds, stored
    return _programs(key, lambda: LaneProgram(rows, guards, quantities, kinds, stored))


_programs = BoundedCache[tuple[object, ...], LaneProgram](64)


class _Derivatives:
    """Derivatives by time along a motion.

    Args:
        rows: its equations.
    """

    def __init__(self, rows: Rows) -> None:
        self._rates = dict(zip(rows.states, rows.rates, strict=True))
        self.definitions: dict[Dummy, Expr] = {}
        """What stands for rates of states and for their derivatives by time; each after those in it."""
        self._named: dict[Expr, Dummy] = {}

    def jet(self, quantity: Expr) -> tuple[Expr, ...]:
        """A quantity and its first two derivatives."""
        first = self._moved(quantity)
        return quantity, first, self._moved(first)

    def _moved(self, quantity: Expr) -> Expr:
        """The derivative of what may hold rates, by their symbols."""
        moving = [symbol for symbol in quantity.free_symbols if symbol in self._rates or symbol in self.definitions]
        parts = [slope(quantity, symbol) * self._rate(symbol) for symbol in sorted(moving, key=str)]
        return Add(slope(quantity, TIME), *parts)

    def _rate(self, symbol: Expr) -> Dummy:
        """What stands for the derivative of a state, or of a rate."""
        if symbol not in self._named:
            rate = self._rates[symbol] if symbol in self._rates else self._moved(self.definitions[symbol])
            self._named[symbol] = Dummy(real=True)
            self.definitions[self._named[symbol]] = rate
        return self._named[symbol]
