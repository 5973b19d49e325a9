"""A moment of a motion through phases: modes, states, and how far rounding moves what ends the modes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import Moves
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Mode
from shaftwork.hybrid.modes.mode_equations import Limits, ModeEquations, Motion, Near
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeMachine, ModeNames
from shaftwork.integrate.problem import Guards, Problem, changed
from shaftwork.pipeline.arguments import NOMINAL

ROUNDINGS = 64.0
"""A guard within so many rounding units of zero is on its limit, and only its further course tells its side."""
CLEAR = 8
"""A phase that starts at a limit or beyond meets it again where it is farther beyond by so many bands."""
NOTHING = 1e-200
"""What is as good as zero, and is not."""
EPS = float(np.finfo(float).eps)
AHEAD, AHEAD_OF_RUN = 1e-3, 1e-7
"""How far ahead the further course is looked at: parts of the time in which a state moves by its nominal size, and of
the run."""
GOLDEN = (5**0.5 - 1) / 2

Course = tuple[float, list[float], list[float], list[float]]
"""Time, states, their rates, and guards."""


class Change(NamedTuple):
    """A change of mode: when in s, of which element, from which mode to which; or a rebound, back to the one before.

    With an impact speeds jump; sources of speed have given energy at once, and gears have lost some, in J by part.
    """

    time: float
    element: ModeMachine
    before: str
    after: str
    rebound: bool = False
    impact: bool = False
    given: Mapping[str, float] = MappingProxyType({})
    lost: Mapping[str, float] = MappingProxyType({})


def together(changes: list[Change]) -> list[Change]:
    """Changes of one instant, with those of each element in one; but an impact stays apart."""
    if any(change.impact for change in changes):
        return changes
    by_element: dict[int, Change] = {}
    for change in changes:
        earlier = by_element.get(id(change.element), change)
        by_element[id(change.element)] = change._replace(before=earlier.before)
    return [change for change in by_element.values() if change.before != change.after]


def without_detours(changes: list[Change]) -> list[Change]:
    """Changes of one instant without those by which an element came back to a mode; but an impact stays."""
    if len(changes) == 1 or any(change.impact for change in changes):
        return changes
    direct: list[Change] = []
    for change in changes:
        of_element = [earlier for earlier in direct if earlier.element is change.element]
        back = next((k for k, earlier in enumerate(of_element) if earlier.before == change.after), None)
        if back is None:
            direct.append(change)
        else:
            direct = [earlier for earlier in direct if earlier not in of_element[back:]]
    return direct


@dataclass(frozen=True, eq=False)
class Regime:
    """A combination of modes with everything that it takes to go on in it; made once for a run.

    Args:
        modes: of every element.
        assembly: the equations.
        p: their parameters, numbers of modes among them.
        motion: rates and guards at an instant.
        limits: the guards alone.
        near: the guards around an instant, by the `moves` of the states.
        sides: (guards,) on which each is met.
        sizes: nominal size of each state.
        watched: everything that may end one of the modes.
        tick: how far in s rounding moves the time.
        longest: how far in s the further course is looked at, at most.
        successors: by guard, where it leads in place; told when it is first met.
    """

    modes: ModeNames
    assembly: ModeEquations
    p: Array
    motion: Motion
    limits: Limits
    near: Near
    sides: Array
    sizes: list[float]
    watched: tuple[ActiveGuard, ...]
    tick: float
    longest: float
    successors: dict[int, Any] = field(default_factory=dict)

    @property
    def elements(self) -> tuple[ModeMachine, ...]:
        """Of the network."""
        return self.assembly.elements

    def mode(self, number: int) -> Mode:
        """The mode of an element."""
        return self.elements[number].modes[self.modes[number]]

    @cached_property
    def bends(self) -> bool:
        """Whether what is prescribed, a speed for one, depends on the time: near an instant it is no straight line."""
        form = self.assembly.model.form
        return any(form.graph.branches[source].template.law.has(TIME) for source in form.across_sources)

    @cached_property
    def ends(self) -> tuple[tuple[int, float], ...]:
        """Number and side of each guard that ends one of the modes."""
        return tuple((active.guard, active.side) for active in self.watched)

    @cached_property
    def equations(self) -> Callable[[], Callable[[float, Array], Array]]:
        """Makes the right-hand side."""
        return partial(self.assembly.right_side, self.p)

    @cached_property
    def moves(self) -> Moves:
        """Of each state a part of it and the least that rounding moves it, to both sides and not alike; the side; and
        how far a look ahead takes it.
        """
        parts = [(-1) ** k * (0.5 + k * GOLDEN % 1) * ROUNDINGS * EPS for k in range(len(self.sizes))]
        pairs = zip(parts, self.sizes, strict=True)
        return [(part, part * size / NOMINAL, math.copysign(1.0, part), AHEAD * size) for part, size in pairs]

    @cached_property
    def values(self) -> Array:
        """The parameters and what else the equations are made of."""
        return self.assembly.values(self.p)

    def constant(self, number: int, expression: Expr | None) -> float:
        """A number that is made of an element's parameters."""
        return self.assembly.constant(number, expression, self.p)

    def course(self, t: float, x: list[float]) -> Course:
        """Rates and guards at a time in s, behind time and states."""
        return t, x, *self.motion(t, x)

    def beside(self, here: Course, side: float = 1.0) -> tuple[float, list[float]]:
        """The time and the states as far away as rounding may move them, to one side or to the other, -1."""
        t, x, rates, _ = here
        each, tick = zip(x, rates, self.moves, strict=True), self.tick
        # all of it to the same side: what a tick moves must not make up for the rest
        return t + side * tick, [
            v + side * (part * abs(v) + least + sign * tick * abs(rate)) for v, rate, (part, least, sign, _) in each
        ]

    def bands(self, here: Course, beside: Sequence[float] | None = None) -> list[float]:
        """How far rounding moves each guard: on the side on which no law switches, where one is about to.

        Args:
            here: the course.
            beside: the guards at `beside(here)`, where they are known.
        """
        now = here[3]
        bands = [abs(near - guard) for near, guard in zip(beside or self.limits(*self.beside(here)), now, strict=True)]
        if not self.assembly.model.arrays.inputs.switching:
            return bands
        other = self.limits(*self.beside(here, -1.0))
        return [min(band, abs(near - guard)) for band, near, guard in zip(bands, other, now, strict=True)]

    def ahead(self, rates: list[float]) -> float:
        """How far in s the further course is looked at: no state moves there by more than a part of its size."""
        step = self.longest
        for rate, (*_, reach) in zip(rates, self.moves, strict=True):
            if rate and reach < step * abs(rate):
                step = reach / abs(rate)
        return step

    def later(self, here: Course, step: float) -> tuple[float, list[float]]:
        """The time and the states a step in s further along a straight line."""
        t, x, rates, _ = here
        return t + step, [v + step * rate for v, rate in zip(x, rates, strict=True)]


