"""Rigid contacts that are hit in many variants at once, where no other contact is closed or touches.

If the contact stayed closed, states x would become x+, with all momentum that nothing outside takes away. With a
restitution e comes back x + (1 + e) (x+ - x). What holds by friction slips meanwhile, and holds on where nothing moves
across it after the impact. What else may happen where bodies meet, as two contacts at one instant or a gear that rubs,
is left to the event iteration of a single run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import vectorised
from shaftwork.components.branches import INTEGRAL
from shaftwork.core.errors import CompileError
from shaftwork.hybrid.hybrid_state import slipping
from shaftwork.hybrid.impacts.impact_contacts import lasting
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ActiveGuard, GivesWay, limited, with_modes
from shaftwork.numerics.tolerances import TYPED
from shaftwork.sweep.ensemble_equations import Mask, ModeNames, VariantGroup
from shaftwork.sweep.switching.guarded_equations import GuardedEquations


def hits_alone(equations: GuardedEquations, active: ActiveGuard) -> bool:
    """Whether a guard is that of a rigid contact, where no other one is closed and no gear rubs."""
    kirchhoff, leave = equations.kirchhoff, active.leave
    hits = leave.rebound is not None and leave.to != "" and kirchhoff.twist(active.machine) is not None
    slips = slipping(kirchhoff.machines, equations.modes, kirchhoff.watched(equations.modes))
    beside = kirchhoff.resting & slips.keys() or any(lasting(kirchhoff.machines, equations.modes))
    return hits and not beside and not any(machine.modes.passes_on for machine in kirchhoff.machines)


@dataclass(frozen=True, eq=False)
class _Instant:
    """Variants at an instant.

    Args:
        equations: of their modes.
        columns: (names, k) of the parameters that vary.
        t: (k,) s.
        x: (n, k) states.
    """

    equations: GuardedEquations
    columns: Array
    t: Array
    x: Array

    @cached_property
    def p(self) -> Array:
        """(parameters, k)."""
        return self.equations.parameters(self.columns)

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """Rates (n, k) and guards (guards, k)."""
        return self.equations.code.motion(self.t, self.x, self.p)

    def moved(self, step: Array) -> _Instant:
        """The same variants a step (k,) in s later, along a straight line."""
        return _Instant(self.equations, self.columns, self.t, self.x + step * self.motion[0])

    def later(self) -> tuple[Array, _Instant]:
        """A step (k,) in s in which no state moves far, and the variants behind it."""
        step = self.equations.step(self.motion[0])
        return step, _Instant(self.equations, self.columns, self.t + step, self.moved(step).x)

    def taken_to(self, equations: GuardedEquations, there: Mask | slice = slice(None)) -> _Instant:
        """The variants that are marked in other equations: all that is stored goes over."""
        x, columns, t = self.x[:, there], self.columns[:, there], self.t[there]
        if equations.code is self.equations.code:
            return _Instant(equations, columns, t, x)
        stored = self.equations.code.program.points(t, x, self.p[:, there])["stored"]
        return _Instant(equations, columns, t, equations.taken_up(equations.parameters(columns), stored))

    def follows(self, earlier: _Instant) -> Mask:
        """(k,) whether no guard has been met since an earlier instant; a brake may stop what it holds at once."""
        sides = self.equations.sides[:, None]
        return np.asarray(~((sides * earlier.motion[1] < 0) & (sides * self.motion[1] > 0)).any(axis=0))

    def across(self, machine: int) -> Array:
        """(k,) the speed across a contact, of which the twist is a state, or across what slips."""
        place = self.equations.kirchhoff.twist(machine)
        return self.motion[0][place] if place is not None else self.equations.slip(machine, self.motion[1])


class _Hit(NamedTuple):
    """An impact.

    Args:
        closed: with the contact closed.
        limit: (k,) its twist then, rad.
        back: with it open, and thrown back.
        sure: (k,) where that is beyond doubt.
        thrown: (k,) where it is fast enough to be thrown back.
        late: (k,) how long ago it was, s.
        beyond: (k,) how far the guard is beyond its limit.
        loses: (k,) what a rebound takes of the square of the speed.
    """

    closed: _Instant
    limit: Array
    back: _Instant
    sure: Mask
    thrown: Mask
    late: Array
    beyond: Array
    loses: Array


@dataclass(frozen=True, eq=False)
class LaneImpact:
    """A rigid contact that is hit.

    Args:
        equations: in which it is open.
        active: its guard.
        equations_of: those of another combination of modes; raises CompileError where variants cannot run side by side.
    """

    equations: GuardedEquations
    active: ActiveGuard
    equations_of: Callable[[ModeNames], GuardedEquations]

    def follow(self, group: VariantGroup, columns: Array) -> list[VariantGroup]:
        """Past the impact, the variants in which it is beyond doubt.

        Args:
            group: variants at the instant at which the guard is met.
            columns: (names, k) of the parameters that vary.

        Raises:
            CompileError: none of them can be followed side by side.
        """
        hit = self._hit(_Instant(self.equations, columns, group.t, group.x))
        groups, last = list[VariantGroup](), np.zeros(group.lanes.size, dtype=bool)
        for modes, equations, there in self._ends(hit.back, hit.sure & hit.thrown):
            flies = hit.back.taken_to(equations, there)
            # a rebound that would lose less than it gains, as it is found late by rounding, is none
            last[there] = (hit.loses[there] > 0) & (hit.loses[there] < 4 * hit.beyond[there] * self._pushed(flies))
            now = flies.moved(hit.late[there])
            new = group.some(there).going_on(modes, now.t, now.x)
            groups.append(new.some(~last[there] & now.follows(flies)))
        rigid = with_modes(self.equations.modes, {self.active.machine: self.active.leave.to})
        resting = self._ends(hit.closed, hit.sure & ~hit.thrown)
        for modes, equations, there in (*resting, *self._possible([(rigid, last)])):
            rests = hit.closed.taken_to(equations, there)
            rests.x[rests.equations.kirchhoff.twist(self.active.machine)] = hit.limit[there]
            groups.append(group.some(there).going_on(modes, rests.t, rests.x))
        return groups

    def _hit(self, found: _Instant) -> _Hit:
        """The impact of variants in which the guard is met."""
        leave, number = self.active.leave, self.active.machine
        late, beyond = self._late(found)
        before = found.moved(-late)
        loose = self.equations_of(self._apart)
        rigid = self.equations_of(with_modes(self._apart, {number: leave.to}))
        apart, closed = before.taken_to(loose), found.taken_to(loose).taken_to(rigid)
        stopped = apart.taken_to(rigid).taken_to(loose)
        share, rest = (self._constant(constant, before.p) for constant in (leave.rebound, leave.rest))
        back = _Instant(loose, found.columns, found.t, apart.x + (1 + share) * (stopped.x - apart.x))
        closing = self._slope * before.across(number)
        sure = (closing > _least(before)) & (np.abs(stopped.across(number)) <= TYPED * closing)
        loses = (1 - share**2) * closing**2
        return _Hit(closed, self._limit(found), back, sure, closing * share > rest, late, beyond, loses)

    @cached_property
    def _rubbing(self) -> dict[int, GivesWay]:
        """What holds by a limited torque, with the sides on which it slips."""
        return limited(self.equations.kirchhoff.machines, self.equations.modes)

    @cached_property
    def _apart(self) -> ModeNames:
        """The modes in which the contact is open and everything slips."""
        return with_modes(self.equations.modes, {k: sides[0][1] for k, sides in self._rubbing.items()})

    @cached_property
    def _slope(self) -> float:
        """How fast the guard grows with the twist, on the side on which it is met."""
        return self.active.side * float(self.active.leave.when.diff(INTEGRAL))

    def _late(self, found: _Instant) -> tuple[Array, Array]:
        """(k,) how long ago in s the limit was passed, along a straight line, and how far beyond it the guard is."""
        step, later = found.later()
        beyond, ahead = (self.active.side * one.motion[1][self.active.guard] for one in (found, later))
        passed = (beyond > 0) & (ahead > 2 * beyond)
        return np.where(passed, beyond * step / np.where(passed, ahead - beyond, 1.0), 0.0), beyond

    def _limit(self, found: _Instant) -> Array:
        """(k,) the twist at which the contact closes, in rad."""
        twist = found.x[self.equations.kirchhoff.twist(self.active.machine)]
        return np.asarray(twist - self.active.side * found.motion[1][self.active.guard] / self._slope)

    def _pushed(self, flies: _Instant) -> Array:
        """(k,) how fast the speed changes at which the contact closes."""
        step, later = flies.later()
        number = self.active.machine
        return np.asarray(self._slope * (later.across(number) - flies.across(number)) / step)

    def _ends(self, slipping: _Instant, there: Mask) -> Iterator[tuple[ModeNames, GuardedEquations, Mask]]:
        """The modes in which what rubs goes on, and the variants, of those that are marked, that do so."""
        combinations, least = [(slipping.equations.modes, there)], _least(slipping)
        for k, sides in self._rubbing.items():
            speed = slipping.across(k)
            slips = [(name, side * speed > least) for side, name in sides]
            options = [*slips, (self.equations.modes[k], ~np.any([on for _, on in slips], axis=0))]
            combinations = [
                (with_modes(modes, {k: name}), of & on) for modes, of in combinations for name, on in options
            ]
        return self._possible(combinations)

    def _possible(self, ends: Sequence[tuple[ModeNames, Mask]]) -> Iterator[tuple[ModeNames, GuardedEquations, Mask]]:
        """Of modes to which variants go those in which they can be followed, with their equations."""
        for modes, there in ends:
            if there.any():
                with suppress(CompileError):
                    yield modes, self.equations_of(modes), there

    def _constant(self, expression: Expr | None, p: Array) -> Array:
        """What is made of the contact's parameters."""
        kirchhoff = self.equations.kirchhoff
        of_network = kirchhoff.of_machine(self.active.machine, expression)
        symbols, names = tuple(sorted(of_network.free_symbols, key=str)), [*kirchhoff.model.parameters]
        return np.asarray(vectorised(symbols, of_network)(*(p[names.index(symbol.name)] for symbol in symbols)))


def _least(instant: _Instant) -> Array:
    """(k,) the speed up to which there is no impact."""
    speeds = len(instant.equations.code.model.form.across_states)
    return np.asarray(NO_IMPACT * np.maximum(1.0, np.abs(instant.x[:speeds]).max(axis=0, initial=0.0)))
