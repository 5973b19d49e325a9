"""A motion together with its derivatives by parameters, through all that changes on the way.

The variational equation is linear along a motion that is known, and is solved by Gauss collocation. All steps are made
at once: a step takes Y to (1 + P) Y + Q, whatever Y is, so P and Q of every step come from one stack of linear systems,
and only their products follow one after another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import AccuracyWarning, ParameterError, SimulationError
from shaftwork.core.notices import warn
from shaftwork.formulation.observables import Observables
from shaftwork.numerics.polynomials import to_integrals
from shaftwork.numerics.tolerances import SAME, TYPED
from shaftwork.numerics.zeros import zero
from shaftwork.pipeline.model import Model
from shaftwork.results.observer import blocks
from shaftwork.sensitivities.carrying import End, SensitivityTransfer
from shaftwork.sensitivities.differentiation import Differentiated, ValueWithSlopes, rows_of
from shaftwork.sensitivities.legs import DifferentiatedMotion, Leg, parted
from shaftwork.sensitivities.saltation import ADVICE, Jump, JumpConditions, by_chance

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_state import Transition

STAGES = 6
"""Of a step: order 12, and no stage on its ends, where laws jump."""

Coefficients = Callable[[Array], tuple[Array, Array]]
"""From times (k,) to A (k, N, n) and B (k, N, m) of Y' = A Y[:n] + B; rows behind the first n are mere integrals."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(STAGES)
NODES = (_POINTS + 1) / 2
# integrals from the start of a step to each node and to its end, from values at the nodes
_TO_NODES, _TO_END = to_integrals(_POINTS) / 2, _WEIGHTS / 2


@dataclass(frozen=True, eq=False)
class Variation:
    """The solution of the variational equation over a span of time.

    Args:
        coefficients: A and B.
        ends: (s,) ends of the steps, s.
        values: (s, N, m) Y there.
    """

    coefficients: Coefficients
    ends: Array
    values: Array

    def at(self, t: float) -> Array:
        """(N, m) Y at a time in s."""
        k = int(np.clip(np.searchsorted(self.ends, t, side="right") - 1, 0, len(self.ends) - 1))
        length = t - self.ends[k]
        if length == 0.0 or k == len(self.ends) - 1:
            return np.asarray(self.values[k])
        return _stepped(_maps(self.coefficients, self.ends[k : k + 1], np.array([length]))[0], self.values[k])


def variation(
    coefficients: Coefficients, ends: Array, start: Array, sizes: Array, least: Array, rtol: float
) -> Variation:
    """Solve Y' = A Y[:n] + B; steps are halved until the halves say the same.

    Args:
        coefficients: A and B, smooth between the first and the last of the ends; never asked for there.
        ends: (s,) ends of the steps of the run, increasing, s.
        start: (N, m) Y at the first of them.
        sizes: (N,) sizes of what Y are the slopes of: those of one parameter are held against each other by them.
        least: (m,) slopes, as parts of those sizes, below which all is rounding.
        rtol: error of a step, as a part of the largest slope by the same parameter so far.

    Raises:
        SimulationError: it takes too many steps, or there is no value.
    """
    # Eight steps of the run are one at first: an implicit method need not follow what has died away.
    ends = np.append(ends[:-1:8], ends[-1])
    begins, lengths = ends[:-1], np.diff(ends)
    steps = _Steps(begins, lengths, _maps(coefficients, begins, lengths), np.zeros(len(lengths), dtype=bool))
    while True:
        parts, whole = _parted(coefficients, steps)
        values = _passed(parts.maps, start)
        errors = np.abs(_stepped(steps.maps[~steps.right], values[whole]) - values[whole + 2])
        largest = np.maximum.accumulate((np.abs(values) / sizes[:, None]).max(axis=1, initial=0.0), axis=0)
        scale = sizes[:, None] * np.maximum(largest, least)[:, None]
        # Two halves are more than 64 times as close to the solution as to the whole.
        accurate = (errors <= 64 * rtol * scale[whole + 2]).all(axis=(1, 2))
        parts.right[whole] = parts.right[whole + 1] = accurate
        if parts.right.all():
            return Variation(coefficients, np.append(parts.begins, ends[-1]), values)
        if len(parts.begins) > 1_000_000 or not np.isfinite(values).all():
            worst = int(np.argmin(parts.right))
            raise SimulationError(f"The sensitivities could not be integrated beyond t = {parts.begins[worst]:.9g} s.")
        steps = parts


