"""Which contacts take part in an impact: contacts, freewheels and diodes, which press and do not pull."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sympy import Integer

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.modes import Leave
from shaftwork.hybrid.hybrid_state import CLEAR, NOTHING, HybridState
from shaftwork.hybrid.modes.mode_machines import ModeMachine, ModeNames

SAME = 1e-9
"""Speeds at which contacts close that differ by less than this fraction are the same."""


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

    def share_back(self, opens: float) -> float:
        """The share of the speed at which it closes that comes back, for the speed at which it opens."""
        return self.restitution if -opens * self.restitution > self.rest else 0.0


def lasting(elements: Sequence[ModeMachine], modes: ModeNames) -> Iterator[Contact]:
    """Contacts that are closed, and freewheels."""
    for k, (element, name) in enumerate(zip(elements, modes, strict=True)):
        mode = element.modes[name]
        if (side := element.opening_side(name)) is not None:
            yield Contact(k, side, mode.gives_way[0][1], name)
        for leave in mode.leaves:
            side = element.opening_side(leave.to) if leave.to and leave.when == ACROSS else None
            if side is not None:
                yield Contact(k, side, name, leave.to, leave)


def touching(t: float, moment: HybridState, number: int, leave: Leave) -> Iterator[Contact]:
    """Contacts that are closed or touch, freewheels, and the element of a number, which wants to close by a `leave`."""
    regime, here = moment.regime, moment.course(t)
    elements, now, bands = regime.elements, here[3], regime.bands(here)
    closed = [*lasting(elements, regime.modes)]
    yield from closed
    yield from _other_flanks(moment, closed)
    for active in regime.watched:
        k, closes, guard = active.element, active.leave, active.guard
        wants = k == number and closes.to == leave.to
        touches = closes.rebound is not None and active.side * now[guard] > -CLEAR * bands[guard]
        side = elements[k].opening_side(closes.to) if (wants or touches) and closes.to else None
        if side is not None and not any(c.number == k and c.joined == closes.to for c in closed):
            yield _closing(moment, k, side, leave if wants else closes)


def _other_flanks(moment: HybridState, closed: Sequence[Contact]) -> Iterator[Contact]:
    """Flanks that touch while the other one of their element is closed, as there is no gap between them."""
    regime = moment.regime
    for contact in closed:
        element, place = regime.elements[contact.number], regime.assembly.twist(contact.number)
        for leave in element.modes[contact.apart].leaves if place is not None else ():
            if leave.rebound is None or leave.to == contact.joined:
                continue
            side = element.opening_side(leave.to)
            limit = regime.constant(contact.number, leave.when.xreplace({INTEGRAL: Integer(0)}))
            if side is not None and limit + float(leave.when.diff(INTEGRAL)) * moment.x[place] > -NOTHING:
                yield _closing(moment, contact.number, side, leave, contact.apart)


def _closing(moment: HybridState, number: int, side: float, leave: Leave, apart: str = "") -> Contact:
    """What closes by a `leave` from the mode that it is in, or from another one in which it is apart."""
    restitution, rest = (moment.regime.constant(number, expression) for expression in (leave.rebound, leave.rest))
    return Contact(number, side, apart or moment.regime.modes[number], leave.to, leave, restitution, rest)


def nodes(moment: HybridState, contact: Contact) -> tuple[int, int]:
    """The nodes of a contact, that first whose speed opens it."""
    element = moment.regime.elements[contact.number]
    part = moment.regime.assembly.parts[element.part.name]
    first, second = map(part.node_at, part.ends_of(element.modes)[:: int(contact.side)])
    return first, second


def opens_at(t: float, moment: HybridState, contacts: Sequence[Contact]) -> list[float]:
    """The speeds at which contacts open."""
    speeds = moment.speeds([contact.number for contact in contacts], t)
    return [contact.side * speed for contact, speed in zip(contacts, speeds, strict=True)]


def in_turn(t: float, moment: HybridState, contacts: list[Contact]) -> list[Contact]:
    """The contacts that take part where impacts follow each other: of those that throw back only the fastest."""
    speeds = {c: -opens for c, opens in zip(contacts, opens_at(t, moment, contacts), strict=True)}
    thrown = [speed for c, speed in speeds.items() if c.share_back(-speed)]
    fastest = (1 - SAME) * max(thrown, default=0.0)
    return [c for c, speed in speeds.items() if not (thrown and c.restitution) or speed >= fastest]
