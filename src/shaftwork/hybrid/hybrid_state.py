"""A hybrid state: the modes of all machines, and the states; how far rounding moves guards, and which are exceeded."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from sympy import Expr, Integer

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import Moves
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.branches import INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Leave, Mode
from shaftwork.hybrid.consistency import (
    clear_of_limit,
    drift,
    moved_by_rounding,
    rounding_moves,
    side_of_limit,
)
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeMachine, ModeNames
from shaftwork.integrate.problem import Guards, Problem, changed

Course = tuple[float, list[float], list[float], list[float]]
"""Time, states, their rates, and guards."""

Excess = tuple[float, ActiveGuard]
"""How far a guard is beyond its limit, or will be."""


class Transition(NamedTuple):
    """When in s which machine passes from which mode to which; or a rebound, back to the mode before.

    With an impact speeds jump; sources of speed have given energy at once, and gears have lost some, in J by part.
    """

    time: float
    machine: ModeMachine
    before: str
    after: str
    rebound: bool = False
    impact: bool = False
    given: Mapping[str, float] = MappingProxyType({})
    lost: Mapping[str, float] = MappingProxyType({})


def differences(
    t: float, machines: Sequence[ModeMachine], before: ModeNames, after: ModeNames, besides: Collection[int] = ()
) -> list[Transition]:
    """The transitions at a time in s from modes to others, in the order of the machines, but for some of these."""
    triples = enumerate(zip(machines, before, after, strict=True))
    return [Transition(t, *names) for k, names in triples if k not in besides and names[1] != names[2]]


class Regime:
    """A combination of modes with its equations, bound to the parameters of a run.

    Args:
        modes: of every machine.
        equations: the equations.
        p: their parameters, numbers of modes among them.
        tick: how far in s rounding moves the time.
        longest: how far in s the further course is looked at, at most.
    """

    def __init__(self, modes: ModeNames, equations: ModeEquations, p: Array, tick: float, longest: float) -> None:
        self.modes, self.equations, self.p, self.tick, self.longest = modes, equations, p, tick, longest
        self.model, self.form, self.stores = equations.model, equations.model.form, equations.stores
        """The compiled equations, their state form, and what they store."""
        self.machines = equations.machines
        """Of the network."""
        self.motion, self.guards_at, self.near = equations.motion(p)
        """Rates and guards at an instant; the guards alone; the guards around an instant, by the `moves` of states."""
        self.sizes, self.sides, self.watched = equations.sizes(p), equations.sides(modes), equations.watched(modes)
        """Nominal size of each state; on which side each guard is met; everything that may end one of the modes."""
        self.right_side = partial(equations.right_side, p)
        """Makes the right-hand side."""
        self.in_place: dict[int, Any] = {}
        """By guard, the in-place transition to which it leads, or None; found when it is first met."""

    @property
    def bound(self) -> BoundArrays:
        """The array program with its parameters."""
        return self.equations.bound(self.p)

    def mode(self, number: int) -> Mode:
        """The mode of a machine."""
        return self.machines[number].modes[self.modes[number]]

    @cached_property
    def problem(self) -> Problem:
        """What is the same in all phases of these modes; the rest is empty."""
        return self.equations.problem(self.modes, self.p)

    @cached_property
    def bends(self) -> bool:
        """Whether what is prescribed, a speed for one, depends on the time: near an instant it is no straight line."""
        branches = self.form.graph.branches
        return any(branches[source].template.law.has(TIME) for source in self.form.across_sources)

    @cached_property
    def ends(self) -> tuple[tuple[int, float], ...]:
        """Number and side of each guard that ends one of the modes."""
        return tuple((active.guard, active.side) for active in self.watched)

    @cached_property
    def moves(self) -> Moves:
        """Of each state a part of it and the least that rounding moves it, to both sides and not alike; the side; and
        how far a look ahead takes it.
        """
        return rounding_moves(self.sizes)

    @cached_property
    def values(self) -> Array:
        """The parameters and what else the equations are made of."""
        return self.equations.values(self.p)

    def constant(self, number: int, expression: Expr | None) -> float:
        """A number that is made of a machine's parameters."""
        return self.equations.constant(number, expression, self.p)

    def twist_limit(self, number: int, leave: Leave) -> tuple[float, float]:
        """The twist in rad at which a mode ends by the twist of its machine, and the slope of the guard there."""
        slope = float(leave.when.diff(INTEGRAL))
        return -self.constant(number, leave.when.xreplace({INTEGRAL: Integer(0)})) / slope, slope

    def course(self, t: float, x: list[float]) -> Course:
        """Rates and guards at a time in s, behind time and states."""
        return t, x, *self.motion(t, x)

    def beside(self, here: Course, side: float = 1.0) -> tuple[float, list[float]]:
        """The time and the states as far away as rounding may move them, to one side or to the other, -1."""
        (t, x, rates, _), tick = here, self.tick
        triples = zip(x, rates, self.moves, strict=True)
        return t + side * tick, [moved_by_rounding(v, rate, move, tick, side) for v, rate, move in triples]

    def bands(self, here: Course, beside: Sequence[float] | None = None) -> list[float]:
        """How far rounding moves each guard: on the side on which no law switches, where one is about to.

        Args:
            here: the course.
            beside: the guards at `beside(here)`, where they are known.
        """
        now = here[3]
        bands = [
            abs(near - guard) for near, guard in zip(beside or self.guards_at(*self.beside(here)), now, strict=True)
        ]
        if not self.model.arrays.inputs.switching:
            return bands
        other = self.guards_at(*self.beside(here, -1.0))
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
        """The speed across a machine at a time in s."""
        return self.speeds((number,), t)[0]

    def speeds(self, numbers: Sequence[int], t: float) -> list[float]:
        """The speeds across machines at a time in s."""
        return self.regime.equations.across(numbers, t, self.x, self.regime.p)

    def stored(self, t: float) -> dict[str, float]:
        """All that is stored, and what arrives by waves, by name, with the inputs of a time in s."""
        regime, stores = self.regime, self.regime.stores
        values = stores.of(lambda: regime.bound, np.array([t]), self.x[None, :])[0]
        return dict(zip(stores.names, values.tolist(), strict=True)) | regime.equations.arriving(self.x)

    def differs(self, other: HybridState, t: float, least: float) -> bool:
        """Whether what is stored in another hybrid state of the same time in s differs by more than so much."""
        stored, others = self.stored(t), other.stored(t)
        return any(abs(others[name] - value) > least for name, value in stored.items())

    @property
    def top_speed(self) -> float:
        """The largest of the speeds that are states."""
        return float(np.abs(self.x[: len(self.regime.form.across_states)]).max(initial=0.0))

    def problem(self, span: tuple[float, float], times: Timeline) -> Problem:
        """The motion of the phase, before it is told where it ends; tolerances are for rtol = 1.

        Its states are those of the equations and, behind them, the integrals of the guards in their `clocks`.
        """
        regime, equations = self.regime, self.regime.equations
        whole, sizes = regime.problem, equations.clock_sizes(span, self.x, regime.p)
        guards = whole.guards
        assert guards is not None  # noqa: S101 (which the equations give)
        now = np.abs(regime.guards_at(span[0], self.x.tolist()))
        return changed(
            whole,
            rhs=equations.right_side(regime.p),
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


EventOutcome = tuple[HybridState, list[Transition]]
"""The hybrid state that goes on after an event, and the transitions that lead there."""


def exceeded(
    state: HybridState,
    t: float,
    before: HybridState,
    idle: Sequence[ActiveGuard] = (),
    *,
    in_order: bool = False,
    again: bool = False,
) -> tuple[HybridState, list[Excess]]:
    """The guards beyond their limits, or on them and about to go beyond, and how far; the hybrid state with its bands.

    Args:
        state: modes and states.
        t: s.
        before: the state before any transition.
        idle: guards that were met here already and lead to no transition.
        in_order: whether the first one will be taken, and not the worst.
        again: whether modes have come back.
    """
    regime, here = state.regime, state.course(t)
    beside, now = regime.course(*regime.beside(here)), here[3]
    bands = regime.bands(here, beside[3])
    wide = bands
    if before.bands and before.regime.equations is regime.equations:
        wide = list(map(max, bands, before.bands))
    beyond, on_limit, clear = [], [], [0.0] * len(now)
    for active in regime.watched:
        excess = active.side * now[active.guard]
        clear[active.guard] = clear_of_limit(excess, bands[active.guard])
        side = side_of_limit(excess, wide[active.guard])
        if side < 0 or active in idle:
            continue
        if side == 0 or active.leave.rebound is not None:  # only what comes nearer is thrown back
            on_limit.append(active)
        else:
            beyond.append((excess, active))
    # impacts come first: torques are those of the motion after them
    hits = [excess for excess in beyond if not excess[1].leave.by_torque]
    # then what the time ends: what else gives way shows when all of that has changed
    timed = [active for active in on_limit if active.leave.by_time]
    hits = hits or (leaving(regime, here, beside, timed, again=False) if timed else [])
    if on_limit and not hits:
        soon_beyond = leaving(regime, here, beside, on_limit, again=again)
        hits = [excess for excess in soon_beyond if excess[1].leave.rebound is not None]
        beyond = beyond + soon_beyond if in_order else beyond or soon_beyond
    return HybridState(regime, state.x, clear), hits or beyond


def leaving(regime: Regime, here: Course, beside: Course, on_limit: list[ActiveGuard], *, again: bool) -> list[Excess]:
    """Of guards on their limit those that are about to go beyond it, and how far, as surely as rounding tells.

    Args:
        regime: the modes.
        here: the course at the instant.
        beside: rounding away from it.
        on_limit: the guards.
        again: whether modes have come back: then what hardly moves yet stays as it is, and its motion will tell. The
            step may lie beyond an instant at which a law switches.
    """
    step = regime.ahead(here[2])
    ahead, ahead_beside, beyond = here, beside, list[Excess]()
    for _ in range(1 if again else 2):  # where nothing moves yet, its acceleration tells
        ahead, ahead_beside = (_further(regime, step, course, bends=not again) for course in (ahead, ahead_beside))
        moving = []
        for active in on_limit:
            k, side = active.guard, active.side
            gain, other = side * (ahead[3][k] - here[3][k]), side * (ahead_beside[3][k] - beside[3][k])
            if drift(gain, other, abs(beside[3][k] - here[3][k])):
                moving.append((gain, active))
        beyond = [one for one in moving if one[0] > 0]
        if beyond:
            break
        on_limit = [active for active in on_limit if all(active is not one for _, one in moving)]
    return beyond


def _further(regime: Regime, step: float, here: Course, *, bends: bool) -> Course:
    """A step further along a straight line; where a prescribed speed bends along a parabola, as all do then (Heun)."""
    ends = regime.course(*regime.later(here, step))
    if not (bends and regime.bends):
        return ends
    t, x, rates, _ = here
    return regime.course(
        t + step, [v + step * (rate + end) / 2 for v, rate, end in zip(x, rates, ends[2], strict=True)]
    )


def passes_limit(state: HybridState, t: float) -> bool:
    """Whether the states are beyond a guard of the modes by more than rounding moves it."""
    now = state.regime.guards_at(t, state.x.tolist())
    wide = state.bands or [0.0] * len(now)
    watched = state.regime.watched
    return any(side_of_limit(active.side * now[active.guard], wide[active.guard]) > 0 for active in watched)


def slipping(
    machines: Sequence[ModeMachine], modes: ModeNames, watched: Sequence[ActiveGuard]
) -> dict[int, ActiveGuard]:
    """Machines that slip, each with the guard at which it would hold, by a torque that is limited."""
    slips = dict[int, ActiveGuard]()
    for active in watched:
        k, to = active.machine, active.leave.to
        if to and any(back.by_torque and back.to == modes[k] for back in machines[k].modes[to].leaves):
            slips[k] = active
    return slips


def resting(state: HybridState, t: float) -> dict[int, str]:
    """Machines that slip, with no speed across them as others hold their ends, and the modes in which they hold."""
    regime = state.regime
    slips = slipping(regime.machines, regime.modes, regime.watched)
    if not slips:
        return {}
    here = state.course(t)
    now, near, still = here[3], regime.guards_at(*regime.beside(here)), regime.equations.resting
    return {
        k: active.leave.to
        for k, active in slips.items()
        if (k in still and active.leave.by_speed) or now[active.guard] == near[active.guard] == 0.0
    }