class HybridState(NamedTuple):
    """A combination of modes, the states (n,), and how far rounding moves each guard."""

    regime: Regime
    x: Array
    bands: Sequence[float] = ()

    def course(self, t: float) -> Course:
        """The course at a time in s."""
        return self.regime.course(t, self.x.tolist())

    def across(self, number: int, t: float) -> float:
        """The speed across an element at a time in s."""
        return self.speeds((number,), t)[0]

    def speeds(self, numbers: Sequence[int], t: float) -> list[float]:
        """The speeds across elements at a time in s."""
        return self.regime.assembly.across(numbers, t, self.x, self.regime.p)

    @property
    def top_speed(self) -> float:
        """The largest of the speeds that are states."""
        return float(np.abs(self.x[: len(self.regime.assembly.model.form.across_states)]).max(initial=0.0))

    def problem(self, span: tuple[float, float], times: Timeline) -> Problem:
        """The motion of the phase, before it is told where it ends; tolerances are for rtol = 1.

        Its states are those of the equations and, behind them, the integrals of the guards in their `clocks`.
        """
        regime, assembly = self.regime, self.regime.assembly
        whole = assembly.problem(regime.modes, regime.p)
        sizes, guards = assembly.clock_sizes(span, self.x, regime.p), whole.guards
        assert guards is not None  # noqa: S101 (which the equations give)
        now = np.abs(regime.limits(span[0], self.x.tolist()))
        return changed(
            whole,
            x0=np.concatenate([self.x, np.zeros(sizes.size)]),
            t0=span[0],
            t_end=span[1],
            atol=np.concatenate([whole.atol, sizes]),
            sides=times.sides,
            guards=Guards(guards.values, guards.sides, np.array(self.bands), now),
        )

    def moved(self, t: float, step: float) -> HybridState:
        """The same modes a step in s later or earlier, along a straight line."""
        return self._replace(x=self.x + step * np.array(self.course(t)[2])) if step else self


Transition = tuple[HybridState, list[Change]]
"""The state that follows at an instant, and the changes of mode that lead there."""


def clear_of_limit(beyond: float, band: float) -> float:
    """How far beyond zero a guard is met: more where it is near its limit or beyond, for a phase that starts there has
    not met it.

    It is not zero: where a value is exactly zero at the start of a step, heyoka finds none of its later zeros in it.

    Args:
        beyond: how far it is beyond now; negative within its limit.
        band: how far rounding moves it.
    """
    if 2 * beyond > -CLEAR * band:
        return max(beyond, 0.0) + CLEAR * band or NOTHING
    return band / CLEAR or NOTHING


def clear_of_limits(regime: Regime, now: Sequence[float], bands: Sequence[float]) -> list[float]:
    """How far beyond zero each of the guards of a combination of modes is met."""
    clear = [0.0] * len(now)
    for active in regime.watched:
        clear[active.guard] = clear_of_limit(active.side * now[active.guard], bands[active.guard])
    return clear
