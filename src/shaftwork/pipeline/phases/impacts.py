"""Impacts: speeds that change at once where parts become joined, are thrown back or are pulled along by a jump."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from sympy import Integer

from shaftwork.codegen.observer import Impact
from shaftwork.components.branches import INTEGRAL
from shaftwork.components.modes import Leave, Mode
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.phases.collisions import Collisions
from shaftwork.pipeline.phases.contacts import limited
from shaftwork.pipeline.phases.hybrid_state import CLEAR, Change, HybridState, Transition
from shaftwork.pipeline.phases.impulses import Blow, ImpactStage, Impulses
from shaftwork.pipeline.phases.mode_machines import NO_IMPACT, ActiveGuard, ModeMachine, ModeNames
from shaftwork.pipeline.phases.regimes import Regimes, with_modes


class Impacts:
    """What speeds are after parts have met.

    Args:
        regimes: combinations of modes.
        elements: of the network.
        together: whether what touches is hit in the same instant as what hits it.
    """

    def __init__(self, regimes: Regimes, elements: Sequence[ModeMachine], *, together: bool) -> None:
        self._regimes, self._elements = regimes, elements
        self._impulses = Impulses(regimes, elements)
        self._collisions = Collisions(regimes, elements, self._impulses, together=together)
        self.gears = self._impulses.gears

    def meets(self, moment: HybridState, t: float, to: Mode, number: int) -> float:
        """The speed across an element that is joined from now on; zero where it is no more than an error of the run."""
        regime, modes = moment.regime, self._elements[number].modes
        if to.form in (modes.options[0].form, modes[regime.modes[number]].form):
            return 0.0
        speed = moment.across(number, t)
        speeds = moment.x[: len(regime.assembly.model.form.across_states)]
        least = NO_IMPACT * np.abs(speeds).max(initial=1.0)
        # so long ago as its guard may be found late, and twice that to be sure
        before = moment.moved(t, -2 * CLEAR * regime.tick).across(number, t)
        if abs(speed) <= least or abs(speed) <= abs(speed - before):
            return 0.0
        try:
            joined = self._regimes.changed(moment, t, with_modes(regime.modes, {number: to.name}))
        except NetworkError:
            return speed
        held, after = self._regimes.held(moment, t), self._regimes.held(joined, t)
        # between dampers alone a speed is whatever their torques make it: joining them stops no inertia
        return speed if any(abs(after[name] - value) > least for name, value in held.items()) else 0.0

    def fastest(self, t: float, moment: HybridState, number: int, ended: ActiveGuard) -> tuple[int, ActiveGuard]:
        """Of what is hit at an instant in s what closes fastest, element and guard: impacts follow each other."""
        if ended.leave.rebound is None:
            return number, ended
        contact = self._collisions.fastest(t, moment, number, ended.leave)
        if contact is None or contact.number == number:
            return number, ended
        return next(pair for pair in moment.regime.watched if pair[1].leave is contact.leave)

    def hit(self, t: float, after: float, moment: HybridState, number: int, leave: Leave) -> Transition:
        """An impact of all contacts that touch: each is joined, or for an instant where it is thrown back."""
        regime, held = moment.regime, self._regimes.held(moment, after)
        found = self._collisions.impact(after, moment, number, leave)
        new, hits = found.after, list[Change]()
        contacts = sorted((*found.stays, *found.thrown), key=lambda contact: contact.number != number)
        for contact in contacts:
            rebound = contact in found.thrown
            energies = {} if hits else {"given": found.given, "lost": found.lost}
            element = self._elements[contact.number]
            hits.append(Change(t, element, contact.apart, contact.joined, rebound, impact=True, **energies))
            if not rebound and contact.leave is not None:
                new = self._at_limit(new, contact.number, contact.leave)
        new = self._kept(after, regime.modes, new)
        besides = {contact.number for contact in contacts}
        changes = [*hits, *self._differences(t, regime.modes, new.regime.modes, besides)]
        self._refuse_gain(t, moment, held, self._regimes.held(new, after), hits[0])
        return new, changes

    def is_last(self, t: float, moment: HybridState, new: HybridState, number: int, ended: ActiveGuard) -> bool:
        """Whether a rebound would lose less than it gains, as it is found late by rounding.

        Args:
            t: s.
            moment: what was before.
            new: after it, with gears in the modes in which they have passed it on.
            number: of the element.
            ended: its guard.
        """
        share, speed = moment.regime.constant(number, ended.leave.rebound), moment.across(number, t)
        late = ended.side * moment.course(t)[3][ended.guard]
        # gears that have not turned round go on as they were
        before = moment.regime.modes
        same = {k: before[k] for k in self.gears if moment.across(k, t) * new.across(k, t) >= 0}
        modes = with_modes(new.regime.modes, same)
        flies = self._regimes.changed(new, t, modes) if self._regimes.possible(modes) else new
        step = flies.regime.ahead(flies.course(t)[2])
        later = flies.moved(t, step).across(number, t + step)
        pushed = math.copysign(1.0, speed) * (later - flies.across(number, t)) / step
        return 0 < (1 - share**2) * speed**2 < 4 * late * pushed

    def jammed(self, t: float, moment: HybridState, new: HybridState) -> HybridState:
        """What a gear that jams stops at once: what holds by a limited torque slips in that, and contacts part.

        Args:
            t: s.
            moment: what was before.
            new: after it, with all stopped that is joined.
        """
        held, stopped = self._regimes.held(moment, t), self._regimes.held(new, t)
        least = NO_IMPACT * max([1.0, *(abs(held[name]) for name in moment.regime.assembly.stores.names)])
        if all(abs(stopped[name] - value) <= least for name, value in held.items()):
            return new
        return self._collisions.pulled(t, t, moment, new.regime.modes, least)[0]

    def _kept(self, t: float, before: ModeNames, moment: HybridState) -> HybridState:
        """Contacts that part in an impact of others, and are pushed back before they could be found again, stay closed.

        Without it they would open and close for ever, each time as far beyond their limit as rounding hides it.
        """
        regime = moment.regime
        parted = [
            (k, made)
            for k, made in regime.watched
            if before[k] != regime.modes[k] and made.leave.to == before[k] and made.leave.rebound is not None
        ]
        if not parted:
            return moment
        bands, kept = regime.bands(moment.course(t)), {}
        for k, made in parted:
            way = float(made.leave.when.diff(INTEGRAL))
            speed, later = (way * one.across(k, t) for one in (moment, moment.moved(t, 1.0)))
            if speed**2 < 4 * (later - speed) * CLEAR * bands[made.guard]:
                kept[k] = before[k]
        return self._collisions.joined(t, moment, kept) if kept else moment

    @staticmethod
    def _at_limit(moment: HybridState, number: int, leave: Leave) -> HybridState:
        """What stays in contact is on its limit: from a little beyond it each flight would gain speed."""
        assembly, slope = moment.regime.assembly, leave.when.diff(INTEGRAL)
        place = assembly.twist(number)
        if place is None or not slope:
            return moment
        x = moment.x.copy()
        x[place] = -moment.regime.constant(number, leave.when.xreplace({INTEGRAL: Integer(0)}) / slope)
        return moment._replace(x=x)

    def _refuse_gain(
        self, t: float, moment: HybridState, before: Mapping[str, float], after: Mapping[str, float], hits: Change
    ) -> None:
        """Refuse an impact that would leave more energy than there was.

        Raises:
            SimulationError: no combination of modes that was tried passes the impulse on without a gain.
        """
        stores, bound = moment.regime.assembly.stores, moment.regime.assembly.bound(moment.regime.p)
        had, has = stores.energy(bound, before), stores.energy(bound, after)
        if has - had > sum(hits.given.values()) + NO_IMPACT * max(had, has):
            raise SimulationError(
                f"The impact of '{hits.element.name}' at t = {t:.9g} s would raise the stored energy from {had:.6g} to "
                f"{has:.6g} J: it passes through several parts at once in no way that is known. Give the contact a "
                "stiffness c and a damping d."
            )

    def jumped(
        self, t: float, moment: HybridState, before: float, after: float
    ) -> tuple[HybridState, list[Change], Impact]:
        """After a source has jumped that is rigidly joined to inertias; what it gives then, and what gears lose.

        What holds by a limited torque takes no speed along at once, and contacts are pressed, not pulled.

        Args:
            t: the instant, s.
            moment: what was before.
            before: a time just before it, s, at which inputs are read.
            after: the same just after it.
        """
        regime, begins = moment.regime, self._impulses.begins(moment, before)
        new = moment._replace(x=regime.assembly.bound(regime.p).impulse(moment.x, before, after))
        stages: tuple[ImpactStage, ...] = (ImpactStage(begins, Blow(new, regime), 1.0),)
        # where springs alone take the jump up no impulse passes, and rounding would tell the way of it through gears
        held = self._regimes.held(new, after)
        passes = any(abs(v - begins.held[name]) > NO_IMPACT * max(abs(v), 1.0) for name, v in held.items())
        if passes and (self.gears or self.limited(regime.modes)):
            new, stages = self._collisions.pulled(before, after, moment, regime.modes, NO_IMPACT)
        given = self._impulses.given(after, stages, before)
        at_once = Impact(t, "", given, self._impulses.lost(after, stages))
        return new, self._differences(t, regime.modes, new.regime.modes), at_once

    def limited(self, modes: ModeNames) -> dict[int, tuple[tuple[float, str], ...]]:
        """Elements that join by a torque that is limited, with the sides on which it is and the modes there."""
        return limited(self._elements, modes)

    def _pairs(self, modes: ModeNames) -> enumerate[tuple[ModeMachine, str]]:
        return enumerate(zip(self._elements, modes, strict=True))

    def _differences(
        self, t: float, before: ModeNames, after: ModeNames, besides: Collection[int] = ()
    ) -> list[Change]:
        return [
            Change(t, element, before[k], name)
            for k, (element, name) in self._pairs(after)
            if k not in besides and name != before[k]
        ]
