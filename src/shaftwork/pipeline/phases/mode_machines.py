"""What changes its mode in a network, and what it watches for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.components.modes import Leave, Modes
from shaftwork.network.graph import GraphPart

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

# A speed across what is joined, as part of the largest one or of one, up to which it is an error of the run, no impact.
NO_IMPACT = 1e-8

ModeNames = tuple[str, ...]
"""The mode of every element of a network, in their order."""


def is_same(after: Array, before: Array) -> bool:
    """Whether states (n,) after an instant are those before it, but for errors of the run."""
    return bool(np.abs(after - before).max(initial=0.0) <= NO_IMPACT * np.abs(before).max(initial=1.0))


@dataclass(frozen=True, eq=False)
class ModeMachine:
    """A piece of a part that changes its mode.

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

    @cached_property
    def alike(self) -> Mapping[str, str]:
        """By mode the first one with the same law: "open" of one that has parted."""
        first: dict[tuple[str, float], str] = {}
        return {mode.name: first.setdefault((mode.form, mode.value), mode.name) for mode in self.modes.options}


def elements_of(model: Model) -> tuple[ModeMachine, ...]:
    """Every element of a network, in the order of its parts."""
    return tuple(
        ModeMachine(part, modes, f"{part.name}.{modes.symbol}")
        for part in model.form.graph.parts
        for modes in part.modes
    )


@dataclass(frozen=True, eq=False)
class ActiveGuard:
    """What may end a mode in a set of equations: the guard's place, the side on which it is met, and what follows."""

    guard: int
    side: float
    leave: Leave
