"""The instants at which the laws of a network jump or bend because of the time alone, found before the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from sympy import Expr, Min, Symbol, pi, sin

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.codegen.code import scalar, vectorised
from shaftwork.codegen.timeline import (
    NOTHING,
    SEARCH,
    Sides,
    Timeline,
    bumps,
    changes_of,
    nearest,
    sampled,
    timeline,
)
from shaftwork.components.discontinuities import line, narrow_places, switches, unsolved_places
from shaftwork.components.laws import t as TIME
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import ParameterError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.sampling_instants import sampling_instants
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.numerics.tolerances import CLEARANCE

DECADES = np.array([sign * 10.0**-place for place in range(1, 13) for sign in (-1, 1)])
"""Distances from a pulse that goes on far away, as parts of the run: no step gets from one to the next unawares."""
MOST_PULSES = 10_000
"""Pulses of a law at which engines end a step: each takes 0.1 ms, so more would take longer than the run."""


@dataclass(frozen=True, eq=False)
class _Switch:
    """An argument in laws of time, and the levels at which it switches.

    Args:
        part: whose law it is, for messages.
        argument: the expression, for messages.
        levels: increasing.
        places: of its parameters in the parameter vector.
        line: from their values to slope and offset, or None where the argument is not linear in time.
        value: from times (k,) and their values to the argument (k,).
        shown: the argument in the symbols of the network.
        whole: the line passes a level at every whole number, and these are not in `levels`.
        acts: it is in the law of a branch, and not in what ends a mode alone.
        far: what a law has where it is zero goes on far away from there.
    """

    part: str
    argument: Expr
    levels: Array
    places: tuple[int, ...]
    line: Callable[..., Sequence[float]] | None
    value: Callable[..., Any]
    shown: Expr
    whole: bool = False
    acts: bool = True
    far: bool = False

    def straight(self, p: Array) -> tuple[float, float]:
        """Slope and offset of one that is linear in time."""
        assert self.line is not None  # noqa: S101 (the caller asks only then)
        slope, offset = self.line(*(float(p[place]) for place in self.places))
        return float(slope), float(offset)

    def on_a_line(self, levels: Array, p: Array) -> list[tuple[float, float]]:
        """Times in s at which one that is linear in time passes levels, and the reach of their rounding."""
        slope, offset = self.straight(p)
        if slope == 0:
            return []
        with np.errstate(all="ignore"):
            times = (levels - offset) / slope + 0.0
            reach = CLEARANCE / 2 * np.finfo(float).eps * (np.abs(levels) + abs(offset)) / abs(slope)
        return [(time, far) for time, far in zip(times.tolist(), reach.tolist(), strict=True) if math.isfinite(time)]

    def changes(self, p: Array, t0: float, t_end: float) -> list[tuple[float, float]] | None:
        """Times in s at which it changes sides, in a run at least, and their reach; None where too often."""
        if self.line is None:
            return self._searched(p, t0, t_end)
        if not self.whole:
            return self.on_a_line(self.levels, p)
        slope, offset = self.straight(p)
        low, high = sorted((slope * t0 + offset, slope * t_end + offset))
        if not high - low < SEARCH.most // SEARCH.resolved:
            return None
        return self.on_a_line(np.arange(math.floor(low), math.ceil(high) + 1, dtype=float), p)

    def _searched(self, p: Array, t0: float, t_end: float) -> list[tuple[float, float]] | None:
        """Times in s at which it changes sides in a run, and the reach of their rounding; None where too often."""
        argument, sides = self.course(p), self.sides(p)
        t = sampled(sides, t0, t_end)
        if t is None:
            return None
        if self.levels.size == 1:
            t = np.sort(np.append(t, nearest(lambda at: np.abs(argument(at) - self.levels[0]), t)))
        return changes_of(sides, t)

    def course(self, p: Array) -> Callable[[Array], Array]:
        """The argument as a function of times (k,)."""
        values = [float(p[place]) for place in self.places]

        def course(t: Array) -> Array:
            with np.errstate(all="ignore"):
                return np.broadcast_to(np.asarray(self.value(t, *values), dtype=float), t.shape)

        return course

    def sides(self, p: Array) -> Sides:
        """Its sides, of one that passes every whole number those of the line."""
        if self.whole:
            slope, offset = self.straight(p)
            return lambda t: np.floor(slope * t + offset).astype(np.intp)
        course = self.course(p)

        def sides(t: Array) -> Index:
            x = course(t)
            number = np.searchsorted(self.levels, x, side="left") + np.searchsorted(self.levels, x, side="right")
            return np.where(np.isnan(x), -1, number)

        return sides


class Switching:
    """What switches in the laws of a network because of the time alone.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self._switches = tuple(_switches(form))
        self._narrow = tuple(_narrow(form))
        self._unsolved = tuple(_unsolved(form))
        every = (*self._switches, *self._narrow, *self._unsolved)
        self.places = sorted({place for one in every for place in one.places})
        """Of the parameters on which the instants depend."""
        self._form = form
        self._timelines = BoundedCache[tuple[bytes, float, float, bool], Timeline]()

    def known(self, p: Array) -> tuple[float, ...]:
        """Times in s of switches that are linear in time, increasing: they are known without a run.

        Those that never end, sample after sample, are left out.
        """
        single = (switch for switch in self._switches if switch.line is not None and not switch.whole)
        return tuple(sorted({time for switch in single for time, _ in switch.on_a_line(switch.levels, p)}))

    def clocks(self, p: Array) -> tuple[tuple[str, float], ...]:
        """The parts whose mode ends at times in s that are known without a run, each with such a time."""
        modes = (switch for switch in self._switches if not switch.acts and switch.line is not None)
        times = ((one.part, time) for one in modes if not one.whole for time, _ in one.on_a_line(one.levels, p))
        return tuple(dict.fromkeys(times))

    def endless(self, p: Array) -> tuple[str, ...]:
        """The parts whose laws switch at every so many seconds without end, as held noise does."""
        whole = (switch for switch in self._switches if switch.whole and switch.acts and switch.straight(p)[0])
        return tuple(dict.fromkeys(switch.part for switch in whole))

    def passed(self, p: Array, before: float, after: float, *, modes: bool = False) -> tuple[Expr, ...]:
        """What makes the law of a branch jump or bend between two times in s, in the symbols of the network.

        Args:
            p: parameter vector.
            before: s.
            after: s.
            modes: also what ends a mode.
        """
        switches, times = (one for one in self._switches if one.acts or modes), np.array([before, after])
        return tuple(dict.fromkeys(one.shown for one in switches if np.ptp(one.sides(p)(times))))

    def timeline(self, p: Array, t0: float, t_end: float, *, modes: bool = True) -> Timeline:
        """The instants of a run from t0 to t_end in s with a parameter vector; without `modes` those of laws alone.

        Law: a switch that is linear in time, or the sine of something linear, is solved for it. Any other is sampled at
        times that are spread without a pattern, until four times as many show no more changes of side; where it only
        comes near its level it is followed to its nearest approach. Each change is then bisected to the last digit.

        Raises:
            ParameterError: a law switches too often to be followed.
        """
        if not (self._switches or self._narrow or self._unsolved or self._form.samples):
            return NOTHING
        key = (p[self.places].tobytes(), t0, t_end, modes)
        return self._timelines(key, lambda: self._searched(p, t0, t_end, modes=modes))

    def _searched(self, p: Array, t0: float, t_end: float, *, modes: bool) -> Timeline:
        instants: list[tuple[float, float]] = []
        for switch in (one for one in self._switches if one.acts or modes):
            if (changes := switch.changes(p, t0, t_end)) is None:
                raise _too_often(switch, t0, t_end)
            instants += changes
        sampled = (bumps(one.course(p), t0, t_end).tolist() for one in self._unsolved)
        stops = (*_inside(self._narrow, p, t0, t_end), *chain.from_iterable(sampled))
        return timeline(instants, t0, t_end, (*stops, *sampling_instants(self._form, t0, t_end)))


