"""Linear motions in as many digits as they need, in whole numbers with a fixed point.

Rates of a network may lie so far apart that floats cannot hold them in one matrix: of 5e-5 1/s no digit is left beside
1e11 1/s. Python's whole numbers have as many digits as it takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.integrate.linear.linear_system import OWN_INTERVALS, are_even, straight_line
from shaftwork.integrate.problem import Array, Fractions, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import PiecewiseDense, SmoothInterval, pieces
from shaftwork.integrate.stiffness import balance, scale_by
from shaftwork.numerics.polynomials import Interpolant, chebyshev_nodes, interpolation_times, to_chebyshev

Nearby = Callable[[Array, Array, Array], Array]
Integers = Any
"""An array of Python's whole numbers."""


class FixedPoint:
    """exp(M t) for a matrix M, as products of exp(M u), exp(2 M u), exp(4 M u), ... with a short unit of time u.

    Args:
        matrix: M (m, m), full array of fractions, 1/s.
        length: the longest time, s.

    Source: scaling and squaring, with the squares kept: Moler and Van Loan, Nineteen dubious ways, 2003, section 3.
    """

    def __init__(self, matrix: Any, length: float) -> None:
        self._matrix = matrix
        norm = max((math.fsum(abs(float(entry)) for entry in row if entry) for row in matrix), default=0.0)
        # A matrix of the norm 2^-24 has an exponential of few terms; those of longer times are its squares.
        halvings = 24
        unit = 2.0**-halvings / norm if norm > 0 else length
        self._unit = Fraction(2) ** math.floor(math.log2(min(unit, length)))
        self._short = self._unit * (1 << halvings)
        self.squares = math.ceil(math.log2(length / float(self._unit))) + 1
        self.bits = 192 + 2 * self.squares  # the squares lose two digits each
        self._powers: list[Integers] = []

    def whole(self, values: Any) -> Integers:
        """Floats or fractions as numbers of this point."""
        one = 1 << self.bits
        integers = np.empty(np.shape(values), dtype=object)
        integers.ravel()[:] = [round(Fraction(value) * one) if value else 0 for value in np.ravel(values).tolist()]
        return integers

    def floats(self, block: Integers) -> Array:
        """Numbers of this point as the nearest floats; infinite where one is too large."""
        one = 1 << self.bits
        values = np.empty(block.shape)
        values.ravel()[:] = [_quotient(value, one) for value in block.ravel().tolist()]
        return values

    def advance(self, block: Integers, times: list[Fraction]) -> Integers:
        """The columns (m, k) of a block, each moved by its own time in s.

        Raises:
            OverflowError: the motion is unbounded.
        """
        counts, rests = zip(*(divmod(time, self._unit) for time in times), strict=True)
        block = block.copy()
        for place in range(max(count.bit_length() for count in counts)):
            chosen = [k for k, count in enumerate(counts) if count >> place & 1]
            if chosen:
                block[:, chosen] = self._power(place) @ block[:, chosen] >> self.bits
        return self.nudge(block, rests)

    def is_short(self, time: Fraction) -> bool:
        """Whether the norm of M t is at most 1."""
        return time <= self._short

    def nudge(self, block: Integers, times: Sequence[Fraction]) -> Integers:
        """The columns (m, k) of a block, each moved by its own short time in s, forward or back, by a Taylor series."""
        rate, shares = self.whole(self._matrix * self._unit), self.whole([time / self._unit for time in times])
        total = term = block
        order = 0
        while (abs(term) >> 48).any():  # its last 48 digits are rounding
            order += 1
            term = ((rate @ term >> self.bits) * shares >> self.bits) // order
            total = total + term
        return total

    def _power(self, place: int) -> Integers:
        """exp(2^place M u)."""
        if not self._powers:
            one = self.whole(np.eye(len(self._matrix)))
            self._powers.append(self.nudge(one, [self._unit] * len(one)))
        while len(self._powers) <= place:
            square = self._powers[-1] @ self._powers[-1] >> self.bits
            if max(abs(square.max()), abs(square.min())) >> (self.bits + 1023):  # no float is as large
                raise OverflowError("the motion is unbounded")
            self._powers.append(square)
        return self._powers[place]


