"""What changes its mode in a network: elements, their modes, and the guards that end these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.modes import Leave, Modes
from shaftwork.network.graph import CircuitGraph, GraphPart

NO_IMPACT = 1e-8
"""A speed across what is joined, as part of the largest one or of one, up to which it is an error of the run."""

ModeNames = tuple[str, ...]
"""The mode of every element of a network, in their order."""

GivesWay = tuple[tuple[float, str], ...]
"""The sides on which a torque is limited, and the modes that follow there."""


def is_same(after: Array, before: Array) -> bool:
    """Whether states (n,) after an instant are those before it, but for errors of the run."""
    return bool(np.abs(after - before).max(initial=0.0) <= NO_IMPACT * np.abs(before).max(initial=1.0))


@dataclass(frozen=True, eq=False)
class ModeMachine:
    """An element with its modes: a part, or a piece of one, that changes its mode.

    Args:
        part: of which it is.
        modes: its modes.
        number: "part.mode", the parameter in laws.
    """

    part: GraphPart
    modes: Modes
    number: str

    @property
    def name(self) -> str:
        """How messages and tables call it."""
        return f"{self.part.name}.{self.modes.label}" if self.modes.label else self.part.name

    @property
    def first(self) -> str:
        """Its first mode, in which it joins nothing rigidly."""
        return self.modes.options[0].name

    def joins(self, mode: str) -> bool:
        """Whether it joins its ends rigidly in a mode."""
        return self.modes[mode].form != self.modes.options[0].form

    @cached_property
    def joined(self) -> tuple[str, ...]:
        """The modes in which it joins its ends rigidly."""
        return tuple(mode.name for mode in self.modes.options if self.joins(mode.name))

    @cached_property
    def equivalent(self) -> Mapping[str, str]:
        """By mode the first one with the same law: "open" of one that has parted."""
        first: dict[tuple[str, float], str] = {}
        return {mode.name: first.setdefault((mode.form, mode.value), mode.name) for mode in self.modes.options}

    def opening_side(self, mode: str) -> float | None:
        """The side of the speed across at which a mode opens that joins by a torque of one sign; None of others."""
        sides = [side for side, _ in self.modes[mode].gives_way]
        return sides[0] if len(sides) == 1 and self.joins(mode) else None

    @cached_property
    def is_one_way(self) -> bool:
        """Whether it is a diode or a freewheel: it joins by a torque of one sign, as soon as speeds let it."""
        return not self._rebounds and any(self.opening_side(mode) is not None for mode in self.joined)

    @cached_property
    def is_switch(self) -> bool:
        """Whether it joins its ends whatever passes: a time or a law says when it does."""
        limited = any(self.modes[mode].gives_way for mode in self.joined)
        return bool(self.joined) and not self.modes.passes_on and not limited

    @cached_property
    def holds(self) -> bool:
        """Whether it joins its ends in some modes, by a torque that ends these, as friction and contacts do.

        Freewheels and diodes have no branch while they are open, in whose place a reaction could act.
        """
        options = self.modes.options
        limited = all(self.modes[mode].gives_way for mode in self.joined)
        one_law = all(mode.at_rest is None for mode in options)
        reacts = self._rebounds or len(options) > 2
        return bool(self.joined) and limited and one_law and reacts and not self.modes.passes_on

    @property
    def _rebounds(self) -> bool:
        return any(leave.rebound is not None for mode in self.modes.options for leave in mode.leaves)


def elements_of(graph: CircuitGraph) -> tuple[ModeMachine, ...]:
    """Every element of a network, in the order of its parts."""
    return tuple(
        ModeMachine(part, modes, f"{part.name}.{modes.symbol}") for part in graph.parts for modes in part.modes
    )


def limited(elements: Sequence[ModeMachine], modes: ModeNames) -> dict[int, GivesWay]:
    """Elements that join by a torque that is limited, with the sides on which it is and the modes there."""
    pairs = enumerate(zip(elements, modes, strict=True))
    sides = {k: element.modes[name].gives_way for k, (element, name) in pairs}
    return {k: gives_way for k, gives_way in sides.items() if gives_way}


def with_modes(modes: ModeNames, changed: Mapping[int, str]) -> ModeNames:
    """A combination of modes with some of them changed."""
    return tuple(changed.get(k, name) for k, name in enumerate(modes))


@dataclass(frozen=True, eq=False)
class ActiveGuard:
    """What may end a mode in a set of equations.

    Args:
        element: of the mode, by its number.
        guard: its place among those of the equations.
        side: on which it is met.
        leave: what follows.
    """

    element: int
    guard: int
    side: float
    leave: Leave
