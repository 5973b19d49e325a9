"""Contacts: what cannot close further at an instant, closed or only touching, and which of them an impact takes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from shaftwork.components.branches import ACROSS
from shaftwork.components.modes import Leave
from shaftwork.hybrid.consistency import CLEAR, NOTHING
from shaftwork.hybrid.hybrid_state import HybridState
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ModeMachine, ModeNames


class Contact(NamedTuple):
    """What cannot close further, be it closed or only touching.

    Args:
        number: of the machine.
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

    def share_back(self, opens: float) -> float:
        """The share of the speed at which it closes that comes back, for the speed at which it opens."""
        return self.restitution if -opens * self.restitution > self.rest else 0.0


def lasting(machines: Sequence[ModeMachine], modes: ModeNames) -> Iterator[Contact]:
    """Contacts that are closed, and freewheels."""
    for k, (machine, name) in enumerate(zip(machines, modes, strict=True)):
        mode = machine.modes[name]
        if (side := machine.opening_side(name)) is not None:
            yield Contact(k, side, mode.gives_way[0][1], name)
        for leave in mode.leaves:
            side = machine.opening_side(leave.to) if leave.to and leave.when == ACROSS else None
            if side is not None:
                yield Contact(k, side, name, leave.to, leave)


def touching(t: float, state: HybridState, number: int, leave: Leave) -> Iterator[Contact]:
    """Contacts that are closed or touch, freewheels, and the machine of a number, which wants to close by a `leave`."""
    regime, here = state.regime, state.course(t)
    machines, now, bands = regime.machines, here[3], regime.bands(here)
    closed = [*lasting(machines, regime.modes)]
    yield from closed
    yield from _other_flanks(state, closed)
    for active in regime.watched:
        k, closes, guard = active.machine, active.leave, active.guard
        wants = k == number and closes.to == leave.to
        touches = closes.rebound is not None and active.side * now[guard] > -CLEAR * bands[guard]
        side = machines[k].opening_side(closes.to) if (wants or touches) and closes.to else None
        if side is not None and not any(c.number == k and c.joined == closes.to for c in closed):
            yield _closing(state, k, side, leave if wants else closes)


def _other_flanks(state: HybridState, closed: Sequence[Contact]) -> Iterator[Contact]:
    """Flanks that touch while the other one of their machine is closed, as there is no gap between them."""
    regime = state.regime
    for contact in closed:
        machine, place = regime.machines[contact.number], regime.equations.twist(contact.number)
        for leave in machine.modes[contact.apart].leaves if place is not None else ():
            if leave.rebound is None or leave.to == contact.joined:
                continue
            side, (limit, slope) = machine.opening_side(leave.to), regime.twist_limit(contact.number, leave)
            if side is not None and slope * (state.x[place] - limit) > -NOTHING:
                yield _closing(state, contact.number, side, leave, contact.apart)


def _closing(state: HybridState, number: int, side: float, leave: Leave, apart: str = "") -> Contact:
    """What closes by a `leave` from the mode that it is in, or from another one in which it is apart."""
    restitution, rest = (state.regime.constant(number, expression) for expression in (leave.rebound, leave.rest))
    return Contact(number, side, apart or state.regime.modes[number], leave.to, leave, restitution, rest)


def nodes(state: HybridState, contact: Contact) -> tuple[int, int]:
    """The nodes of a contact, that first whose speed opens it."""
    machine = state.regime.machines[contact.number]
    part = state.regime.equations.parts[machine.part.name]
    first, second = map(part.node_at, part.ends_of(machine.modes)[:: int(contact.side)])
    return first, second


def opens_at(t: float, state: HybridState, contacts: Sequence[Contact]) -> list[float]:
    """The speeds at which contacts open."""
    speeds = state.speeds([contact.number for contact in contacts], t)
    return [contact.side * speed for contact, speed in zip(contacts, speeds, strict=True)]


def in_turn(t: float, state: HybridState, contacts: list[Contact]) -> list[Contact]:
    """The contacts that take part where impacts follow each other: of those that throw back only the fastest."""
    speeds = {c: -opens for c, opens in zip(contacts, opens_at(t, state, contacts), strict=True)}
    thrown = [speed for c, speed in speeds.items() if c.share_back(-speed)]
    fastest = (1 - NO_IMPACT) * max(thrown, default=0.0)
    return [c for c, speed in speeds.items() if not (thrown and c.restitution) or speed >= fastest]
