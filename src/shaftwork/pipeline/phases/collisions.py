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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.mobility import ROUNDING, Mobility, complementary, restituted
from shaftwork.components.branches import ACROSS
from shaftwork.components.modes import Leave, Modes
from shaftwork.core.kept import Kept
from shaftwork.network.graph import GROUND
from shaftwork.pipeline.phases.elements import Element, ModeNames
from shaftwork.pipeline.phases.impulses import Blow, Impulses, Stage, Start
from shaftwork.pipeline.phases.moments import CLEAR, Moment, Regime
from shaftwork.pipeline.phases.regimes import Regimes, with_modes

# A speed across what is joined, as part of the largest one or of one, up to which it is an error of the run, no impact.
NO_IMPACT = 1e-8
KEPT = 64
"""Sets of contacts of which what impulses do is kept."""
SAME = 1e-9
"""Speeds at which contacts close that differ by less than this fraction are the same."""
MOST_FACTORS = 50
"""So many steps find how far contacts give back an energy."""


class Contact(NamedTuple):
    """What cannot close further, be it closed or only touching.

    Args:
        number: of the element.
        side: 1 where it opens as the speed across it rises, -1 where as that falls.
        apart: mode in which it is open.
        joined: mode in which it is closed.
        leave: by which it closes; None where it is closed already.
        restitution: of what it hits with, and
        rest: speed up to which nothing is thrown back.
    """

    number: int
    side: float
    apart: str
    joined: str
    leave: Leave | None = None
    restitution: float = 0.0
    rest: float = 0.0


class Collision(NamedTuple):
    """What an impact does.

    Args:
        after: what follows it.
        stays: elements that close in it and stay so.
        thrown: elements that are thrown back.
        lost: energy in J that is lost, by part.
        given: energy in J that prescribed speeds give, by part.
    """

    after: Moment
    stays: tuple[Contact, ...]
    thrown: tuple[Contact, ...]
    lost: dict[str, float]
    given: dict[str, float]


