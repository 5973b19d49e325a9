"""Steps of lanes in machine code, with their errors, and where more than their ends has to be looked at.

Dormand and Prince's method of order 8(5,3) compares its result with two of lower order: Hairer, Norsett, Wanner,
Solving Ordinary Differential Equations I, II.10. What a step misses counts for the states, and for what is measured as
well: a stiff damper's torque may be wrong where the speeds are right, and what a source gives may swing without them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from scipy.integrate import DOP853

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.hermite import BEYOND, JET
from shaftwork.numerics.machine_code import LaneBody

OF_A_QUANTITY, CANCELLED = 10.0, 1e-4
"""What is measured may be wrong by so many times as much as a state, and by the error of so small a part of what it is
the difference of: of a stiff damper's torque more would be lost in rounding."""
TINY = 1e-30
"""Keeps a division by an error or a size of zero finite; beside squares of what is measured in SI."""
STAGES = len(DOP853.B)


@dataclass(frozen=True)
class ControlledQuantity:
    """A quantity whose error counts.

    Args:
        row: of its value among the monitored ones; its gradient follows.
        columns: the states by which it is derived.
        measured: whether its own error counts.
        time_slope: of what depends on time itself, the row of its slope by time; else None.
    """

    row: int
    columns: tuple[int, ...]
    measured: bool
    time_slope: int | None


