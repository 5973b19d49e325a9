"""Functions of many systems side by side as JAX traces them: written by what writes machine code, for any device."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from shaftwork.numerics.machine_code import LaneBody, held_noise, interpolate, interpolation_slope


class TracedBody(LaneBody):
    """A function as it is traced; each number is a row of all systems.

    In single precision times, parameters and what these alone tell keep double precision, so that a law jumps where it
    should; what comes together with a state is single.

    Args:
        jax: the library.
        memory: arrays of rows by name, which it changes.
    """

    def __init__(self, jax: Any, memory: dict[str, Any]) -> None:
        self.jax, self.builder, self.memory = jax, _Instructions(jax.numpy), memory
        self.t = memory["moment"][0]
        self._least = float(np.finfo(memory["x"].dtype).tiny)
        self.written: list[Any] = []
        """What it has written."""

    def number(self, value: float) -> Any:
        return np.float64(np.copysign(max(abs(value), self._least), value) if value else value)

    def bit(self, *, value: bool) -> Any:
        return np.bool_(value)

    def read(self, array: str, place: int, row: Any = None) -> Any:
        rows = self.memory[array]
        return rows[place] if row is None else rows[place + row.start : place + row.stop]

    def put(self, array: str, place: int, value: Any, row: Any = None) -> None:
        """Write numbers of an array."""
        rows = self.memory[array]
        where = slice(place, place + 1) if row is None else slice(place + row.start, place + row.stop)
        self.memory[array] = rows.at[where].set(value.astype(rows.dtype))

    def write(self, place: int, value: Any, row: Any = None) -> None:  # noqa: ARG002 (places follow each other)
        kind = self.memory["x"].dtype
        self.written.append(self.jax.numpy.broadcast_to(value, self.t.shape).astype(kind))

    def run(self, function: Any, row: int) -> None:  # noqa: ARG002 (it writes where it says)
        """Run what writes the same memory."""
        function(self)

    @contextmanager
    def loop(self, first: int, last: int) -> Iterator[Any]:
        """All rows at once."""
        yield slice(first, last)

    def array(self, values: Sequence[float]) -> Any:
        return self.jax.numpy.array(values, dtype=float)

    def intrinsic(self, name: str, *values: Any) -> Any:
        return getattr(self.jax.numpy, {"minnum": "fmin", "maxnum": "fmax"}.get(name, name))(*_alike(values))

    def call(self, function: Any, *values: Any) -> Any:
        if function in _OWN:
            return _OWN[function](self.jax, *values).astype(values[0].dtype)
        name = function.__name__
        of = self.jax.scipy.special if name in ("erf", "erfc", "gamma") else self.jax.numpy
        return getattr(of, name)(*_alike(values))


def _alike(values: Sequence[Any]) -> Sequence[Any]:
    """Numbers of one precision: the lowest of them."""
    kind = min((value.dtype for value in values), key=lambda kind: kind.itemsize)
    return [value.astype(kind) for value in values]


class _Instructions:
    """What llvmlite's builder has, of arrays.

    Args:
        numpy: that of JAX.
    """

    fadd, fsub, fmul, fdiv = (
        staticmethod(lambda one, other, flags=(), do=do: do(*_alike((one, other))))  # noqa: ARG005 (XLA contracts by itself)
        for do in (operator.add, operator.sub, operator.mul, operator.truediv)
    )
    and_, or_ = staticmethod(operator.and_), staticmethod(operator.or_)

    def __init__(self, numpy: Any) -> None:
        self._numpy, self.not_ = numpy, numpy.logical_not

    def select(self, condition: Any, one: Any, other: Any) -> Any:
        """One number where a condition holds, and else another."""
        return self._numpy.where(condition, *_alike((one, other)))

    def fcmp_ordered(self, comparison: str, one: Any, other: Any) -> Any:
        """A comparison that does not hold where there is no number."""
        if comparison in ("ord", "!="):
            numbers = (one == one) & (other == other)  # noqa: PLR0124
            return numbers if comparison == "ord" else numbers & (one != other)
        return _COMPARED[comparison](*_alike((one, other)))

    def fcmp_unordered(self, comparison: str, one: Any, other: Any) -> Any:
        """Whether two numbers differ, or one of them is none."""
        return one != other if comparison == "!=" else self.not_(self.fcmp_ordered("ord", one, other))


_COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le, "==": operator.eq}


def _interval(numpy: Any, x: Any, xs: Any) -> Any:
    return numpy.searchsorted(xs, x, side="right", method="scan_unrolled")


def _interpolate(jax: Any, x: Any, xs: Any, ys: Any) -> Any:
    numpy = jax.numpy
    k = numpy.clip(_interval(numpy, x, xs), 1, xs.size - 1)
    inside = (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) * (x - xs[k - 1]) + ys[k - 1]
    return numpy.where(x <= xs[0], ys[0], numpy.where(x >= xs[-1], ys[-1], inside))


def _interpolation_slope(jax: Any, x: Any, xs: Any, ys: Any) -> Any:
    k, numpy = _interval(jax.numpy, x, xs), jax.numpy
    at = numpy.clip(k, 1, xs.size - 1)
    return numpy.where((k > 0) & (k < xs.size), (ys[at] - ys[at - 1]) / (xs[at] - xs[at - 1]), 0.0)


def _split_mix(start: Any, number: Any) -> Any:
    word = start + number * np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


def _held_noise(jax: Any, x: Any, seed: Any) -> Any:
    whole = jax.numpy.floor(x).astype(np.int64).astype(np.uint64)
    bits = jax.lax.bitcast_convert_type(jax.numpy.asarray(seed, dtype=np.float64) + 0.0, np.uint64)
    word = _split_mix(_split_mix(bits, np.uint64(1)), whole)
    share = ((word >> np.uint64(11)).astype(np.float64) + 0.5) / 2.0**53
    return jax.numpy.where(abs(x) < 2.0**63, jax.scipy.special.ndtri(share), np.nan)


_OWN: Mapping[Any, Callable[..., Any]] = {
    interpolate: _interpolate,
    interpolation_slope: _interpolation_slope,
    held_noise: _held_noise,
}


def rows_of(jax: Any, memory: Mapping[str, Any], write: Callable[[TracedBody], None]) -> Any:
    """The rows that a function writes, (rows, systems), from what writes it."""
    body = TracedBody(jax, dict(memory))
    write(body)
    return jax.numpy.stack(body.written)
