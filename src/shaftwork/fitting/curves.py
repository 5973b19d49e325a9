"""What a network gives for values of its unknowns, beside a record, with the derivatives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError, ParameterError, ShaftworkError, SimulationError
from shaftwork.numerics.differences import differences
from shaftwork.pipeline.arguments import closer
from shaftwork.pipeline.model import Model
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.legs import DifferentiatedMotion
from shaftwork.sensitivities.parametric_motion import ParametricMotion


class Source(Protocol):
    """Values of what is recorded, for values of the parameters in SI."""

    def values(self, parameters: Mapping[str, float]) -> Array:
        """(N,) computed."""
        ...

    def slopes(self, parameters: Mapping[str, float]) -> Array | None:
        """(N, m) derivatives by the parameters; None where they must be had by differences."""
        ...


class Scaling:
    """Parameters by their change since the start: logarithms of those that stay above zero, others by their size.

    At the start all are 0.3. As scipy's first step is as long as its start, it changes what counts most by no more.
    Errors are spread evenly in these, but for what may be zero, a damping or a gap: of this in the values themselves.

    Args:
        start: values in SI by name.
        positive: (m,) which are taken by their logarithms.
        sizes: (m,) of the values.
        to_zero: (m,) which of the positive ones may be zero as well.
    """

    def __init__(
        self, start: Mapping[str, float], positive: NDArray[np.bool_], sizes: Array, to_zero: NDArray[np.bool_]
    ) -> None:
        self.start, self.names, self.positive, self._sizes = start, tuple(start), positive, sizes
        self.to_zero = to_zero & positive
        self.first, self._offset = np.array(list(start.values())), 0.3
        self.floor = np.where(self.to_zero, self._offset + math.log(0.01), -np.inf)
        """(m,) below these unknowns a value is zero beside its start."""

    def unknowns(self, values: Array) -> Array:
        """(m,) from values in SI."""
        with np.errstate(divide="ignore"):  # a bound of zero is minus infinity
            grown = np.log(np.where(self.positive, values / self._sizes, 1.0))
        return self._offset + np.where(self.positive, grown, (values - self.first) / self._sizes)

    def values(self, unknowns: Array) -> Array:
        """(m,) in SI."""
        change = unknowns - self._offset
        with np.errstate(over="ignore"):  # of what is not known at all
            grown = self.first * np.exp(np.where(self.positive, change, 0.0))
        return np.where(self.positive, grown, self.first + change * self._sizes)

    def slopes(self, unknowns: Array) -> Array:
        """(m,) derivatives of the values by the unknowns."""
        return np.where(self.positive, self.values(unknowns), self._sizes)

    def stretch(self, unknowns: Array) -> Array:
        """(m,) derivatives of the unknowns by coordinates in which errors are spread evenly.

        Those of what may be zero are parts of its value, or of a hundredth of that at the start where it is less.
        """
        return np.fmax(1.0, np.exp(np.fmin(self.floor - unknowns, 600.0)))  # so small a value has no slope

    def ends(self, unknowns: Array, reach: Array, bounds: tuple[Array, Array]) -> Array:
        """(m,) values so far away in these coordinates, within the bounds (m,) and (m,) of the unknowns."""
        with np.errstate(invalid="ignore"):  # no number stays none
            straight = self.values(unknowns) + reach * self.slopes(unknowns) * self.stretch(unknowns)
            return np.clip(np.where(self.to_zero, straight, self.values(unknowns + reach)), *map(self.values, bounds))


class ScaledCurves:
    """Sources as a function of scaled unknowns.

    Args:
        sources: what is computed, one after the other.
        scale: of the unknowns.
    """

    def __init__(self, sources: Sequence[Source], scale: Scaling) -> None:
        self._sources, self._scale = tuple(sources), scale
        self._count: int | None = None
        self._values, self._slopes = BoundedCache[bytes, Array](), BoundedCache[bytes, Array](1)
        self.by_differences = False
        """Whether derivatives had to be had by differences at some values."""

    def _parameters(self, unknowns: Array) -> dict[str, float]:
        values, limits = self._scale.values(unknowns), np.finfo(float)
        # What must stay above zero may have become too small for any number, and a step too long.
        values = np.where(self._scale.positive, np.clip(values, limits.tiny, limits.max), values)
        return dict(zip(self._scale.names, values.tolist(), strict=True))

    def values(self, unknowns: Array) -> Array:
        """(N,) computed; NaN where there is no motion, so that a shorter step is tried."""
        return self._values(unknowns.tobytes(), lambda: self._computed(unknowns))

    def _computed(self, unknowns: Array) -> Array:
        try:
            values = self._read(unknowns)
        except ShaftworkError:
            if self._count is None:
                raise
            return np.full(self._count, np.nan)
        self._count = values.size
        return values

    def _read(self, unknowns: Array) -> Array:
        parameters = self._parameters(unknowns)
        return np.concatenate([source.values(parameters) for source in self._sources])

    def slopes(self, unknowns: Array) -> Array:
        """(N, m) derivatives by the unknowns."""
        return self._slopes(unknowns.tobytes(), lambda: self._differentiated(unknowns))

    def _differentiated(self, unknowns: Array) -> Array:
        parameters = self._parameters(unknowns)
        return np.vstack([self._along(source, parameters, unknowns) for source in self._sources])

    def _along(self, source: Source, parameters: Mapping[str, float], unknowns: Array) -> Array:
        exact = None
        with suppress(SimulationError):  # something is touched only just, or two changes come together
            exact = source.slopes(parameters)
        if exact is not None:
            return exact * self._scale.slopes(unknowns)
        self.by_differences = True
        steps = np.full(unknowns.size, 1e-4)  # a motion is known to 1e-9 and more: so its differences are to some 1e-5
        return differences(lambda point: source.values(self._parameters(point)), unknowns, steps)


class RecordedMotion:
    """Quantities of a motion at the times of a record.

    Args:
        motion: of the network.
        samples: by quantity, the times (k,) in s at which it was measured.
        order: (m,) places of the unknowns among the parameters of the motion.
        last: values of the unknowns, and their motion.
        share: of the motion, from its start on, that is computed.
    """

    def __init__(
        self,
        motion: ParametricMotion,
        samples: Mapping[str, Array],
        order: Sequence[int],
        last: tuple[Mapping[str, float], DifferentiatedMotion],
        share: float = 1.0,
    ) -> None:
        self._motion, self._samples, self._order, self._last, self._share = motion, samples, order, last, share

    def beginning(self) -> tuple[RecordedMotion, NDArray[np.bool_]]:
        """The first sixteenth of the record alone, and (N,) which values it holds: in so few periods an oscillation
        keeps in step with the record from a start that is far off, and a short motion costs little.
        """
        share = 1 / 16
        there = {name: times <= share * last_of(self._samples) for name, times in self._samples.items()}
        samples = {name: times[there[name]] for name, times in self._samples.items() if there[name].any()}
        part = RecordedMotion(self._motion, samples, self._order, self._last, share)
        return part, np.concatenate(list(there.values()))

    def _followed(self, parameters: Mapping[str, float]) -> DifferentiatedMotion:
        if self._last[0] != parameters:
            self._last = parameters, self._motion.motion(parameters, self._share)
        return self._last[1]

    def values(self, parameters: Mapping[str, float]) -> Array:
        """(N,) computed."""
        solution = self._followed(parameters).solution
        return _in_turn(solution, self._samples)

    def slopes(self, parameters: Mapping[str, float]) -> Array:
        """(N, m) derivatives by the parameters."""
        slopes = self._motion.slopes(self._followed(parameters), parameters)
        return np.vstack([slopes.along(name, times) for name, times in self._samples.items()])[:, self._order]


def sizes_of(start: Mapping[str, float], sources: Sequence[Source], measured: Array) -> Array:
    """(m,) sizes of unknowns: those at the start; of one that is zero, what moves the computed values by the size of
    the record.
    """
    sizes, ones = np.abs(list(start.values())), np.ones(len(start))
    if sizes.all():
        return sizes
    scale = Scaling(start, ones < 0, ones, ones < 0)
    moved = np.linalg.norm(ScaledCurves(sources, scale).slopes(scale.unknowns(np.array(list(start.values())))), axis=0)
    size = float(np.linalg.norm(measured))
    return np.where(sizes > 0.0, sizes, np.divide(size, moved, out=ones, where=(moved > 0.0) & (size > 0.0)))


class SimulatedMotion:
    """The same by simulation alone, where equations are not symbolic or controllers sample.

    Args:
        model: the compiled network.
        samples: by quantity, the times (k,) in s at which it was measured.
        initial: start values.
        rtol: relative tolerance.
    """

    def __init__(self, model: Model, samples: Mapping[str, Array], initial: Mapping[str, float], rtol: float) -> None:
        self._model, self._samples, self._initial, self._rtol = model, samples, initial, rtol
        self._end = last_of(samples)

    def values(self, parameters: Mapping[str, float]) -> Array:
        """(N,) computed."""
        starts = {name: value for name, value in parameters.items() if name not in self._model.parameters}
        values = {name: value for name, value in parameters.items() if name not in starts}
        motion = self._model.simulate(
            self._end, initial={**self._initial, **starts}, parameters=values, rtol=self._rtol, t_eval="steps"
        )
        return _in_turn(motion, self._samples)

    def slopes(self, parameters: Mapping[str, float]) -> None:  # noqa: ARG002 (by differences)
        """None: by differences."""
        return


class RecordedResponse:
    """Frequency responses at the frequencies of a record, real parts before imaginary ones.

    Args:
        model: the compiled network.
        samples: by output and input, the frequencies (k,) in Hz.
        at: the point about which the network swings.
    """

    def __init__(self, model: Model, samples: Mapping[tuple[str, str], Array], at: Mapping[str, float] | None) -> None:
        self._model, self._samples, self._at = model, samples, at

    def values(self, parameters: Mapping[str, float]) -> Array:
        """(N,) computed."""
        outputs, inputs = (tuple(dict.fromkeys(names)) for names in zip(*self._samples, strict=True))
        linear = self._model.linearize(self._at, inputs=inputs, outputs=outputs, parameters=parameters)
        parts: list[Array] = []
        for (output, source), f in self._samples.items():
            response = linear.frequency_response(source, output, f).values
            parts += [np.asarray(response.real), np.asarray(response.imag)]
        return np.concatenate(parts)

    def slopes(self, parameters: Mapping[str, float]) -> None:  # noqa: ARG002 (by differences)
        """None: by differences."""
        return


def _in_turn(motion: Solution, samples: Mapping[str, Array]) -> Array:
    """(N,) quantities at their times, one after the other.

    Raises:
        ParameterError: one is a profile.
    """
    for name in samples:
        if name in motion.observer.profiles:
            ends = [other for other in motion.observer.units if other.startswith(f"{name}_")]
            raise ParameterError(
                f"'{name}' has values at many places along its part, and the record one. Name it as the record of one "
                f"place: {' or '.join(ends)}."
            )
    return np.concatenate([motion.at(times)[name] for name, times in samples.items()])


def last_of(samples: Mapping[str, Array]) -> float:
    """The last of all times, s."""
    return max(float(times[-1]) for times in samples.values())


_MOTIONS = BoundedCache[tuple[Any, ...], tuple[Mapping[str, float], ParametricMotion]]()
"""Of the last records, with the values for which each was made: the next fit like the last one compiles nothing."""


def recorded_motion(
    model: Model,
    samples: Mapping[str, Array],
    start: Mapping[str, float],
    initial: Mapping[str, float],
    rtol: float,
) -> Source:
    """The motion with exact derivatives, or without where there are none.

    Args:
        model: the compiled network.
        samples: by quantity, the times (k,) in s at which it was measured.
        start: of parameters, and of states whose start values are unknown, in SI.
        initial: start values of the other states.
        rtol: relative tolerance of the derivatives.
    """
    values = {name: value for name, value in start.items() if name in model.parameters}
    starts = tuple(name for name in start if name not in values)
    states = {**initial, **{name: start[name] for name in starts}}
    names, span = (tuple(samples), (), tuple(values)), (0.0, last_of(samples))
    key = (model, *names, span, tuple(sorted(states.items())), rtol, starts)
    try:
        at, motion = _MOTIONS(key, lambda: (start, ParametricMotion(model, *names, span, states, rtol, starts, values)))
    except (CompileError, SimulationError):  # too large for symbols, or sampled
        return SimulatedMotion(model, samples, initial, closer(rtol))
    order = [list(motion.parameters).index(name) for name in start]
    return RecordedMotion(motion, samples, order, (at, motion.nominal))