class StepWriter:
    """Writes the step.

    The tolerance is a part of the size of a state: of its value, of its change in the step and of its nominal size
    together.

    Args:
        slopes: what writes the slopes at y and the moment, its address, and the row of the first ones; those of all
            stages are behind each other.
        monitored: what writes what is seen there, its address, and its first row.
        count: of slopes.
        states: how many there are; the integrals follow them, as quantities and powers.
        integrals: which of the controlled quantities is integrated, and to which power.
        controlled: quantities.
        signs: of each quantity whose largest value is wanted; their jets come first among the monitored values.
        guards: how many there are; their jets come behind these.
    """

    def __init__(
        self,
        slopes: tuple[Any, int],
        monitored: tuple[Any, int],
        count: int,
        states: int,
        integrals: Sequence[tuple[ControlledQuantity, int]],
        controlled: Sequence[ControlledQuantity],
        signs: Sequence[float],
        guards: int,
    ) -> None:
        (self._slopes, self._first), self._monitored = slopes, monitored
        self._count, self._states = count, states
        self._integrals, self._controlled = integrals, controlled
        self._signs, self._guards = signs, guards

    def probe(self, body: LaneBody) -> None:
        """Write a step of the given size, without its error."""
        self._begin(body)
        self._stages(body.read("size", 0))

    def advance(self, body: LaneBody, probe: Any) -> None:
        """Write a step that is made where its error is small enough, and the length of the next one.

        Args:
            body: where it writes.
            probe: address of what makes the step.
        """
        self._begin(body)
        time, end = body.read("time", 0), body.read("end", 0)
        wanted = body.intrinsic("minnum", body.read("step", 0), body.read("longest", 0))
        left = self._difference(end, time)
        body.put("size", 0, size := body.intrinsic("minnum", wanted, left))
        body.run(probe, 0)
        self._size = size
        with body.loop(0, self._count) as row:
            for name, weights in (("fifth", DOP853.E5), ("third", DOP853.E3)):
                body.put(name, 0, self._weighted(weights, row), row)
        error = self._error()
        build, one, zero = body.builder, body.number(1.0), body.number(0.0)
        good = build.and_(build.fcmp_ordered("<=", error, one), build.fcmp_ordered(">", body.read("active", 0), zero))
        arrived = build.select(build.fcmp_ordered("<", wanted, left), self._sum([time, size]), end)
        body.put("last_time", 0, build.select(good, time, body.read("last_time", 0)))
        body.put("time", 0, build.select(good, arrived, time))
        self._where(good, "last_x", "x", self._moving)
        self._where(good, "x", "new", self._moving)
        self._where(good, "last_monitored", "monitored", self._jets)
        body.put("moved", 0, build.select(good, one, zero))
        body.put("made", 0, self._sum([body.read("made", 0), one]))
        root = self._sum([error, body.number(TINY)])
        for _ in range(3):  # the error is of order 8
            root = body.intrinsic("sqrt", root)
        factor = build.fdiv(body.number(0.85), root)
        factor = body.intrinsic("minnum", body.intrinsic("maxnum", factor, body.number(0.2)), body.number(5.0))
        number = build.fcmp_ordered("ord", error, error)
        body.put("step", 0, build.select(number, self._product(size, factor), body.number(math.nan)))

    def look(self, body: LaneBody) -> None:
        """Write what there is at the start of a step, and compare the ends of the last one."""
        self._begin(body)
        with body.loop(0, self._moving) as row:
            body.put("y", 0, body.read("x", 0, row), row)
        body.put("moment", 0, body.intrinsic("minnum", body.read("time", 0), body.read("high", 0)))
        body.run(*self._monitored)
        body.run(self._slopes, self._first)
        self.compare(body)

    def compare(self, body: LaneBody) -> None:
        """Write the ends of the last steps into the extremes, and where more is to be looked at."""
        self._begin(body)
        build, zero = body.builder, body.number(0.0)
        self._size = self._difference(body.read("time", 0), body.read("last_time", 0))
        moved, inspected = build.fcmp_ordered(">", body.read("moved", 0), zero), body.bit(value=False)
        for guard in range(self._guards):
            side, offset = body.read("sides", guard), body.read("offsets", guard)
            left, right = (self._jet(name, len(self._signs) + guard, side) for name in ("last_monitored", "monitored"))
            left[0], right[0] = self._difference(left[0], offset), self._difference(right[0], offset)
            above = build.fcmp_ordered(">", right[0], zero)
            reaches = build.not_(build.fcmp_ordered("<=", self._sum(self._reach(left, right)), zero))  # NaN as well
            watched = build.fcmp_ordered("!=", side, zero)
            inspected = build.or_(inspected, build.and_(watched, build.or_(above, reaches)))
        for k, sign in enumerate(self._signs):
            left, right = (self._jet(name, k, body.number(sign)) for name in ("last_monitored", "monitored"))
            higher, lower = (body.intrinsic(name, left[0], right[0]) for name in ("maxnum", "minnum"))
            calm, best, low = build.and_(moved, build.not_(inspected)), body.read("best", k), body.read("lows", k)
            best = build.select(calm, body.intrinsic("maxnum", best, higher), best)
            body.put("best", k, best)
            body.put("lows", k, build.select(calm, body.intrinsic("minnum", low, lower), low))
            inside, beyond = self._reach(left, right)
            rises = build.fcmp_ordered(">", inside, higher)
            rises = build.and_(rises, build.fcmp_ordered(">", self._sum([inside, beyond]), best))
            inspected = build.or_(inspected, rises)
        body.put("inspected", 0, build.select(build.and_(moved, inspected), body.number(1.0), zero))

    def _begin(self, body: LaneBody) -> None:
        self._body = body
        self._moving = self._states + len(self._integrals)
        self._jets = JET * (len(self._signs) + self._guards)

    def _where(self, good: Any, name: str, other: str, count: int) -> None:
        """Write rows of another array into those of one where something holds."""
        with self._body.loop(0, count) as row:
            new, old = self._body.read(other, 0, row), self._body.read(name, 0, row)
            self._body.put(name, 0, self._body.builder.select(good, new, old), row)

    def _jet(self, name: str, number: int, sign: Any) -> list[Any]:
        return [self._product(sign, self._body.read(name, JET * number + k)) for k in range(JET)]

    def _reach(self, left: Sequence[Any], right: Sequence[Any]) -> tuple[Any, Any]:
        """How high the quintic may come between two times, and how far the motion may be from it; see `hermite`."""
        body, length = self._body, self._size
        (fifth, tenth), square = (
            (self._product(length, body.number(1 / k)) for k in (5, 2.5)),
            self._product(length, length),
        )
        twentieth, backward = self._product(square, body.number(1 / 20)), body.number(-1.0)
        inside = [
            self._sum([left[0], self._product(fifth, left[1])]),
            self._sum([left[0], self._product(tenth, left[1]), self._product(twentieth, left[2])]),
            self._difference(right[0], self._product(fifth, right[1])),
            self._sum([right[0], self._product(backward, tenth, right[1]), self._product(twentieth, right[2])]),
        ]
        bend = self._product(square, self._sum([left[2], right[2]]), body.number(1 / 64))
        apart = self._sum([self._product(length, self._difference(left[1], right[1]), body.number(1 / 32)), bend])
        highest = reduce(lambda a, b: body.intrinsic("maxnum", a, b), inside)
        return highest, self._product(body.number(BEYOND), body.intrinsic("fabs", apart))

    def _stages(self, size: Any) -> None:
        """Write the slopes at all stages but the first, and what they lead to at the end."""
        body, self._size = self._body, size
        time, high = body.read("time", 0), body.read("high", 0)
        for stage in range(1, STAGES):
            self._move("y", DOP853.A[stage], self._moving)
            moment = self._sum([time, self._product(body.number(DOP853.C[stage]), size)])
            body.put("moment", 0, body.intrinsic("minnum", moment, high))
            body.run(self._slopes, self._first + stage * self._count)
        self._move("new", DOP853.B, self._moving)

    def _move(self, name: str, weights: Array, moving: int) -> None:
        """Write states and integrals as slopes with weights move them."""
        with self._body.loop(0, moving) as row:
            x, slope = self._body.read("x", 0, row), self._weighted(weights, row)
            self._body.put(name, 0, self._sum([x, self._product(self._size, slope)]), row)

    def _weighted(self, weights: Array, row: Any) -> Any:
        body = self._body
        pairs = [(stage, weight) for stage, weight in enumerate(weights[:STAGES].tolist()) if weight]
        slopes = ((body.read("slopes", stage * self._count, row), body.number(weight)) for stage, weight in pairs)
        return self._sum([self._product(weight, slope) for slope, weight in slopes])

    def _error(self) -> Any:
        """The error of the step in units of the tolerance."""
        body, build = self._body, self._body.builder
        with body.loop(0, self._states) as row:
            change = self._product(self._size, body.read("slopes", 0, row))
            allowed = self._squares([body.read("x", 0, row), body.read("nominal", 0, row), change])
            for name in ("fifth", "third"):  # a state's own one is needed below
                missed = body.read(name, 0, row)
                body.put(f"{name}s", 0, build.fdiv(self._product(missed, missed), allowed), row)
        fifths, thirds = ([body.read(f"{name}s", row) for row in range(self._states)] for name in ("fifth", "third"))
        for allowed, (fifth, third) in [*self._of_slopes(), *self._of_measured()]:
            fifths.append(build.fdiv(self._product(fifth, fifth), allowed))
            thirds.append(build.fdiv(self._product(third, third), allowed))
        fifth, third = self._sum(fifths), self._sum(thirds)
        both = self._sum([fifth, self._product(body.number(0.01), third), body.number(TINY**2)])
        scale = self._product(body.intrinsic("sqrt", both), body.read("tolerance", 0))
        return build.fdiv(self._product(self._size, fifth), scale)

    def _of_slopes(self) -> list[tuple[Any, tuple[Any, Any]]]:
        """What is allowed and missed of integrals, and of what depends on time itself."""
        body, square, parts = self._body, self._product(self._size, self._size), []
        for k, (quantity, power) in enumerate(self._integrals):
            row = self._states + k
            least = self._least(quantity)
            beside = self._sum([self._mean(row), self._product(*[least] * power)])
            allowed = self._sum([self._squares([body.read("x", row)]), self._product(square, beside)])
            parts.append((allowed, (body.read("fifth", row), body.read("third", row))))
        for quantity in self._controlled:
            if quantity.time_slope is not None:
                row = quantity.time_slope
                beside = self._sum([self._mean(row), self._least(quantity)])
                allowed = self._product(body.number(OF_A_QUANTITY**2), square, beside)
                parts.append((allowed, (body.read("fifth", row), body.read("third", row))))
        return parts

    def _of_measured(self) -> list[tuple[Any, tuple[Any, Any]]]:
        """What is allowed and missed of quantities that are measured."""
        body, parts = self._body, []
        for quantity in self._controlled:
            if not quantity.measured:
                continue
            change = self._product(self._size, self._along(quantity, "slopes"))
            beside = self._sum([self._squares([body.read("monitored", quantity.row), change]), self._least(quantity)])
            missed = self._along(quantity, "fifth"), self._along(quantity, "third")
            parts.append((self._product(body.number(OF_A_QUANTITY**2), beside), missed))
        return parts

    def _mean(self, row: int) -> Any:
        """The mean of the squares of a slope over the stages."""
        slopes = [self._body.read("slopes", stage * self._count + row) for stage in range(STAGES)]
        return self._product(self._body.number(1 / STAGES), self._squares(slopes))

    def _least(self, quantity: ControlledQuantity) -> Any:
        """The square of what matters of a quantity whatever its value."""
        body, parts = self._body, []
        for place, column in enumerate(quantity.columns):
            slope, x = body.read("monitored", quantity.row + 1 + place), body.read("x", column)
            parts += [self._product(slope, body.read("nominal", column))]
            parts += [self._product(slope, x, body.number(CANCELLED))]
        return self._sum([self._squares(parts), body.number(TINY)])

    def _along(self, quantity: ControlledQuantity, name: str) -> Any:
        """The change of a quantity with changes of the states, the first rows of an array."""
        read = self._body.read
        places = enumerate(quantity.columns)
        return self._sum(
            [self._product(read("monitored", quantity.row + 1 + k), read(name, column)) for k, column in places]
        )

    def _squares(self, parts: Sequence[Any]) -> Any:
        return self._sum([self._product(part, part) for part in parts])

    def _sum(self, parts: Sequence[Any]) -> Any:
        build, zero = self._body.builder, self._body.number(0.0)
        return reduce(lambda a, b: build.fadd(a, b, flags=("contract",)), parts) if parts else zero

    def _difference(self, one: Any, other: Any) -> Any:
        return self._body.builder.fsub(one, other, flags=("contract",))

    def _product(self, *parts: Any) -> Any:
        return reduce(lambda a, b: self._body.builder.fmul(a, b, flags=("contract",)), parts)