class _Steps(NamedTuple):
    """Steps in a row.

    Args:
        begins: (s,) s.
        lengths: (s,) s.
        maps: (s, N, n + m) see `_maps`.
        right: (s,) which of them need no smaller ones.
    """

    begins: Array
    lengths: Array
    maps: Array
    right: NDArray[np.bool_]


def _parted(coefficients: Coefficients, steps: _Steps) -> tuple[_Steps, NDArray[np.intp]]:
    """Two halves for each step that is not right, and where the first ones are."""
    order = np.repeat(np.arange(len(steps.begins)), np.where(steps.right, 1, 2))
    first, halved = np.append(True, order[1:] != order[:-1]), ~steps.right[order]
    lengths = np.where(halved, steps.lengths[order] / 2, steps.lengths[order])
    begins = np.where(first, steps.begins[order], steps.begins[order] + lengths)
    maps = steps.maps[order]
    maps[halved] = _maps(coefficients, begins[halved], lengths[halved])
    return _Steps(begins, lengths, maps, ~halved), np.flatnonzero(first & halved)


def _passed(maps: Array, start: Array) -> Array:
    """(s + 1, N, m) Y before the first step and after each."""
    values = np.empty((len(maps) + 1, *start.shape))
    values[0] = start
    for k, one in enumerate(maps):
        values[k + 1] = _stepped(one, values[k])
    return values


def _stepped(maps: Array, before: Array) -> Array:
    """(..., N, m) Y after steps, from Y before them."""
    size = maps.shape[-1] - before.shape[-1]
    return np.asarray(before + maps[..., :size] @ before[..., :size, :] + maps[..., size:])


def _maps(coefficients: Coefficients, begins: Array, lengths: Array) -> Array:
    """(s, N, n + m) of each step P and, beside it, Q."""
    A, B = coefficients((begins[:, None] + lengths[:, None] * NODES).ravel())
    (_, every, size), columns = A.shape, A.shape[2] + B.shape[2]
    both = np.concatenate([A, B], axis=2).reshape(len(begins), STAGES, every, columns)
    maps = np.empty((len(begins), every, columns))
    for steps in blocks(len(begins), (STAGES * size) ** 2):
        maps[steps] = _solved(both[steps], size, lengths[steps])
    return maps


def _solved(both: Array, size: int, lengths: Array) -> Array:
    """The same for as many steps as are solved at once, from A and B (s, stages, N, n + m)."""
    count, columns = len(both), both.shape[-1]
    h = lengths[:, None, None, None]
    # K_i = A_i (Y + h sum_j a_ij K_j) + B_i for the slopes K at the stages
    system = -np.einsum("s,ij,sipq->sipjq", lengths, _TO_NODES, both[:, :, :size, :size])
    system = system.reshape(count, STAGES * size, STAGES * size) + np.eye(STAGES * size)
    right = both[:, :, :size].reshape(count, STAGES * size, columns)
    K = np.linalg.solve(system, right).reshape(count, STAGES, size, columns)
    moved = h * np.einsum("ij,sjpc->sipc", _TO_NODES, K)
    beside = both[:, :, size:] + both[:, :, size:, :size] @ moved
    return np.asarray(lengths[:, None, None] * np.einsum("i,sipc->spc", _TO_END, np.concatenate([K, beside], axis=2)))