def _switches(form: StateForm) -> Iterator[_Switch]:
    """The switches of time alone, each once."""
    arguments: dict[Expr, tuple[tuple[Expr, Sequence[float]], ...]] = {}
    seen: set[Any] = set()
    for part, law, parameters, acts in _laws(form):
        if law not in arguments:
            moving = switches(law) if law.has(TIME) else ()
            if not acts:  # a mode ends at that very time, or at the last of several
                times = law.args if isinstance(law, Min) else (law,)
                moving = (*moving, *((time, (0.0,)) for time in times if line(time) is not None))
            arguments[law] = tuple((argument, levels) for argument, levels in moving if argument.has(TIME))
        for argument, levels in arguments[law]:
            symbols = tuple(symbol for symbol in parameters if argument.has(symbol))
            key = (argument, tuple(levels), tuple(part.parameters[symbol.name] for symbol in symbols))
            if argument.free_symbols <= {TIME, *symbols} and key not in seen:
                seen.add(key)
                yield _switch(part, argument, levels, symbols, acts=acts)


def _narrow(form: StateForm) -> Iterator[_Switch]:
    """Where laws may have pulses and edges that are narrower than any step."""
    for part, law, symbols, _ in _laws(form):
        for argument, far in narrow_places(law) if law.has(TIME) else ():
            if argument.free_symbols <= {TIME, *symbols}:
                yield _switch(part, argument, (0.0,), symbols, far=far)