class Collisions:
    """Solves impacts.

    Args:
        regimes: combinations of modes.
        elements: of the network.
        impulses: follows what passes through gears that rub.
        together: whether what touches is thrown back in the same instant as what is hit, and not after it.
    """

    def __init__(self, regimes: Regimes, elements: Sequence[Element], impulses: Impulses, *, together: bool) -> None:
        self._regimes, self._elements, self._impulses, self._together = regimes, elements, impulses, together
        self._mobilities = Kept[tuple[Regime, tuple[tuple[int, int], ...]], Mobility](KEPT)

    def impact(self, t: float, moment: Moment, number: int, leave: Leave) -> Collision:
        """The impact of an element that closes.

        Args:
            t: time in s at which inputs are read.
            moment: what was before.
            number: of the element.
            leave: by which it closes.

        Raises:
            NetworkError: nothing stops what is prescribed; says what contradicts what.
        """
        contacts = self._in_turn(t, moment, [*self._contacts(t, moment, number, leave)])
        before = np.array([self._opens(t, moment, contact) for contact in contacts])
        back = np.array([self._restitution(c, u) for c, u in zip(contacts, before.tolist(), strict=True)])
        stages = self._compressed(t, moment, contacts, {number: leave.to})
        if back.any():
            stages += self._thrown_back(t, contacts, stages, back)
        after = stages[-1].blow.after
        impulses, (_, opens) = _pressed(stages), self._mobility(t, after, contacts)
        least = NO_IMPACT * max(1.0, np.abs(before).max(initial=0.0))
        hit = [c for c, i in zip(contacts, impulses, strict=True) if c.leave and (i > 0 or c.number == number)]
        closed = [c for c, u in zip(contacts, opens, strict=True) if u <= least and (c.leave is None or c in hit)]
        modes = {c.number: c.joined for c in closed} | self._slipping(t, moment, after, least)
        owners = (self._elements[contact.number].part.name for contact in contacts)
        lost = zip(owners, self._taken(t, contacts, stages).tolist(), strict=True)
        return Collision(
            self._regimes.changed(after, t, with_modes(after.regime.modes, modes)),
            tuple(c for c in hit if c in closed),
            tuple(c for c in hit if c not in closed),
            _sums([*lost, *self._impulses.lost(t, stages).items()]),
            self._impulses.given(t, stages),
        )

    def _compressed(
        self, t: float, moment: Moment, contacts: Sequence[Contact], wanted: Mapping[int, str]
    ) -> tuple[Stage, ...]:
        """Until nothing closes any more, with all contacts open; where nothing stops them, joined is what wants to."""

        def compressed(start: Start, _: Sequence[Stage]) -> Blow:
            mobility, opens = self._mobility(t, start.moment, contacts)
            impulses = complementary(mobility.W, opens)
            if impulses is not None:
                return _blow(start, mobility, impulses)
            joined = self._regimes.changed(start.moment, t, with_modes(start.moment.regime.modes, wanted))
            return Blow(joined, joined.regime, np.zeros(len(contacts)))

        loose = self._apart(t, moment, contacts, wanted)
        return self._impulses.stages(t, self._impulses.begins(loose, t), compressed)

    def _thrown_back(
        self, t: float, contacts: Sequence[Contact], compression: tuple[Stage, ...], back: Array
    ) -> tuple[Stage, ...]:
        """From the end of the compression on, until contacts have given back their shares (contacts,) of it.

        Beside gears that rub it is the energy of which e^2 comes back (Stronge 1990), by impulses in the same ratio.
        """
        shares, energy = back * _pressed(compression), float(back**2 @ self._taken(t, contacts, compression))

        def thrown(start: Start, made: Sequence[Stage]) -> Blow:
            mobility, opens = self._mobility(t, start.moment, contacts)
            impulses = restituted(mobility.W, opens, shares)
            if self._impulses.gears:
                left = energy + float((back > 0) @ self._taken(t, contacts, made))
                impulses = _of_energy(mobility.W, opens, shares, max(left, 0.0))
            return _blow(start, mobility, impulses)

        return self._impulses.stages(t, self._impulses.begins(compression[-1].blow.after, t), thrown)

    def _taken(self, t: float, contacts: Sequence[Contact], stages: Sequence[Stage]) -> Array:
        """(contacts,) energy in J that contacts take up: their impulses at the mean of their closing speeds."""
        taken = np.zeros(len(contacts))
        for start, blow, share in stages:
            began, ends = ([self._opens(t, one, c) for c in contacts] for one in (start.moment, blow.after))
            taken -= share * blow.pressed * (np.array(began) + share / 2 * np.subtract(ends, began))
        return taken

    def _apart(self, t: float, moment: Moment, contacts: Sequence[Contact], wanted: Mapping[int, str]) -> Moment:
        """The moment with all contacts open, and what rubs slipping; joined is what wants to be and never opens."""
        modes = {k: ways[0][1] for k, ways in self._rubbing(moment).items()} | {c.number: c.apart for c in contacts}
        modes = {**wanted, **modes}
        return self._regimes.taking(with_modes(moment.regime.modes, modes), t, self._regimes.held(moment, t))

    def _rubbing(self, moment: Moment) -> dict[int, tuple[tuple[float, str], ...]]:
        """Elements that hold by torques limited on both sides, with the modes to which these lead."""
        return {k: ways for k, ways in limited(self._elements, moment.regime.modes).items() if len(ways) > 1}

    def _slipping(self, t: float, moment: Moment, after: Moment, least: float) -> dict[int, str]:
        """The modes of what rubs after an impact: it slips where the speed across it is more than the least."""
        speeds = {k: after.across(k, t) for k in self._rubbing(moment)}
        return {
            k: next((to for side, to in ways if side * speeds[k] > least), moment.regime.modes[k])
            for k, ways in self._rubbing(moment).items()
        }

    def _mobility(self, t: float, moment: Moment, contacts: Sequence[Contact]) -> tuple[Mobility, Array]:
        """The answer to impulses of contacts, and the speeds at which they open; zero where no impulse passes."""
        regime, pairs = moment.regime, tuple(self._nodes(moment, contact) for contact in contacts)
        stores, p = regime.assembly.stores, regime.p
        mobility = self._mobilities((regime, pairs), lambda: stores.mobility(regime.assembly.bound(p), pairs))
        opens = [self._opens(t, moment, contact) for contact in contacts]
        return mobility, np.where(mobility.has_inertia, opens, 0.0)

    def _in_turn(self, t: float, moment: Moment, contacts: list[Contact]) -> list[Contact]:
        """The contacts that take part: of those that throw back only the fastest, but if all do so together."""
        speeds = {c: -self._opens(t, moment, c) for c in contacts}
        thrown = [speed for c, speed in speeds.items() if self._restitution(c, -speed)]
        if self._together or not thrown:
            return contacts
        fastest = (1 - SAME) * max(thrown)
        return [c for c, speed in speeds.items() if not c.restitution or speed >= fastest]

    def fastest(self, t: float, moment: Moment, number: int, leave: Leave) -> Contact | None:
        """Of what closes and is thrown back what closes fastest, first the element that is given; None where none is.

        Args:
            t, moment, number, leave: as in `impact`.
        """
        contacts = self._in_turn(t, moment, [*self._contacts(t, moment, number, leave)])
        thrown = (c for c in contacts if self._restitution(c, self._opens(t, moment, c)))
        return min(thrown, key=lambda contact: contact.number != number, default=None)

    def _opens(self, t: float, moment: Moment, contact: Contact) -> float:
        """The speed at which a contact opens."""
        return contact.side * moment.across(contact.number, t)

    def _nodes(self, moment: Moment, contact: Contact) -> tuple[int, int]:
        """The nodes of a contact, that first whose speed opens it."""
        element = self._elements[contact.number]
        part = moment.regime.assembly.parts[element.part.name]
        ends = part.ends_of(element.modes)[:: int(contact.side)]
        first, second = (GROUND if end is None else part.nodes[end] for end in ends)
        return first, second

    def _restitution(self, contact: Contact, opens: float) -> float:
        """The share of the speed at which a contact closes that comes back."""
        return contact.restitution if -opens * contact.restitution > contact.rest else 0.0

    def _contacts(self, t: float, moment: Moment, number: int, leave: Leave) -> Iterator[Contact]:
        """Contacts that are closed or touch, freewheels, and the element that wants to close."""
        regime, here = moment.regime, moment.course(t)
        now, bands = here[3], regime.bands(here)
        for k, (element, name) in enumerate(zip(self._elements, regime.modes, strict=True)):
            modes = element.modes
            if (side := one_side(modes, name)) is not None:
                yield Contact(k, side, modes[name].gives_way[0][1], name)
        overrun = freewheels(self._elements, regime.modes)
        for k, watched in regime.watched:
            closes, guard = watched.leave, watched.guard
            wanted = k == number and closes.to == leave.to
            touches = watched.side * now[guard] > -CLEAR * bands[guard]
            takes_part = wanted or (k in overrun if closes.rebound is None else touches)
            side = one_side(self._elements[k].modes, closes.to) if takes_part and closes.to else None
            if side is not None:
                closes = leave if wanted else closes
                constants = (regime.constant(k, given) for given in (closes.rebound, closes.rest))
                yield Contact(k, side, regime.modes[k], closes.to, closes, *constants)


