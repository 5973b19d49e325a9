"""A motion together with its derivatives by parameters, through all that changes on the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sympy import Dummy, Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import AccuracyWarning, ParameterError, SimulationError
from shaftwork.core.notices import warn
from shaftwork.formulation.observables import Observables
from shaftwork.numerics.tolerances import SAME, TYPED
from shaftwork.numerics.zeros import zero
from shaftwork.pipeline.model import Model
from shaftwork.sensitivities.differentiation import Differentiated, ValueWithSlopes, rows_of
from shaftwork.sensitivities.jump_conditions import ADVICE, Jump, JumpConditions, by_chance
from shaftwork.sensitivities.legs import DifferentiatedMotion, Leg, parted
from shaftwork.sensitivities.sensitivity_transfer import End, SensitivityTransfer
from shaftwork.sensitivities.variation import Coefficients, Variation, variation

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_state import Transition


class DifferentiatedEquations:
    """The equations of every model with their derivatives by parameters, each made once.

    Args:
        parameters: names of parameters, which come first among the m.
        starts: names of states whose start values are the rest of the m.
        quantities: names of what is read.
        integrands: name and power of what is integrated over time.
    """

    def __init__(
        self,
        parameters: Sequence[str],
        starts: Sequence[str],
        quantities: Sequence[str],
        integrands: Sequence[tuple[str, int]],
    ) -> None:
        self._quantities, self._integrands = tuple(quantities), tuple(integrands)
        # a start value stands in no equation, only its state does
        self._symbols = (*(Symbol(name, real=True) for name in parameters), *(Dummy(real=True) for _ in starts))
        self._equations: dict[Model, Differentiated] = {}

    def __call__(self, model: Model) -> Differentiated:
        """Those of a model.

        Raises:
            CompileError: they are too large to be symbolic.
            ParameterError: a quantity is none that has a derivative.
        """
        if model not in self._equations:
            rows = rows_of(model)
            expressed = Observables(model.form, rows)
            quantities = {name: _expression_of(name, expressed) for name in self._quantities}
            integrands = [quantities[name] ** power for name, power in self._integrands]
            self._equations[model] = Differentiated(model.form, rows, self._symbols, quantities, integrands)
        return self._equations[model]


class MotionSlopes:
    """The derivatives of a motion by parameters.

    Args:
        motion: the motion.
        equations: with their derivatives by m parameters.
        parameters: (m,) their values in SI.
        first: (n, m) derivatives of the states at the start, in the equations in which nothing is joined.
        rtol: relative tolerance of the derivatives.

    Raises:
        CompileError: some equations are too large to be symbolic.
        ParameterError: a quantity is none that has a derivative.
        SimulationError: there is no derivative.
    """

    def __init__(
        self,
        motion: DifferentiatedMotion,
        equations: DifferentiatedEquations,
        parameters: Array,
        first: Array,
        rtol: float,
    ) -> None:
        self._motion, self.equations, self.parameters, self._rtol = motion, equations, parameters, rtol
        self._first = first
        self.legs = tuple(part for leg in motion.legs for part in parted(leg, self.equations(leg.model)))
        self._sizes: dict[Model, Array] = {}
        self._swiftest: dict[Model, Array] = {}
        for leg in self.legs:
            self._measure(leg)
        self._variations: list[Variation] = []
        self._shifts: list[Array | None] = []
        self._integrate()

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
        motion, count = self._motion, self.parameters.size
        sets = motion.equation_sets
        transfer = None if sets is None else SensitivityTransfer(sets, motion.values, self.equations, self.sizes)
        length, fixed = self.legs[-1].end - self.legs[0].start, np.zeros(count)
        jumps = JumpConditions(self.equations, transfer, self.sizes, self._swiftest.__getitem__, length)
        leg = self.legs[0]
        size, slopes = len(leg.model.states), np.zeros((self._swiftest[leg.model].size, count))
        if transfer is None or motion.start is None:
            slopes[:size] = self._first
        else:
            loose = motion.start
            end = End(loose.at(loose.high)[1], leg.at(leg.low)[1], self._first, fixed)
            slopes[:size] = transfer.over(loose, leg, [end], self._transitions(leg))[1]
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
        total = by_states @ self._variations[number].at(np.array([t]))[0, : len(by_states)] + by_parameters
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

    def along(self, quantity: str, times: Array) -> Array:
        """(k, m) derivatives of a quantity at times (k,) in s; where two legs meet, in the later one."""
        slopes = np.empty((len(times), self.parameters.size))
        for leg, here, read, states, dx in self._last_read(times.tobytes(), lambda: tuple(self._read(times))):
            by_states, by_parameters = self._shown(quantity, leg).along(read, states, leg.p)
            slopes[here] = (by_states[:, None, :] @ dx)[:, 0] + by_parameters
        return slopes

    def _read(self, times: Array) -> Iterator[tuple[Leg, NDArray[np.bool_], Array, Array, Array]]:
        """By leg: which of the times are in it, the times moved inside, states and their derivatives."""
        index = self._leg_at(times)
        for number in np.unique(index).tolist():
            leg, here = self.legs[number], index == number
            read, states = leg.read(times[here])
            yield leg, here, read, states, self._variations[number].at(times[here])[:, : states.shape[1]]

    @cached_property
    def _last_read(self) -> BoundedCache[bytes, tuple[tuple[Leg, NDArray[np.bool_], Array, Array, Array], ...]]:
        return BoundedCache(1)  # several quantities are read at the same times

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