def _quotient(value: int, one: int) -> float:
    try:
        return value / one
    except OverflowError:
        return math.copysign(math.inf, value)


class PreciseSystem:
    """z' = M z with z = (x, v, v'): the states, the inputs that are not zero, and their slopes.

    Args:
        linear: the system.
        fractions: the same without rounding.
        length: of the longest piece, s.
        active: which inputs are not always zero.
    """

    def __init__(self, linear: LinearInputs, fractions: Fractions, length: float, active: list[int]) -> None:
        self.fractions, self.active = fractions, active
        n, m = len(fractions.A), len(active)
        matrix = np.full((n + 2 * m, n + 2 * m), 0, dtype=object)
        matrix[:n, :n], matrix[:n, n : n + m] = fractions.A, fractions.G[:, active]
        matrix[n : n + m, n + m :] = np.eye(m, dtype=object)
        rough = np.array([[float(entry) for entry in row] for row in matrix])
        scale = balance(linear.A)
        size = np.abs(scale_by(linear.A.toarray(), scale)).max(initial=0.0) or 1 / length
        columns = (np.abs(rough[:n, n : n + m]) / scale[:, None]).max(axis=0, initial=0.0)
        shares = size / np.where(columns > 0, columns, size)
        self.scale = 2.0 ** np.round(np.log2(np.concatenate([scale, shares, shares * size])))
        exact = [Fraction(each) for each in self.scale.tolist()]
        balanced = [
            [entry * exact[j] / exact[i] if entry else 0 for j, entry in enumerate(row)] for i, row in enumerate(matrix)
        ]
        self.power = FixedPoint(np.array(balanced, dtype=object), length)


def seconds(states: int, turns: float, outputs: int) -> float:
    """About how long a run takes, from the product of its fastest rate and its length."""
    size, squares = states + 2, 25 + math.log2(max(turns, 1.0))
    # a product of two numbers takes 0.3 us on one core, an output of an evenly spaced run ten of a matrix and a state
    return 3e-7 * (squares * size**3 + 10 * outputs * size**2)