def one_side(modes: Modes, name: str) -> float | None:
    """The side of the speed across at which a mode opens that joins by a torque of one sign; None of other modes."""
    mode = modes[name]
    sides = [side for side, _ in mode.gives_way]
    return sides[0] if len(sides) == 1 and mode.form != modes.options[0].form else None


def limited(elements: Sequence[Element], modes: ModeNames) -> dict[int, tuple[tuple[float, str], ...]]:
    """Elements that join by a torque that is limited, with the sides on which it is and the modes there."""
    found = {k: element.modes[name].gives_way for k, (element, name) in enumerate(zip(elements, modes, strict=True))}
    return {k: ways for k, ways in found.items() if ways}


def freewheels(elements: Sequence[Element], modes: ModeNames) -> dict[int, str]:
    """Elements that let their ends turn one way alone, while they do, and the modes in which they hold them."""
    pairs = enumerate(zip(elements, modes, strict=True))
    leaves = ((k, leave, element.modes) for k, (element, name) in pairs for leave in element.modes[name].leaves)
    return {
        k: leave.to
        for k, leave, own in leaves
        if leave.to and leave.when == ACROSS and one_side(own, leave.to) is not None
    }


def _blow(start: Start, mobility: Mobility, impulses: Array) -> Blow:
    """What impulses (contacts,) lead to."""
    after = start.moment._replace(x=mobility.moved(start.moment.x, impulses))
    return Blow(after, after.regime, impulses, mobility.through(impulses))


def _pressed(stages: Sequence[Stage]) -> Array:
    """(contacts,) the impulses of all stages."""
    return np.asarray(np.sum([stage.share * stage.blow.pressed for stage in stages], axis=0))


def _of_energy(W: Array, opens: Array, shares: Array, energy: float) -> Array:
    """(contacts,) impulses of restitution in the ratio of shares (contacts,), by which these give back an energy in J.

    The energy is a parabola of the factor of the shares, as long as the same contacts are pressed.
    """
    factor, linear = 1.0, float(shares @ opens)
    for _ in range(MOST_FACTORS):
        impulses = restituted(W, opens, factor * shares)
        gives = float((impulses * (opens + W @ impulses / 2))[shares > 0].sum())
        square = (gives - factor * linear) / factor**2
        if not square > 0 or not energy > 0:  # both sides are held, or all has come back
            break
        before, factor = factor, 2 * energy / (linear + math.sqrt(linear**2 + 4 * square * energy))
        if abs(factor - before) <= ROUNDING * factor:
            break
    return impulses if energy > 0 else np.zeros(len(opens))


def _sums(pairs: Iterable[tuple[str, float]]) -> dict[str, float]:
    """The sums of values by name, without zeros."""
    sums: dict[str, float] = {}
    for name, value in pairs:
        sums[name] = sums.get(name, 0.0) + value
    return {name: value for name, value in sums.items() if value}
