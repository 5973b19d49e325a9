"""The instants at which the laws of a network jump or bend because of the time alone, found before the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Min, Symbol, pi, sin

from shaftwork.codegen.bumps import GOLDEN, bumps, irregular
from shaftwork.codegen.code import scalar, vectorised
from shaftwork.codegen.elements import Array
from shaftwork.codegen.timeline import CLEARANCE, NOTHING, Timeline, timeline
from shaftwork.components.discontinuities import line, narrow_places, switches, unsolved_places
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError
from shaftwork.core.kept import Kept
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import StateForm

# A law of time is looked at so many times, and again at four times as many, until it changes sides no more often.
FEWEST_SAMPLES, MOST_SAMPLES = 2**12, 2**22
RESOLVED = 8
"""Samples that there must be for each change of side."""
# Rounding of a linear argument, in units of its terms.
ROUNDINGS = 8
# An argument rounds badly where its terms cancel: it is looked at farther and farther from a change of side, up to this
# part of the run and of the way to the next change, until it keeps its sides.
FARTHEST, CLEAR = 1e-6, 1 / 8
PROBES = np.array([1.0, 1.5, 2.0, 3.0, 4.0])
DECADES = np.array([sign * 10.0**-place for place in range(1, 13) for sign in (-1, 1)])
"""Distances from a pulse that goes on far away, as parts of the run: no step gets from one to the next unawares."""
MOST_PULSES = 10_000
"""Pulses of a law at which engines end a step: each takes 0.1 ms, so more would take longer than the run."""
KEPT = 8
"""Timelines of other runs that are kept."""

Sides = Callable[[Array], NDArray[np.intp]]
"""From times (k,) to the sides of a switch (k,): numbers that differ where it jumps or bends."""


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
        self._places = sorted({place for one in every for place in one.places})
        self._found = Kept[tuple[bytes, float, float, bool], Timeline](KEPT)

    def known(self, p: Array) -> tuple[float, ...]:
        """Times in s of switches that are linear in time, increasing: they are known without a run.

        Those that never end, sample after sample, are left out.
        """
        single = (switch for switch in self._switches if switch.line is not None and not switch.whole)
        times = {time for switch in single for time, _ in _on_a_line(switch, switch.levels, p)}
        return tuple(sorted(times))

    def clocks(self, p: Array) -> tuple[tuple[str, float], ...]:
        """The parts whose mode ends at times in s that are known without a run, each with such a time."""
        modes = (switch for switch in self._switches if not switch.acts and switch.line is not None)
        times = ((one.part, time) for one in modes if not one.whole for time, _ in _on_a_line(one, one.levels, p))
        return tuple(dict.fromkeys(times))

    def endless(self, p: Array) -> tuple[str, ...]:
        """The parts whose laws switch at every so many seconds without end, as held noise does."""
        whole = (switch for switch in self._switches if switch.whole and switch.acts and _straight(switch, p)[0])
        return tuple(dict.fromkeys(switch.part for switch in whole))

    def passed(self, p: Array, before: float, after: float, *, modes: bool = False) -> tuple[Expr, ...]:
        """What makes the law of a branch jump or bend between two times in s, in the symbols of the network.

        Args:
            p: parameter vector.
            before: s.
            after: s.
            modes: also what ends a mode.
        """
        made, times = (one for one in self._switches if one.acts or modes), np.array([before, after])
        return tuple(dict.fromkeys(one.shown for one in made if np.ptp(_sides(one, p)(times))))

    def timeline(self, p: Array, t0: float, t_end: float, *, modes: bool = True) -> Timeline:
        """The instants of a run from t0 to t_end in s with a parameter vector; without `modes` those of laws alone.

        Law: a switch that is linear in time, or the sine of something linear, is solved for it. Any other is sampled at
        times that are spread without a pattern, until four times as many show no more changes of side; where it only
        comes near its level it is followed to its nearest approach. Each change is then bisected to the last digit.

        Raises:
            ParameterError: a law switches too often to be followed.
        """
        if not self._switches and not self._narrow and not self._unsolved:
            return NOTHING
        key = (p[self._places].tobytes(), t0, t_end, modes)
        return self._found(key, lambda: self._searched(p, t0, t_end, modes=modes))

    def _searched(self, p: Array, t0: float, t_end: float, *, modes: bool) -> Timeline:
        found: list[tuple[float, float]] = []
        for switch in (one for one in self._switches if one.acts or modes):
            if (changes := _changes_of(switch, p, t0, t_end)) is None:
                raise _too_often(switch, t0, t_end)
            found += changes
        sampled = (bumps(_argument(one, p), t0, t_end).tolist() for one in self._unsolved)
        return timeline(found, t0, t_end, (*_inside(self._narrow, p, t0, t_end), *chain.from_iterable(sampled)))


def _switches(form: StateForm) -> Iterator[_Switch]:
    """The switches of time alone, each once."""
    found: dict[Expr, tuple[tuple[Expr, Sequence[float]], ...]] = {}
    seen: set[Any] = set()
    for part, law, parameters, acts in _laws(form):
        if law not in found:
            moving = switches(law) if law.has(TIME) else ()
            if not acts:  # a mode ends at that very time, or at the last of several
                times = law.args if isinstance(law, Min) else (law,)
                moving = (*moving, *((time, (0.0,)) for time in times if line(time) is not None))
            found[law] = tuple((argument, levels) for argument, levels in moving if argument.has(TIME))
        for argument, levels in found[law]:
            symbols = tuple(symbol for symbol in parameters if argument.has(symbol))
            places = tuple(part.parameters[symbol.name] for symbol in symbols)
            key = (argument, tuple(levels), places)
            if argument.free_symbols <= {TIME, *symbols} and key not in seen:
                seen.add(key)
                yield replace(_made(part, argument, levels, symbols, places), acts=acts)


def _narrow(form: StateForm) -> Iterator[_Switch]:
    """Where laws may have pulses and edges that are narrower than any step."""
    for part, law, symbols, _ in _laws(form):
        for argument, far in narrow_places(law) if law.has(TIME) else ():
            places = tuple(part.parameters[symbol.name] for symbol in symbols)
            if argument.free_symbols <= {TIME, *symbols}:
                yield replace(_made(part, argument, (0.0,), symbols, places), far=far)


def _unsolved(form: StateForm) -> Iterator[_Switch]:
    """Functions of time that are sampled for pulses and edges."""
    for part, law, symbols, _ in _laws(form):
        for function in dict.fromkeys(unsolved_places(law, symbols)) if law.has(TIME) else ():
            places = tuple(part.parameters[symbol.name] for symbol in symbols)
            yield _made(part, function, (), symbols, places)


def _inside(switches: Sequence[_Switch], p: Array, t0: float, t_end: float) -> Iterator[float]:
    """Times in s at which arguments are zero, where they are not too many to be followed."""
    for one in switches:
        found = _changes_of(one, p, t0, t_end) or []
        for time, _ in found if len(found) <= MOST_PULSES else ():
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


def _made(
    part: GraphPart, argument: Expr, levels: Sequence[float], symbols: tuple[Symbol, ...], places: tuple[int, ...]
) -> _Switch:
    whole = _whole_line(argument) if tuple(levels) == (0.0,) else None
    straight = whole or line(argument)
    return _Switch(
        part.name,
        argument,
        np.array(levels, dtype=float),
        places,
        None if straight is None else scalar(symbols, straight),
        vectorised((TIME, *symbols), argument),
        argument.xreplace({symbol: Symbol(f"{part.name}.{symbol.name}", real=True) for symbol in symbols}),
        whole is not None,
    )


def _whole_line(argument: Expr) -> tuple[Expr, Expr] | None:
    """Slope and offset of a line in t that is a whole number where an argument is zero, else None: x of sin(pi x)."""
    _, factor = argument.as_coeff_Mul()
    return line(factor.args[0] / pi) if isinstance(factor, sin) else None


def _straight(switch: _Switch, p: Array) -> tuple[float, float]:
    """Slope and offset of a switch that is linear in time."""
    assert switch.line is not None  # noqa: S101 (the caller asks only then)
    slope, offset = switch.line(*(float(p[place]) for place in switch.places))
    return float(slope), float(offset)


def _too_often(switch: _Switch, t0: float, t_end: float) -> ParameterError:
    return ParameterError(
        f"'{switch.part}': a law that changes with the sign of {switch.argument} switches too often between "
        f"t = {t0:g} s and {t_end:g} s to be followed: more than {MOST_SAMPLES // RESOLVED} times, or without end. "
        "Take a shorter run, or a smooth law."
    )


def _changes_of(switch: _Switch, p: Array, t0: float, t_end: float) -> list[tuple[float, float]] | None:
    """Times in s at which a switch changes sides, in a run at least, and their reach; None where too often."""
    if switch.line is None:
        return _searched(switch, p, t0, t_end)
    if not switch.whole:
        return _on_a_line(switch, switch.levels, p)
    slope, offset = _straight(switch, p)
    low, high = sorted((slope * t0 + offset, slope * t_end + offset))
    if not high - low < MOST_SAMPLES // RESOLVED:
        return None
    return _on_a_line(switch, np.arange(math.floor(low), math.ceil(high) + 1, dtype=float), p)


def _on_a_line(switch: _Switch, levels: Array, p: Array) -> list[tuple[float, float]]:
    """Times in s at which a switch that is linear in time passes levels, and the reach of their rounding."""
    slope, offset = _straight(switch, p)
    if slope == 0:
        return []
    with np.errstate(all="ignore"):
        times = (levels - offset) / slope + 0.0
        reach = ROUNDINGS * np.finfo(float).eps * (np.abs(levels) + abs(offset)) / abs(slope)
    return [(time, far) for time, far in zip(times.tolist(), reach.tolist(), strict=True) if math.isfinite(time)]


def _searched(switch: _Switch, p: Array, t0: float, t_end: float) -> list[tuple[float, float]] | None:
    """Times in s at which a switch changes sides in a run, and the reach of their rounding; None where too often."""
    argument, sides = _argument(switch, p), _sides(switch, p)
    t = _sampled(sides, t0, t_end)
    if t is None:
        return None
    if switch.levels.size == 1:
        t = np.sort(np.append(t, _nearest(lambda at: np.abs(argument(at) - switch.levels[0]), t)))
    return _changes(sides, t)


def _argument(switch: _Switch, p: Array) -> Callable[[Array], Array]:
    """The argument of a switch at times (k,)."""
    values = [float(p[place]) for place in switch.places]

    def argument(t: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(switch.value(t, *values), dtype=float), t.shape)

    return argument


def _sides(switch: _Switch, p: Array) -> Sides:
    """The sides of a switch, of one that passes every whole number those of the line."""
    if switch.whole:
        slope, offset = _straight(switch, p)
        return lambda t: np.floor(slope * t + offset).astype(np.intp)
    argument = _argument(switch, p)

    def sides(t: Array) -> NDArray[np.intp]:
        x = argument(t)
        found = np.searchsorted(switch.levels, x, side="left") + np.searchsorted(switch.levels, x, side="right")
        return np.where(np.isnan(x), -1, found)

    return sides


def _sampled(sides: Sides, t0: float, t_end: float) -> Array | None:
    """Times (k,) from t0 to t_end between which a switch changes sides at most once, or None."""
    size, before = FEWEST_SAMPLES, -1
    while size <= MOST_SAMPLES:
        t = irregular(t0, t_end, size)
        changes = int(np.count_nonzero(np.diff(sides(t))))
        if changes == before and changes * RESOLVED <= size:
            return np.unique(t)
        size, before = 4 * size, changes
    return None


def _nearest(distance: Callable[[Array], Array], t: Array) -> Array:
    """The times of the least distances between the times (k,), by golden sections."""
    x = distance(t)
    valleys = 1 + np.flatnonzero((x[1:-1] < x[:-2]) & (x[1:-1] < x[2:]))
    low, high = t[valleys - 1], t[valleys + 1]
    for _ in range(80):
        early, late = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = distance(early) < distance(late)
        low, high = np.where(left, low, early), np.where(left, late, high)
    return np.asarray((low + high) / 2)


def _changes(sides: Sides, t: Array) -> list[tuple[float, float]]:
    """Times in s at which a switch changes sides between the times (k,), and the reach of their rounding."""
    grain = math.ulp(max(abs(float(t[0])), abs(float(t[-1]))))
    low, high, old, new = _bisected(sides, t, grain / 1024)
    order = np.argsort(high)
    low, high, old, new = low[order], high[order], old[order], new[order]
    # A zero that is met exactly is a side of its own: two changes, and one instant.
    apart = np.diff(high) > CLEARANCE * grain
    first, last = np.append(True, apart)[: high.size], np.append(apart, True)[: high.size]
    times, width, old, new = high[first], high[last] - high[first], old[first], new[last]
    passed = old != new
    times, width, old, new = times[passed], width[passed], old[passed], new[passed]
    return list(zip(times.tolist(), (width + _reach(sides, t, times, old, new, grain)).tolist(), strict=True))


def _bisected(sides: Sides, t: Array, grain: float) -> tuple[Array, Array, NDArray[np.intp], NDArray[np.intp]]:
    """Every change of side between the times (k,): the last time before it, the first after it, and the two sides."""
    at = sides(t)
    changed = np.flatnonzero(np.diff(at))
    low, high, old, new = t[changed], t[changed + 1], at[changed], at[changed + 1]
    while True:
        middle = low + (high - low) / 2
        done = (high - low <= grain) | (middle <= low) | (middle >= high)
        if done.all():
            return low, high, old, new
        here = sides(middle)
        left, right = ~done & (old != here), ~done & (here != new)
        low = np.concatenate([low[done], low[left], middle[right]])
        high = np.concatenate([high[done], middle[left], high[right]])
        old, new = (
            np.concatenate([old[done], old[left], here[right]]),
            np.concatenate([new[done], here[left], new[right]]),
        )


def _reach(sides: Sides, t: Array, times: Array, old: NDArray[np.intp], new: NDArray[np.intp], grain: float) -> Array:
    """How far from the times (k,) of changes the sides are the old and the new ones, whatever the rounding, in s."""
    gaps = np.diff(times, prepend=-np.inf, append=np.inf)
    farthest = np.minimum(FARTHEST * (t[-1] - t[0]), CLEAR * np.minimum(gaps[:-1], gaps[1:]))
    reach = np.full(times.shape, CLEARANCE * grain)
    while True:
        offsets = reach[:, None] * PROBES
        early, late = np.maximum(times[:, None] - offsets, t[0]), np.minimum(times[:, None] + offsets, t[-1])
        kept = (sides(early.ravel()).reshape(early.shape) == old[:, None]) | (early == t[0])
        kept &= (sides(late.ravel()).reshape(late.shape) == new[:, None]) | (late == t[-1])
        farther = ~kept.all(axis=1) & (4 * reach <= farthest)
        if not farther.any():
            return reach
        reach[farther] *= 4