class MotionSlopes:
    """The derivatives of a motion by parameters.

    Args:
        motion: the motion.
        parameters: m of them with their values in SI.
        quantities: names of what is read.
        integrands: name and power of what is integrated over time.
        rtol: relative tolerance of the derivatives.

    Raises:
        CompileError: some equations are too large to be symbolic.
        ParameterError: a quantity is none that has a derivative.
        SimulationError: there is no derivative.
    """

    def __init__(
        self,
        motion: DifferentiatedMotion,
        parameters: Mapping[str, float],
        quantities: Sequence[str],
        integrands: Sequence[tuple[str, int]],
        rtol: float,
    ) -> None:
        self._motion, self._rtol = motion, rtol
        self.parameters = np.array(list(parameters.values()))
        """(m,) in SI."""
        self._symbols = tuple(Symbol(name, real=True) for name in parameters)
        self._quantities, self._integrands = tuple(quantities), tuple(integrands)
        self._equations: dict[Model, Differentiated] = {}
        self.legs = tuple(part for leg in motion.legs for part in parted(leg, self.equations(leg.model)))
        self._sizes: dict[Model, Array] = {}
        self._swiftest: dict[Model, Array] = {}
        for leg in self.legs:
            self._measure(leg)
        self._variations: list[Variation] = []
        self._shifts: list[Array | None] = []
        self._integrate()

    def equations(self, model: Model) -> Differentiated:
        """The equations of a model with their derivatives; made once."""
        if model not in self._equations:
            rows = rows_of(model)
            expressed = Observables(model.form, rows)
            quantities = {name: _expression_of(name, expressed) for name in self._quantities}
            integrands = [quantities[name] ** power for name, power in self._integrands]
            self._equations[model] = Differentiated(model.form, rows, self._symbols, quantities, integrands)
        return self._equations[model]

    def _measure(self, leg: Leg) -> None:
        """Sizes of states, and of rates, as far as they go in a leg."""
        times, states = leg.read(leg.steps)
        rates = self.equations(leg.model).rates(times, states, leg.p)
        for sizes, seen in ((self._sizes, states), (self._swiftest, rates)):
            largest = np.abs(seen).max(axis=0, initial=0.0)
            sizes[leg.model] = np.maximum(sizes.get(leg.model, 0.0), largest)

    def sizes(self, model: Model) -> Array:
        """(n,) of the states of a model: the largest values, one where it is zero throughout."""
        largest = self._sizes.get(model, np.zeros(len(model.states)))
        return np.where(largest > 0, largest, 1.0)

    def _integrate(self) -> None:
        motion, count = self._motion, len(self._symbols)
        sets = motion.equation_sets
        carrying = None if sets is None else SensitivityTransfer(sets, self.equations, self.sizes)
        length, fixed = self.legs[-1].end - self.legs[0].start, np.zeros(count)
        jumps = JumpConditions(self.equations, carrying, self.sizes, self._swiftest.__getitem__, length)
        slopes = np.zeros((self._swiftest[self.legs[0].model].size, count))
        if carrying is not None and motion.start is not None:
            size, first = len(self.legs[0].model.states), np.zeros((len(motion.start.model.states), count))
            loose, leg = motion.start, self.legs[0]
            end = End(loose.at(loose.high)[1], leg.at(leg.low)[1], first, fixed)
            slopes[:size] = carrying.over(loose, leg, [end], self._transitions(leg))[1]
        self._shifts.append(fixed)
        doubts: list[tuple[float, float]] = []
        last: Jump | None = None
        for k, leg in enumerate(self.legs):
            if k:
                jump = jumps.over(self.legs[k - 1], leg, slopes, self._transitions(leg))
                if last is not None and self.legs[k - 1].end - self.legs[k - 1].start <= TYPED * length:
                    self._refuse_chance(leg, last, jump, length)
                slopes, last = jump.slopes, jump
                self._shifts.append(jump.shift)
                doubts.append((jump.doubt, leg.start))
            self._variations.append(self._along(leg, slopes, length))
            slopes = self._variations[-1].values[-1]
        self._shifts.append(fixed)
        _warn(*max(doubts, default=(0.0, 0.0)))

    def _refuse_chance(self, leg: Leg, first: Jump, second: Jump, length: float) -> None:
        """Refuse two jumps so close to each other that they come together, where either may be first."""
        if first.adds and second.adds:
            return
        if first.shift is not None and second.shift is not None:
            apart, largest = np.abs(first.shift - second.shift), np.maximum(np.abs(first.shift), np.abs(second.shift))
            # Both depend on parameters alike where the derivatives of their times differ by less than a thousandth of
            # them, or of the run for all of a parameter.
            if (apart <= 1e-3 * (largest + length * self._inverse)).all():
                return  # the second follows from the first
        raise by_chance(leg, "several changes")

    def _along(self, leg: Leg, slopes: Array, length: float) -> Variation:
        """The derivatives along a leg, from those at its start."""
        integrals = self._swiftest[leg.model][len(leg.model.states) :] * length
        sizes = np.concatenate([self.sizes(leg.model), np.where(integrals > 0, integrals, 1.0)])
        # Below a thousandth of a state's size, what a parameter does by all of itself is rounding.
        return variation(self._coefficients(leg), leg.steps, slopes, sizes, 1e-3 * self._inverse, self._rtol)

    @property
    def _inverse(self) -> Array:
        """(m,) one over the size of each parameter."""
        return np.asarray(1 / np.where(self.parameters == 0.0, 1.0, np.abs(self.parameters)))

    def _coefficients(self, leg: Leg) -> Coefficients:
        equations = self.equations(leg.model)
        return lambda times: equations.coefficients(*leg.read(times), leg.p)

    def _transitions(self, leg: Leg) -> list[Transition]:
        return [] if leg.turned else [one for one in self._motion.transitions if one.time == leg.start]

    @cached_property
    def steps(self) -> Array:
        """Times between which everything is smooth, s."""
        return np.unique(np.concatenate([leg.steps for leg in self.legs]))

    @cached_property
    def _starts(self) -> Array:
        return np.array([leg.start for leg in self.legs])

    def _leg_at(self, times: Array) -> Array:
        return np.clip(np.searchsorted(self._starts, times, side="right") - 1, 0, None)

    def values(self, quantity: str, times: Array) -> Array:
        """(k,) a quantity at times (k,) in s; where two legs meet, in the later one."""
        values, index = np.empty(len(times)), self._leg_at(times)
        for number in np.unique(index).tolist():
            leg, here = self.legs[number], index == number
            times_there, states = leg.read(times[here])
            values[here] = self._shown(quantity, leg).value(times_there, states, leg.p)[:, 0]
        return values

    def slopes(self, quantity: str, t: float) -> Array:
        """(m,) derivatives of a quantity at a time in s; at the end of a leg, of what is there, whenever that is.

        Raises:
            SimulationError: several changes come together there, and it is not known which one counts.
        """
        number = int(self._leg_at(np.array([t]))[0])
        leg, near = self.legs[number], SAME * (self.legs[-1].end - self.legs[0].start)
        times, states = leg.read(np.array([t]))
        shown = self._shown(quantity, leg)
        by_states, by_parameters, _ = shown.slopes(float(times[0]), states[0], leg.p)
        total = by_states @ self._variations[number].at(t)[: len(by_states)] + by_parameters
        end = number if t - leg.start <= near else number + 1 if leg.end - t <= near else None
        if end is None or not (rate := self._rate(quantity, leg, t)):
            return np.asarray(total)
        shift = self._shifts[end]
        if shift is None:
            raise SimulationError(
                f"'{quantity}' has its extreme at t = {t:.9g} s, where several things change together, and there is no "
                f"derivative. {ADVICE}"
            )
        return np.asarray(total + rate * shift)

    def turning(self, quantity: str, t: float) -> float:
        """The time in s at which a quantity turns, from one that is near it; this one where it does not turn there.

        A value tells the time of its extreme to half of its digits alone, a rate tells it to all of them.
        """
        leg = self.legs[int(self._leg_at(np.array([t]))[0])]
        k = int(np.clip(np.searchsorted(leg.steps, t), 1, len(leg.steps) - 1))
        # A thousandth of a step beside its extreme the quantity shows where it turns.
        aside = 1e-3 * (leg.steps[k] - leg.steps[k - 1])
        low, high = max(t - aside, leg.low), min(t + aside, leg.high)
        if self._rate(quantity, leg, low) * self._rate(quantity, leg, high) < 0:
            return zero(lambda time: np.array([self._rate(quantity, leg, time[0])]), low, high, xtol=aside * SAME)
        return t

    def _shown(self, quantity: str, leg: Leg) -> ValueWithSlopes:
        equations = self.equations(leg.model)
        return equations.shown(equations.quantities[quantity])

    def _rate(self, quantity: str, leg: Leg, t: float) -> float:
        times, states = leg.read(np.array([t]))
        by_states, _, by_time = self._shown(quantity, leg).slopes(float(times[0]), states[0], leg.p)
        return float(by_states @ self.equations(leg.model).rates(times, states, leg.p)[0, : len(by_states)] + by_time)

    def integrals(self) -> Array:
        """(integrands, m) derivatives of the integrals over the motion."""
        size = len(self.legs[-1].model.states)
        return np.asarray(self._variations[-1].values[-1][size:])


def _warn(doubt: float, t: float) -> None:
    if doubt > 1e-6:
        warn(
            f"Sensitivities are right to some {doubt:.0e} only: at t = {t:.9g} s something changes that is hardly "
            "moving any more. Of rigid contacts a larger omega_rest helps.",
            AccuracyWarning,
        )


def _expression_of(name: str, expressed: Observables) -> Expr:
    expression = expressed.quantity(name)
    if expression is None:
        raise ParameterError(f"'{name}' has no derivative here. Take a speed, a torque or a twist.")
    return expression