def _unsolved(form: StateForm) -> Iterator[_Switch]:
    """Functions of time that are sampled for pulses and edges."""
    for part, law, symbols, _ in _laws(form):
        for function in dict.fromkeys(unsolved_places(law, symbols)) if law.has(TIME) else ():
            yield _switch(part, function, (), symbols)


def _inside(switches: Sequence[_Switch], p: Array, t0: float, t_end: float) -> Iterator[float]:
    """Times in s at which arguments are zero, where they are not too many to be followed."""
    for one in switches:
        changes = one.changes(p, t0, t_end) or []
        for time, _ in changes if len(changes) <= MOST_PULSES else ():
            yield time
            yield from (time + DECADES * (t_end - t0)).tolist() if one.far else ()


def _laws(form: StateForm) -> Iterator[tuple[GraphPart, Expr, tuple[Symbol, ...], bool]]:
    """The laws of all branches, and what ends the modes of all parts, with the parameters that may stand in them.

    The last tells the ones from the others.
    """
    for branch in form.graph.branches:
        if branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE):
            yield form.graph.part_of(branch.index), branch.template.law, branch.template.symbols, True
    for part in form.graph.parts:
        symbols = tuple(Symbol(name, real=True) for name in part.parameters)
        for mode in (mode for element in part.modes for mode in element.options):
            yield from ((part, leave.when, symbols, False) for leave in mode.leaves)


def _switch(
    part: GraphPart,
    argument: Expr,
    levels: Sequence[float],
    symbols: Sequence[Symbol],
    *,
    acts: bool = True,
    far: bool = False,
) -> _Switch:
    whole = _whole_line(argument) if tuple(levels) == (0.0,) else None
    straight = whole or line(argument)
    return _Switch(
        part.name,
        argument,
        np.array(levels, dtype=float),
        tuple(part.parameters[symbol.name] for symbol in symbols),
        None if straight is None else scalar(symbols, straight),
        vectorised((TIME, *symbols), argument),
        argument.xreplace({symbol: Symbol(f"{part.name}.{symbol.name}", real=True) for symbol in symbols}),
        whole is not None,
        acts,
        far,
    )


def _whole_line(argument: Expr) -> tuple[Expr, Expr] | None:
    """Slope and offset of a line in t that is a whole number where an argument is zero, else None: x of sin(pi x)."""
    _, factor = argument.as_coeff_Mul()
    return line(factor.args[0] / pi) if isinstance(factor, sin) else None


def _too_often(switch: _Switch, t0: float, t_end: float) -> ParameterError:
    return ParameterError(
        f"'{switch.part}': a law that changes with the sign of {switch.argument} switches too often between "
        f"t = {t0:g} s and {t_end:g} s to be followed: more than {SEARCH.most // SEARCH.resolved} times, or without "
        "end. Take a shorter run, or a smooth law."
    )
