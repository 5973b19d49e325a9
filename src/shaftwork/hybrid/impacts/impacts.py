"""Impacts: speeds that change at once where parts become joined, are thrown back or are pulled along by a jump."""

from __future__ import annotations

import math
from dataclasses import replace

from shaftwork.codegen.model_observer import Impact
from shaftwork.components.branches import INTEGRAL
from shaftwork.components.modes import Leave, Mode
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.hybrid.consistency import CLEAR
from shaftwork.hybrid.hybrid_state import EventOutcome, HybridState, Transition, differences
from shaftwork.hybrid.hybrid_transfer import HybridTransfer
from shaftwork.hybrid.impacts.collisions import Collisions
from shaftwork.hybrid.impacts.impact_contacts import in_turn, opens_at, touching
from shaftwork.hybrid.impacts.impulses import ImpactStage, ImpulseOutcome, Impulses
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ActiveGuard, ModeNames, limited, with_modes


class Impacts:
    """What speeds are after parts have met.

    Args:
        transfer: from one combination of modes to another.
        together: whether what touches is hit in the same instant as what hits it.
    """

    def __init__(self, transfer: HybridTransfer, *, together: bool) -> None:
        self._transfer, self._machines = transfer, transfer.machines
        self._impulses, self._together = Impulses(transfer), together
        self._collisions = Collisions(transfer, self._impulses, together=together)
        self.gears = self._impulses.gears

    def meets(self, state: HybridState, t: float, to: Mode, number: int) -> float:
        """The speed across a machine that is rigid from now on; zero where it is no more than an error of the run."""
        regime = state.regime
        if not self._machines[number].is_rigid(to.name) or to.form == regime.mode(number).form:
            return 0.0
        speed = state.across(number, t)
        least = NO_IMPACT * max(1.0, state.top_speed)
        # so long ago as its guard may be found late, and twice that to be sure
        before = state.moved(t, -2 * CLEAR * regime.tick).across(number, t)
        if abs(speed) <= least or abs(speed) <= abs(speed - before):
            return 0.0
        try:
            rigid = self._transfer.to_modes(state, t, with_modes(regime.modes, {number: to.name}))
        except NetworkError:
            return speed
        # between dampers alone a speed is whatever their torques make it: joining them stops no inertia
        return speed if state.differs(rigid, t, least) else 0.0

    def hit(
        self, t: float, after: float, state: HybridState, crossed: ActiveGuard
    ) -> tuple[HybridState, list[Transition], float]:
        """An impact; what hits stays where a rebound would lose less than it gains, as it is found late by rounding.

        It is thrown back where it has passed its limit, and how long ago, in s, is said: what it would gain between
        there and here would add up over many rebounds.
        """
        late = 0.0
        if crossed.leave.rebound is not None:
            crossed = self._fastest(after, state, crossed)
            late = _late(after, state, crossed)
        new, transitions = self._collided(t, after, state.moved(after, -late), crossed.machine, crossed.leave)
        if transitions[0].rebound and self._is_last(after, state, new, crossed):
            stays = replace(crossed.leave, rebound=None)
            return *self._collided(t, after, state, crossed.machine, stays, holds=True), 0.0
        return new, transitions, late

    def _fastest(self, t: float, state: HybridState, crossed: ActiveGuard) -> ActiveGuard:
        """Of what is hit at an instant in s the guard of what closes fastest: impacts follow each other."""
        contacts = [*touching(t, state, crossed.machine, crossed.leave)]
        contacts = contacts if self._together else in_turn(t, state, contacts)
        thrown = [c for c, opens in zip(contacts, opens_at(t, state, contacts), strict=True) if c.share_back(opens)]
        if not thrown or any(contact.number == crossed.machine for contact in thrown):
            return crossed
        contact = thrown[0]
        return next(active for active in state.regime.watched if active.leave is contact.leave)

    def _collided(
        self, t: float, after: float, state: HybridState, number: int, leave: Leave, *, holds: bool = False
    ) -> EventOutcome:
        """An impact of all contacts that touch: each is joined, or for an instant where it is thrown back.

        Where it is but rounding, what holds by friction holds on: else its whole torque would show for a nanosecond.
        """
        regime = state.regime
        collision = self._collisions.impact(after, state, number, leave)
        new, hits = collision.after, list[Transition]()
        contacts = sorted((*collision.stays, *collision.thrown), key=lambda contact: contact.number != number)
        for contact in contacts:
            rebound = contact in collision.thrown
            energies = {} if hits else {"given": collision.given, "lost": collision.lost}
            machine = self._machines[contact.number]
            hits.append(Transition(t, machine, contact.apart, contact.joined, rebound, impact=True, **energies))
            if not rebound and contact.leave is not None:
                new = self._at_limit(new, contact.number, contact.leave)
        new = self._staying(after, regime.modes, new)
        holding = {k: regime.modes[k] for k, sides in limited(self._machines, regime.modes).items() if len(sides) > 1}
        if holds and self._transfer.possible(held := with_modes(new.regime.modes, holding)):
            new = self._transfer.to_modes(new, after, held)
        besides = {contact.number for contact in contacts}
        transitions = [*hits, *differences(t, self._machines, regime.modes, new.regime.modes, besides)]
        self._refuse_gain(after, state, new, hits[0])
        return new, transitions

    def _is_last(self, t: float, state: HybridState, new: HybridState, crossed: ActiveGuard) -> bool:
        """Whether a rebound would lose less than it gains, as it is found late by rounding.

        Args:
            t: s.
            state: what was before.
            new: after it, with gears in the modes in which they have passed it on.
            crossed: the guard of what hits.
        """
        number = crossed.machine
        share, speed = state.regime.constant(number, crossed.leave.rebound), state.across(number, t)
        late = crossed.side * state.course(t)[3][crossed.guard]
        # gears that have not turned round go on as they were
        before = state.regime.modes
        same = {k: before[k] for k in self.gears if state.across(k, t) * new.across(k, t) >= 0}
        modes = with_modes(new.regime.modes, same)
        flies = self._transfer.to_modes(new, t, modes) if self._transfer.possible(modes) else new
        step = flies.regime.ahead(flies.course(t)[2])
        later = flies.moved(t, step).across(number, t + step)
        pushed = math.copysign(1.0, speed) * (later - flies.across(number, t)) / step
        return 0 < (1 - share**2) * speed**2 < 4 * late * pushed

    def jammed(self, t: float, state: HybridState, new: HybridState) -> HybridState:
        """What a gear that jams stops at once: what holds by a limited torque slips in that, and contacts part.

        Args:
            t: s.
            state: what was before.
            new: after it, with all stopped that is joined.
        """
        stored, names = state.stored(t), state.regime.stores.names
        least = NO_IMPACT * max([1.0, *(abs(stored[name]) for name in names)])
        if not state.differs(new, t, least):
            return new
        return self._collisions.pulled(t, t, state, new.regime.modes, least)[0]

    def _staying(self, t: float, before: ModeNames, state: HybridState) -> HybridState:
        """Contacts that part in an impact of others, and are pushed back before they could be found again, stay closed.

        Without it they would open and close for ever, each time as far beyond their limit as rounding hides it.
        """
        regime = state.regime

        def parted(active: ActiveGuard) -> bool:
            was, leave = before[active.machine], active.leave
            return was != regime.modes[active.machine] and leave.to == was and leave.rebound is not None

        closing = [*filter(parted, regime.watched)]
        if not closing:
            return state
        bands, closed = regime.bands(state.course(t)), {}
        for active in closing:
            k, slope = active.machine, float(active.leave.when.diff(INTEGRAL))
            speed, later = (slope * one.across(k, t) for one in (state, state.moved(t, 1.0)))
            if speed**2 < 4 * (later - speed) * CLEAR * bands[active.guard]:
                closed[k] = before[k]
        return self._collisions.join(t, self._impulses.begins(state, t), closed)[-1].outcome.after if closed else state

    @staticmethod
    def _at_limit(state: HybridState, number: int, leave: Leave) -> HybridState:
        """What stays in contact is on its limit: from a little beyond it each flight would gain speed."""
        place = state.regime.equations.twist(number)
        if place is None or not leave.when.has(INTEGRAL):
            return state
        x = state.x.copy()
        x[place], _ = state.regime.twist_limit(number, leave)
        return state._replace(x=x)

    def _refuse_gain(self, t: float, state: HybridState, new: HybridState, hits: Transition) -> None:
        """Refuse an impact that would leave more energy than there was.

        Raises:
            SimulationError: no combination of modes that was tried passes the impulse on without a gain.
        """
        stores, bound = state.regime.stores, state.regime.bound
        had, has = (stores.energy(bound, one.stored(t)) for one in (state, new))
        if has - had > sum(hits.given.values()) + NO_IMPACT * max(had, has):
            raise SimulationError(
                f"The impact of '{hits.machine.name}' at t = {hits.time:.9g} s would raise the stored energy from "
                f"{had:.6g} to {has:.6g} J: it passes through several parts at once in no way that is known. Give the "
                "contact a stiffness c and a damping d."
            )

    def jumped(
        self, t: float, state: HybridState, before: float, after: float
    ) -> tuple[HybridState, list[Transition], Impact]:
        """After a source has jumped that is rigidly joined to inertias; what it gives then, and what gears lose.

        What holds by a limited torque takes no speed along at once, and contacts are pressed, not pulled.

        Args:
            t: the instant, s.
            state: what was before.
            before: a time just before it, s, at which inputs are read.
            after: the same just after it.
        """
        regime, begins = state.regime, self._impulses.begins(state, before)
        new = state._replace(x=regime.bound.impulse(state.x, before, after))
        stages: tuple[ImpactStage, ...] = (ImpactStage(begins, ImpulseOutcome(new, regime), 1.0),)
        # where springs alone take the jump up no impulse passes, and rounding would tell the way of it through gears
        stored = new.stored(after)
        passes = any(abs(v - begins.stored[name]) > NO_IMPACT * max(abs(v), 1.0) for name, v in stored.items())
        if passes and (self.gears or limited(self._machines, regime.modes)):
            new, stages = self._collisions.pulled(before, after, state, regime.modes, NO_IMPACT)
        given = self._impulses.given(after, stages, before)
        at_once = Impact(t, "", given, self._impulses.lost(after, stages))
        return new, differences(t, self._machines, regime.modes, new.regime.modes), at_once


def _late(t: float, state: HybridState, met: ActiveGuard) -> float:
    """How long ago, in s, a guard passed through zero along a straight line."""
    regime, here = state.regime, state.course(t)
    step, beyond = regime.ahead(here[2]), met.side * here[3][met.guard]
    gain = met.side * regime.guards_at(*regime.later(here, step))[met.guard] - beyond
    return beyond * step / gain if 0 < beyond < gain else 0.0