@dataclass(frozen=True)
class PrecisePiece:
    """The motion in one piece.

    Args:
        system: its equations.
        piece: its span of time.
        start: (size, 1) of it, as whole numbers.
        exponent: the power of two by which they are smaller than the states.
        nearby: the motion in floats, from nodes (k,), the states (k, n) there and times (m,) to states (m, n).
    """

    system: PreciseSystem
    piece: SmoothInterval
    start: Integers
    exponent: int
    nearby: Nearby

    def exactly(self, times: Array) -> Array:
        """States (k, n) at times (k,), each rounded once."""
        system, power = self.system, self.system.power
        first = Fraction(self.piece.start)
        elapsed = [Fraction(time) - first for time in times.tolist()]
        block = self._evenly(elapsed)
        if block is None:
            block = power.advance(np.repeat(self.start, len(elapsed), axis=1), elapsed)
        n = len(system.scale) - 2 * len(system.active)
        return np.asarray(np.ldexp(power.floats(block[:n]).T, self.exponent) * system.scale[:n])

    def _evenly(self, elapsed: list[Fraction]) -> Integers | None:
        """The motion at times with equal steps, whose exponential is shared; None where they have none."""
        power, count = self.system.power, len(elapsed) - 1
        if count < len(self.start):
            return None
        step = (elapsed[-1] - elapsed[0]) / count
        nudges = [time - elapsed[0] - k * step for k, time in enumerate(elapsed)]
        if not power.is_short(max(map(abs, nudges))):
            return None
        columns = power.advance(self.start, [elapsed[0]])
        matrix = power.advance(power.whole(np.eye(len(self.start))), [step] * len(self.start))
        while columns.shape[1] <= count:
            columns = np.hstack([columns, matrix @ columns[:, : count + 1 - columns.shape[1]] >> power.bits])
            matrix = matrix @ matrix >> power.bits
        return power.nudge(columns, nudges)

    @cached_property
    def panels(self) -> PiecewiseDense | None:
        """The motion as polynomials, in panels that are the shorter the faster it moves; None where it only rings.

        The last panel comes first: what still moves fast there does so all the time.
        """
        degree, left_out = 20, 2e-14  # of a polynomial, and the part of the largest value of a state that it may lack
        most = 200  # of panels; a motion that rings in more of them goes on in floats from exact nodes
        coefficients = to_chebyshev(chebyshev_nodes(degree))
        starts, panels = [self.piece.start], list[Interpolant]()
        end, largest = self.piece.end, np.zeros(len(self.system.scale) - 2 * len(self.system.active))
        while starts:
            start = starts[-1]
            shares = (self.piece.end - self.piece.start) / (end - start)
            if len(panels) > most or (not panels and shares > most):
                return None
            states = self.exactly(interpolation_times(start, end, degree))
            largest = np.maximum(largest, np.abs(states).max(axis=0))
            missing = np.abs(coefficients @ states)[-2:].max(axis=0)
            middle = (start + end) / 2
            if (missing > left_out * largest).any() and start < middle < end:
                starts.append(middle)
                continue
            panels.append(Interpolant(start, end, states))
            end = starts.pop()
        panels.reverse()
        steps = np.array([*(each.start for each in panels), self.piece.end])
        return PiecewiseDense(steps[:-1], tuple(panels), steps, largest.size)

    @cached_property
    def _nodes(self) -> tuple[Array, Array]:
        """Times (k,) and states (k, n) between which a motion that rings is computed in floats."""
        times = np.linspace(self.piece.start, self.piece.end, OWN_INTERVALS + 1)
        return times, self.exactly(times)

    @property
    def end(self) -> Array:
        """(n,) state at its end."""
        return np.asarray(self.exactly(np.array([self.piece.end]))[0])

    @property
    def times(self) -> Array:
        """(s,) between these the motion is smooth."""
        if self.panels is None:
            return self._nodes[0]
        return self.panels.steps

    def at(self, times: Array) -> Array:
        """States (k, n) at times (k,)."""
        if times.size <= 64 or are_even(times):  # a few are computed as fast as panels are made
            return self.exactly(times)
        if self.panels is None:
            return self.nearby(*self._nodes, times)
        return np.asarray(self.panels(times))


def precise_system(problem: Problem, linear: LinearInputs) -> PreciseSystem | None:
    """The system of a problem, which is kept for its next run; None where it has no exact form."""
    fractions = linear.cached("fractions", linear.fractions)
    if fractions is None:
        return None
    spans = pieces(problem)
    lines = [straight_line(problem, fractions.inputs, piece) for piece in spans]
    active = np.flatnonzero(np.any([(level != 0) | (slope != 0) for level, slope in lines], axis=0)).tolist()
    length = max(piece.end - piece.start for piece in spans)
    return linear.cached("precise", lambda: PreciseSystem(linear, fractions, length, active), (length, active))


def precise_piece(
    problem: Problem, system: PreciseSystem, piece: SmoothInterval, x: Array, nearby: Nearby
) -> PrecisePiece:
    """The motion in a piece from a state x (n,)."""
    level, slope = straight_line(problem, system.fractions.inputs, piece)
    values = np.concatenate([x, level[system.active], slope[system.active]])
    shares = [
        Fraction(value) / Fraction(each) for value, each in zip(values.tolist(), system.scale.tolist(), strict=True)
    ]
    largest = max(map(abs, shares), default=Fraction(0))
    exponent = largest.numerator.bit_length() - largest.denominator.bit_length() if largest else 0
    start = system.power.whole([share / Fraction(2) ** exponent for share in shares])[:, None]
    return PrecisePiece(system, piece, start, exponent, nearby)
