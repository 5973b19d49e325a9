"""What takes part in impacts: contacts, freewheels and diodes, which press and do not pull."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from shaftwork.components.branches import ACROSS
from shaftwork.components.modes import Leave, Modes
from shaftwork.pipeline.phases.hybrid_state import HybridState
from shaftwork.pipeline.phases.mode_machines import ModeMachine, ModeNames


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


def lasting(elements: Sequence[ModeMachine], modes: ModeNames) -> Iterator[Contact]:
    """Contacts that are closed, and freewheels."""
    for k, (element, name) in enumerate(zip(elements, modes, strict=True)):
        own = element.modes
        if (side := one_side(own, name)) is not None:
            yield Contact(k, side, own[name].gives_way[0][1], name)
        for leave in own[name].leaves:
            side = one_side(own, leave.to) if leave.to and leave.when == ACROSS else None
            if side is not None:
                yield Contact(k, side, name, leave.to, leave)


def one_side(modes: Modes, name: str) -> float | None:
    """The side of the speed across at which a mode opens that joins by a torque of one sign; None of other modes."""
    mode = modes[name]
    sides = [side for side, _ in mode.gives_way]
    return sides[0] if len(sides) == 1 and mode.form != modes.options[0].form else None


def limited(elements: Sequence[ModeMachine], modes: ModeNames) -> dict[int, tuple[tuple[float, str], ...]]:
    """Elements that join by a torque that is limited, with the sides on which it is and the modes there."""
    found = {k: element.modes[name].gives_way for k, (element, name) in enumerate(zip(elements, modes, strict=True))}
    return {k: ways for k, ways in found.items() if ways}


def opens_at(t: float, moment: HybridState, contacts: Sequence[Contact]) -> list[float]:
    """The speeds at which contacts open."""
    speeds = moment.speeds([contact.number for contact in contacts], t)
    return [contact.side * speed for contact, speed in zip(contacts, speeds, strict=True)]
