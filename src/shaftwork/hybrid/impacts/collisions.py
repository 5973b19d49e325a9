"""Impacts as one problem: all contacts and freewheels of the network that touch, whichever of them is hit.

With u the speed at which a contact opens, negative where it closes, and lambda its impulse, nothing closes any more at
the end of the compression, and each contact then gives back the share e of its own impulse (Poisson):

    u' = u + W lambda >= 0,              lambda >= 0,    lambda u' = 0,
    u'' = u' + W (e lambda + mu) >= 0,   mu >= 0,        mu u'' = 0.

For one contact that is Newton's law, u'' = -e u. No impact gains energy, whatever the shares: mu is that impulse after
which the kinetic energy is least, and mu = (1 - e) lambda would leave as much as there was before. Friction, brakes and
clutches pass torques that are limited, and no impulse.

Where a gear rubs, an impact is followed along its impulses, see `impulses`, and beside them all it is the energy that
contacts have taken up of which e^2 comes back.

Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapter 8.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.state_transfer import Mobility, complementary
from shaftwork.components.modes import Leave
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import SimulationError
from shaftwork.hybrid.hybrid_state import HybridState, Regime
from shaftwork.hybrid.hybrid_transfer import HybridTransfer
from shaftwork.hybrid.impacts.impact_contacts import Contact, in_turn, lasting, nodes, opens_at, touching
from shaftwork.hybrid.impacts.impulses import NOTHING_OF, ImpactStage, ImpactStart, ImpulseOutcome, Impulses, summed
from shaftwork.hybrid.modes.mode_equations import KEPT
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, GivesWay, ModeNames, limited, with_modes


class Collision(NamedTuple):
    """What an impact does.

    Args:
        after: what follows it.
        stays: machines that close in it and stay so.
        thrown: machines that are thrown back.
        lost: energy in J that is lost, by part.
        given: energy in J that prescribed speeds give, by part.
    """

    after: HybridState
    stays: tuple[Contact, ...]
    thrown: tuple[Contact, ...]
    lost: dict[str, float]
    given: dict[str, float]


class Collisions:
    """Solves impacts.

    Args:
        transfer: from one combination of modes to another.
        impulses: follows what passes through gears that rub.
        together: whether what touches is thrown back in the same instant as what is hit, and not after it.
    """

    def __init__(self, transfer: HybridTransfer, impulses: Impulses, *, together: bool) -> None:
        self._transfer, self._machines = transfer, transfer.machines
        self._impulses, self._together = impulses, together
        self._mobilities = BoundedCache[tuple[Regime, tuple[tuple[int, int], ...]], Mobility](KEPT)

    def impact(self, t: float, state: HybridState, number: int, leave: Leave) -> Collision:
        """The impact of a machine that closes.

        Args:
            t: time in s at which inputs are read.
            state: what was before.
            number: of the machine.
            leave: by which it closes.

        Raises:
            NetworkError: nothing stops what is prescribed; says what contradicts what.
            SimulationError: flanks without a gap between them lose nothing.
        """
        modes = state.regime.modes

        def is_wanted(contact: Contact) -> bool:
            return (contact.number, contact.joined) == (number, leave.to)

        # without a gap the other flank of the machine touches too; of two that are closed the last one tells the mode
        candidates = self._opening(t, state, modes, sorted(touching(t, state, number, leave), key=is_wanted))
        meets = -min(opens_at(t, state, candidates), default=0.0) > NOTHING_OF * state.top_speed
        contacts = in_turn(t, state, candidates) if meets and not self._together else candidates
        before = np.array(opens_at(t, state, contacts))
        back = np.array([meets * c.share_back(u) for c, u in zip(contacts, before.tolist(), strict=True)])
        elastic = {c.number for c, share in zip(contacts, back.tolist(), strict=True) if share >= 1}
        self._refuse_no_gap(t, elastic, candidates)
        begins, stages = self._apart(t, state, modes, contacts), tuple[ImpactStage, ...]()
        both_ways = tuple[Contact, ...]()
        if all(contact.number != number for contact in contacts):  # it carries both ways, as a switch that closes
            both_ways = (Contact(number, 0.0, modes[number], leave.to),)
            stages = self.join(t, begins, {number: leave.to})
            begins = self._impulses.begins(stages[-1].outcome.after, t)
        stages += self._compressed(t, begins, contacts)
        if back.any():
            stages += self._thrown_back(t, contacts, stages, back)
        least = NO_IMPACT * max(1.0, fastest := np.abs(before).max(initial=0.0))
        least = least if meets else max(least, fastest)  # what only touches closes, and moves apart by rounding alone
        pressed = zip(contacts, _pressed(stages), strict=True)
        hit = [c for c, impulse in pressed if c.leave and ((meets and impulse > 0) or is_wanted(c))]
        after, closed, further = self._closed_at_end(t, modes, contacts, stages, least, hit)
        owners = (self._machines[contact.number].part.name for contact in contacts)
        taken = [{part: lost} for part, lost in zip(owners, self._taken(t, contacts, stages).tolist(), strict=True)]
        stages += further
        lost = summed([*taken, self._impulses.lost(t, stages)])
        return Collision(
            after,
            (*both_ways, *(c for c in hit if c in closed)),
            tuple(c for c in hit if c not in closed),
            {part: energy for part, energy in lost.items() if energy},
            self._impulses.given(t, stages),
        )

    def _refuse_no_gap(self, t: float, elastic: Collection[int], candidates: Sequence[Contact]) -> None:
        numbers = [contact.number for contact in candidates]
        for number in elastic:
            if numbers.count(number) > 1:
                raise SimulationError(
                    f"The flanks of '{self._machines[number].name}' have no gap between them and hit each other for "
                    f"ever at t = {t:.9g} s, as they lose nothing. Give it a gap, or a restitution below 1."
                )

    def pulled(
        self, before: float, t: float, state: HybridState, modes: ModeNames, least: float
    ) -> tuple[HybridState, tuple[ImpactStage, ...]]:
        """What follows where prescribed speeds jump or gears jam: what is closed takes it up or opens.

        Args:
            before, t: times in s just before and just after it, at which inputs are read.
            state: what was before.
            modes: that are to go on.
            least: speed up to which a machine stays as it is.
        """
        contacts = self._opening(before, state, modes, [*lasting(self._machines, modes)])
        start = self._apart(before, state, modes, contacts)
        stages = self._compressed(t, start, contacts)
        hit = [c for c, i in zip(contacts, _pressed(stages), strict=True) if i > 0]
        after, _, further = self._closed_at_end(t, modes, contacts, stages, least, hit)
        passed = stages if _pressed(stages).any() or not further else ()  # sources jump with what passes
        return after, (*passed, *further)

    def _closed_at_end(
        self,
        t: float,
        before: ModeNames,
        contacts: Sequence[Contact],
        stages: Sequence[ImpactStage],
        least: float,
        hit: Sequence[Contact],
    ) -> tuple[HybridState, list[Contact], tuple[ImpactStage, ...]]:
        """What follows stages, the contacts that are closed then, of those that were open only what was hit, and what
        passes on through contacts beside massless nodes.

        No impulse tells whether these press. Where they would take one, each is joined as its ends still come together.
        """
        after = stages[-1].outcome.after
        mobility, opens = self._mobility(t, after, contacts)
        closed = [c for c, u in zip(contacts, opens, strict=True) if u <= least and (c.leave is None or c in hit)]
        modes = with_modes(after.regime.modes, self._slipping(t, before, after, least))
        massless = {c.number for c, tells in zip(contacts, mobility.has_inertia, strict=True) if not tells}
        open_yet = [c for c in closed if c.number in massless and c.leave is None]
        pressed = [c for c in closed if c not in open_yet]
        new, apart = (
            self._transfer.to_modes(after, t, with_modes(modes, {c.number: c.joined for c in some}))
            for some in (closed, pressed)
        )
        if not open_yet or not new.differs(apart, t, least):
            return new, closed, ()
        further = tuple[ImpactStage, ...]()
        while open_yet:
            speed, contact = min(zip(opens_at(t, apart, open_yet), open_yet, strict=True), key=itemgetter(0))
            if speed >= -least:
                break
            stages = self.join(t, self._impulses.begins(apart, t), {contact.number: contact.joined})
            if apart.differs(stages[-1].outcome.after, t, least):
                further += stages
            apart = stages[-1].outcome.after
            open_yet.remove(contact)
        return apart, [c for c in closed if c not in open_yet], further

    def _compressed(self, t: float, begins: ImpactStart, contacts: Sequence[Contact]) -> tuple[ImpactStage, ...]:
        """Until nothing closes any more, with all contacts open; where nothing stops them, what closes is joined."""

        def compressed(start: ImpactStart, _: Sequence[ImpactStage]) -> ImpulseOutcome:
            modes = start.state.regime.modes
            state = start.state if start.t == t else self._transfer.with_stored(modes, t, start.stored)
            mobility, opens = self._mobility(t, state, contacts)
            impulses = complementary(mobility.W, opens)
            if impulses is not None:
                return _outcome(state, mobility, impulses)
            closing = {c.number: c.joined for c, u in zip(contacts, opens, strict=True) if u < 0}
            closed = self._transfer.to_modes(state, t, with_modes(modes, closing))
            return ImpulseOutcome(closed, closed.regime, np.zeros(len(contacts)))

        return self._impulses.stages(t, begins, compressed)

    def join(self, t: float, begins: ImpactStart, rigid: Mapping[int, str]) -> tuple[ImpactStage, ...]:
        """Machines join their ends at once, in the modes given, by the impulses that it takes."""

        def joined(start: ImpactStart, _: Sequence[ImpactStage]) -> ImpulseOutcome:
            after = self._transfer.to_modes(start.state, t, with_modes(start.state.regime.modes, rigid))
            return ImpulseOutcome(after, after.regime)

        return self._impulses.stages(t, begins, joined)

    def _thrown_back(
        self, t: float, contacts: Sequence[Contact], compression: tuple[ImpactStage, ...], back: Array
    ) -> tuple[ImpactStage, ...]:
        """From the end of the compression on, until contacts have given back their shares (contacts,) of it.

        A gear that rubs answers impulses otherwise than on the way in, so it is the energy of the same way back that
        tells how large they are (Stronge 1990). What they would let close is kept from it by impulses beside them.
        """
        shares, energy = back * _pressed(compression), self._returned(t, contacts, compression, back)

        def thrown(start: ImpactStart, stages: Sequence[ImpactStage]) -> ImpulseOutcome:
            left = energy
            for begun, share in (*((stage.start, stage.share) for stage in stages), (start, 0.0)):
                mobility, opens = self._mobility(t, begun.state, contacts)
                impulses = _of_energy(left, shares, opens, mobility.W)
                gives = share * impulses
                left -= float(gives @ (opens + mobility.W @ gives / 2))
            further = complementary(mobility.W, np.maximum(opens, 0.0) + mobility.W @ impulses)
            return _outcome(start.state, mobility, impulses if further is None else impulses + further)

        return self._impulses.stages(t, self._impulses.begins(compression[-1].outcome.after, t), thrown)

    def _returned(self, t: float, contacts: Sequence[Contact], stages: Sequence[ImpactStage], back: Array) -> float:
        """Energy in J that comes back by shares (contacts,) of all impulses, the last first, if all answers as then."""
        energy, opens = 0.0, np.zeros(len(contacts))
        for start, outcome, share in reversed(stages):
            impulses = back * share * outcome.pressed
            gains = self._mobility(t, start.state, contacts)[0].W @ impulses
            energy += float(impulses @ (opens + gains / 2))
            opens += gains
        return energy

    def _taken(self, t: float, contacts: Sequence[Contact], stages: Sequence[ImpactStage]) -> Array:
        """(contacts,) energy in J that contacts take up: their impulses at the mean of their closing speeds."""
        taken = np.zeros(len(contacts))
        for start, outcome, share in stages:
            began, ends = (opens_at(t, one, contacts) for one in (start.state, outcome.after))
            taken -= share * outcome.pressed * (np.array(began) + share / 2 * np.subtract(ends, began))
        # what opens before others close it comes late, and gives nothing: the sum alone is physics
        least = np.maximum(taken, 0.0)
        return least * (taken.sum() / least.sum()) if least.any() else taken

    def _apart(self, t: float, state: HybridState, modes: ModeNames, contacts: Sequence[Contact]) -> ImpactStart:
        """The state in some modes, but with all contacts open, and what rubs slipping."""
        apart = {k: sides[0][1] for k, sides in self._rubbing(modes).items()} | {c.number: c.apart for c in contacts}
        loose = with_modes(modes, apart)
        return self._impulses.begins(self._transfer.with_stored(loose, t, state.stored(t)), t)

    def _opening(self, t: float, state: HybridState, modes: ModeNames, contacts: list[Contact]) -> list[Contact]:
        """The contacts that an impact may open: not diodes and freewheels that alone let a current or torque go on."""
        names, stored = state.regime.stores.through, state.stored(t)
        carrying = [c for c in contacts if c.leave is None and self._machines[c.number].is_one_way]

        def keeps(opened: Sequence[Contact]) -> bool:
            start = self._apart(t, state, modes, opened)
            changed = sum(abs(start.stored[name] - stored[name]) for name in names)
            return changed <= NO_IMPACT * sum(abs(stored[name]) for name in names)

        if not (names and carrying) or keeps(contacts):
            return contacts
        opened = [c for c in contacts if c not in carrying]
        for contact in carrying:
            if keeps([*opened, contact]):
                opened.append(contact)
        return [c for c in contacts if c in opened]

    def _rubbing(self, modes: ModeNames) -> dict[int, GivesWay]:
        """Machines that hold by torques limited on both sides, with the modes to which these lead."""
        return {k: sides for k, sides in limited(self._machines, modes).items() if len(sides) > 1}

    def _slipping(self, t: float, before: ModeNames, after: HybridState, least: float) -> dict[int, str]:
        """The modes of what rubs after an impact: it slips where the speed across it is more than the least."""
        rubbing = self._rubbing(before)
        speeds = dict(zip(rubbing, after.speeds([*rubbing], t), strict=True))
        return {
            k: next((to for side, to in sides if side * speeds[k] > least), before[k]) for k, sides in rubbing.items()
        }

    def _mobility(self, t: float, state: HybridState, contacts: Sequence[Contact]) -> tuple[Mobility, Array]:
        """The answer to impulses of contacts, and the speeds at which they open; zero where no impulse passes."""
        regime, pairs = state.regime, tuple(nodes(state, contact) for contact in contacts)
        stores, p = regime.stores, regime.p
        mobility = self._mobilities((regime, pairs), lambda: stores.mobility(regime.equations.bound(p), pairs))
        return mobility, np.where(mobility.has_inertia, opens_at(t, state, contacts), 0.0)


def _outcome(state: HybridState, mobility: Mobility, impulses: Array) -> ImpulseOutcome:
    """What impulses (contacts,) lead to."""
    after = state._replace(x=mobility.moved(state.x, impulses))
    return ImpulseOutcome(after, after.regime, impulses, mobility.through(impulses))


def _pressed(stages: Sequence[ImpactStage]) -> Array:
    """(contacts,) the impulses of all stages."""
    return np.asarray(sum(stage.share * stage.outcome.pressed for stage in stages))


def _of_energy(energy: float, shares: Array, opens: Array, W: Array) -> Array:
    """(contacts,) impulses in the ratio of shares (contacts,) by which contacts give back an energy in J."""
    linear, square = float(shares @ opens), float(shares @ W @ shares)
    if not square > 0:  # both sides are held, until a gear gives way
        return shares if energy > 0 else 0 * shares
    if energy <= 0:
        return 0 * shares
    root = math.sqrt(linear**2 + 2 * square * energy)
    return shares * (2 * energy / (linear + root) if linear > 0 else (root - linear) / square)  # no terms cancel
