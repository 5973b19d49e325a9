"""What lies inside the last steps of many lanes at once: peaks, and guards that are exceeded for a moment.

Each lane has a stack of intervals, and looks into one of them in each repetition, as `lane_loops` does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shaftwork.numerics.hermite import EDGE, JET, powers
from shaftwork.numerics.tolerances import TYPED
from shaftwork.sweep.lane_tables import LOOKS, TOLD

DEPTH = 16
"""Intervals that may wait beside the first ones."""
INTERVAL = 11
"""Time and jet at both ends, how much the quintic was off at one of them, how near that was, and the watched number."""
quintic: Any = powers.py_func
"""Coefficients of the quintic through jets at two times, of arrays; see `hermite.powers`."""


class InnerSearch:
    """Looks for what is higher than the highest value so far.

    What is watched are first the extremes, and then the guards, which are exceeded above zero on their side.

    Args:
        jax: the library.
        signs: times which each extreme is the largest value.
        guards: how many.
        reach: how high the quintic may come in an interval, and how far the motion may be from it.
    """

    def __init__(
        self, jax: Any, signs: list[float], guards: int, reach: Callable[[Any, Any, Any], tuple[Any, Any]]
    ) -> None:
        self._jax, self._numpy, self._signs, self._reach = jax, jax.numpy, np.array(signs), reach
        self.extremes, self.watched = len(signs), len(signs) + guards

    def begun(self, lanes: int) -> dict[str, Any]:
        """The memory of a search; lost are lanes in which no end of it was found."""
        counts = {name: np.zeros(lanes, dtype=np.int32) for name in ("depth", "looks", "lost")}
        return {
            "stack": np.zeros(((self.watched + DEPTH) * lanes, INTERVAL)),
            "interval": np.zeros((INTERVAL, lanes)),
            "height": np.zeros(lanes),
            "near": np.zeros((self.watched, lanes)),
            "uppers": np.full((self.watched - self.extremes, lanes), np.inf),
            **counts,
        }

    def jets(self, memory: dict[str, Any], name: str) -> Any:
        """(3, watched, lanes) jets of all that is watched in an array, on its side and less its offset."""
        numpy, lanes = self._numpy, memory["depth"].size
        signs = numpy.concatenate([numpy.repeat(self._signs[:, None], lanes, axis=1), memory["sides"]])
        jets = signs * memory[name][: JET * self.watched].reshape(self.watched, JET, lanes).swapaxes(0, 1)
        return jets.at[0, self.extremes :].add(-memory["offsets"])

    def jet(self, memory: dict[str, Any], name: str, number: Any) -> Any:
        """(3, lanes) that of which each lane has the number (lanes,)."""
        return self._numpy.take_along_axis(self.jets(memory, name), number[None, None], 1)[:, 0]

    def _at(self, rows: Any, number: Any) -> Any:
        return self._numpy.take_along_axis(rows, number[None], 0)[0]

    def open(self, memory: dict[str, Any], inspected: Any, ready: Any) -> Any:
        """Let last steps be searched, for guards if there are any, and for peaks where no guard may be met.

        Args:
            memory: of the lanes; `uppers` is when each guard was seen exceeded.
            inspected: (lanes,) whose last step is to be searched.
            ready: (lanes,) whose peaks are to be searched.

        Returns:
            (lanes,) whose peaks are.
        """
        numpy, first = self._numpy, self.extremes
        left, right = (self.jets(memory, name) for name in ("last_monitored", "monitored"))
        inside, beyond = self._reach(memory["time"] - memory["last_time"], left, right)
        watched, above = inspected & (memory["sides"] != 0.0), right[0, first:] > 0
        memory["lost"] = memory["lost"] | numpy.any(watched & numpy.isnan(right[0, first:]), axis=0)
        uppers = numpy.where(watched & above, memory["time"], np.inf)
        memory["uppers"] = numpy.where(inspected, uppers, memory["uppers"])
        perhaps = watched & ~above & ((inside + beyond)[first:] > 0)
        ready |= inspected & ~numpy.any(perhaps | (watched & above), axis=0)
        for name, extreme in (("best", numpy.maximum), ("lows", numpy.minimum)):
            value = extreme(memory[name], extreme(left[0, :first], right[0, :first]).astype(memory[name].dtype))
            memory[name] = numpy.where(ready, value, memory[name])
        best, rounding = memory["best"], 8 * float(numpy.finfo(memory["best"].dtype).eps)
        near = max(TYPED, rounding) * (best - memory["lows"]) + rounding * abs(best)
        beside = TYPED * numpy.maximum(abs(left[0]), abs(right[0]))[first:]
        on = numpy.concatenate([numpy.broadcast_to(ready, best.shape), perhaps])
        memory["near"] = numpy.where(on, numpy.concatenate([near, beside]), memory["near"])
        memory["looks"] = numpy.where(inspected | ready, 0, memory["looks"])
        low, high = (numpy.broadcast_to(memory[name], on.shape)[None] for name in ("last_time", "time"))
        rest = numpy.zeros((3, *on.shape)).at[2].set(np.arange(self.watched)[:, None])
        self._push(memory, on, numpy.concatenate([low, left, high, right, rest]))
        return ready

    def _push(self, memory: dict[str, Any], on: Any, intervals: Any) -> None:
        """Lay intervals (INTERVAL, k, lanes) that are marked (k, lanes) onto the stacks."""
        numpy, stack, lanes = self._numpy, memory["stack"], on.shape[1]
        count = numpy.cumsum(on, axis=0, dtype=np.int32)
        place = (memory["depth"] + count - 1) * lanes + np.arange(lanes)
        place = numpy.where(on, place, stack.shape[0]).ravel()
        memory["stack"] = stack.at[place].set(intervals.reshape(INTERVAL, -1).T, mode="drop")
        memory["depth"] = memory["depth"] + count[-1]

    def divide(self, memory: dict[str, Any], on: Any) -> None:
        """Take what was seen inside the intervals of some lanes, and divide these."""
        numpy, interval, t = self._numpy, memory["interval"], memory["goal"]
        number = interval[10].astype(np.int32)
        middle = self.jet(memory, "seen", number)
        self._raise(memory, on, number, middle[0])
        guards = np.arange(self.extremes, self.watched)[:, None]
        exceeded = on & (number >= self.extremes) & (middle[0] > 0)
        memory["uppers"] = numpy.where(exceeded & (number == guards), t, memory["uppers"])
        low, high = interval[0], interval[4]
        missed, room = abs(memory["height"] - middle[0]), numpy.minimum(t - low, high - t)
        inner, rest = numpy.stack([t, *middle]), numpy.stack([missed, room, interval[10]])
        parts = (numpy.concatenate([*ends, rest]) for ends in ((interval[:4], inner), (inner, interval[4:8])))
        self._push(memory, numpy.repeat((on & ~exceeded)[None], 2, axis=0), numpy.stack([*parts], axis=1))

    def next(self, memory: dict[str, Any], on: Any) -> Any:
        """Whether some lanes have an interval to be looked into, at their goal; those that have none are done."""
        numpy, names = self._numpy, ("stack", "depth", "interval", "height", "goal", "best", "looks", "lost")

        def waiting(now: dict[str, Any], found: Any) -> Any:
            return on & ~found & (now["depth"] > 0)

        def pop(state: Any) -> Any:
            now, found = memory | state[0], state[1]
            found = found | self._pop(now, waiting(now, found))
            return {name: now[name] for name in names}, found

        begun = {name: memory[name] for name in names}, numpy.zeros_like(on)
        ended, found = self._jax.lax.while_loop(lambda state: numpy.any(waiting(*state)), pop, begun)
        memory |= ended
        return found

    def _pop(self, memory: dict[str, Any], on: Any) -> Any:
        """Take an interval of some lanes; whether it has to be looked into."""
        numpy, lanes = self._numpy, on.size
        memory["depth"] = depth = memory["depth"] - on
        interval = memory["stack"][numpy.maximum(depth, 0) * lanes + np.arange(lanes)].T
        low, left, high, right = interval[0], interval[1:4], interval[4], interval[5:8]
        number = interval[10].astype(np.int32)
        bounds = numpy.concatenate([memory["best"], numpy.where(memory["uppers"] < np.inf, np.inf, 0.0)])
        best = self._at(bounds, number) + self._at(memory["near"], number)
        inside, beyond = self._reach(high - low, left, right)
        higher = on & (high - low > TYPED * abs(low)) & (inside > numpy.maximum(left[0], right[0]))
        place, height = self._peak(high - low, left, right)
        higher &= (inside + beyond > best) & (height + beyond > best)
        t = low + place * (high - low)
        sure = higher & self._told(interval, t, self._at(memory["near"], number))
        self._raise(memory, sure, number, height)
        full = (memory["looks"] > LOOKS) | (depth + 2 > self.watched + DEPTH)
        found = higher & ~sure & ~full
        memory["lost"] = memory["lost"] | (higher & ~sure & full)
        for name, new in (("interval", interval), ("height", height), ("goal", t)):
            memory[name] = numpy.where(found, new, memory[name])
        memory["looks"] = memory["looks"] + found
        return found

    def _told(self, interval: Any, t: Any, near: Any) -> Any:
        """Whether the quintic tells enough: what it misses grows with the cube of the distance from its points."""
        (low, high), (missed, room), numpy = (interval[0], interval[4]), interval[8:10], self._numpy
        part = numpy.where(room > 0, numpy.minimum(t - low, high - t) / numpy.where(room > 0, room, 1.0), 1.0)
        return (part < TOLD) & (missed * part**3 < near)

    def _raise(self, memory: dict[str, Any], on: Any, number: Any, value: Any) -> None:
        """Let the largest value of an extreme of some lanes be no less than another."""
        best, numbers = memory["best"], np.arange(self.extremes)[:, None]
        higher = self._numpy.maximum(best, value.astype(best.dtype))
        memory["best"] = self._numpy.where(on & (numbers == number), higher, best)

    def _peak(self, length: Any, left: Any, right: Any) -> tuple[Any, Any]:
        """Share of the length and height of the highest peak of the quintic; -inf where there is none."""
        numpy, curve = self._numpy, quintic(length, left, right)
        slopes = [degree * one for degree, one in zip(range(5, 0, -1), curve, strict=False)]
        edges = np.arange(7)[:, None] / 6
        rates = numpy.polyval(numpy.stack(slopes)[:, None], edges)
        place = self.root(slopes, edges[:-1], edges[1:], -1.0, 5)
        heights = numpy.polyval(numpy.stack(curve)[:, None], place)
        heights = numpy.where((rates[:-1] > 0) & (rates[1:] < 0), heights, -np.inf)
        top = numpy.argmax(heights, axis=0)
        return numpy.clip(self._at(place, top), EDGE, 1 - EDGE), self._at(heights, top)

    def root(self, curve: Any, low: Any, high: Any, rising: float, most: int) -> Any:
        """A zero of polynomials between two places; see `hermite.root`."""
        numpy, degrees = self._numpy, np.arange(len(curve) - 1, 0, -1)[:, None, None]
        values = numpy.stack([*curve])[:, None]
        slopes = degrees * values[:-1]
        shape = np.broadcast_shapes(low.shape, high.shape, values[0].shape)
        low, high = (numpy.broadcast_to(one, shape) for one in (low, high))

        def nearer(_: Any, state: Any) -> Any:
            low, u, high = state
            value = numpy.polyval(values, u)
            over = value * rising > 0
            low, high = numpy.where(over, low, u), numpy.where(over, u, high)
            new = u - value / numpy.polyval(slopes, u)
            return low, numpy.where((low <= new) & (new <= high), new, (low + high) / 2), high

        return self._jax.lax.fori_loop(0, most, nearer, (low, (low + high) / 2, high))[1]
