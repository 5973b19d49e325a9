"""What elements show at one instant: the speed across each, its twist, and what its conditions read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from sympy import Expr, Integer, Symbol, Tuple

from shaftwork.codegen.code import bindable, vectorised_list
from shaftwork.codegen.elements import Array
from shaftwork.codegen.valueless import in_words
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import no_value
from shaftwork.core.kept import Kept
from shaftwork.network.graph import GraphPart
from shaftwork.pipeline.phases.starts import conditional, starts_of
from shaftwork.reduction.observables import Observables

if TYPE_CHECKING:
    from shaftwork.pipeline.phases.mode_machines import ModeMachine, ModeNames

KEPT = 256
"""Speeds across elements that are kept with values of the parameters."""


class GuardReadings:
    """What elements show, from what guards read at one instant.

    Args:
        elements: of the network.
        parts: by name.
        readings: of the equations.
        parameters: symbols of the parameter vector.
    """

    def __init__(
        self,
        elements: Sequence[ModeMachine],
        parts: Mapping[str, GraphPart],
        readings: Observables,
        parameters: tuple[Symbol, ...],
    ) -> None:
        self._elements, self._parts, self._readings, self._parameters = elements, parts, readings, parameters
        self._symbols = tuple(conditional(element.modes) for element in elements)
        # of each element the place where what it shows begins
        self._firsts = tuple(accumulate((2 + len(symbols) for symbols in self._symbols), initial=0))
        self._speeds: dict[int, Callable[..., Any]] = {}
        self._bound = Kept[tuple[int, bytes], Callable[..., Any]](KEPT)

    def first_modes(self, t: float, read: Sequence[float], p: Array) -> ModeNames:
        """The mode of each element in which a motion starts, in the equations in which nothing is joined by a mode."""
        shown = self._at(t, read, p)
        elements = enumerate(self._elements)
        return tuple(self._start(k, "", t, shown) or element.modes.options[0].name for k, element in elements)

    def start_of(self, number: int, besides: str, t: float, read: Sequence[float], p: Array) -> str:
        """The mode of an element in which a motion would start, besides one; empty where it would start in none."""
        return self._start(number, besides, t, self._at(t, read, p))

    def across(self, numbers: Sequence[int], t: float, read: Sequence[float], p: Array) -> list[float]:
        """The speeds across elements, which are asked for at every impact: in plain floats, and without the others."""
        return [float(self._speed(number, p)(t, read)[0]) for number in numbers]

    def _speed(self, number: int, p: Array) -> Callable[..., Any]:
        if number not in self._speeds:
            given = {"t": TIME, "read": self._readings.symbols}
            self._speeds[number] = bindable(given, {"p": self._parameters}, (), (self._expression(number, ACROSS),))
        return self._bound((number, p.tobytes()), lambda: self._speeds[number](p.tolist())[1])

    def _at(self, t: float, read: Sequence[float], p: Array) -> Sequence[Any]:
        return self.function(t, *read, *p.tolist())  # type: ignore[no-any-return]

    def _start(self, number: int, besides: str, t: float, shown: Sequence[Any]) -> str:
        modes = self._elements[number].modes
        first, symbols = self._firsts[number], self._symbols[number]
        holds = starts_of(modes, symbols)(t, *shown[first : first + 2 + len(symbols)])
        if holds is None:
            raise no_value(t, in_words(self._elements[number].part, Tuple(*(mode.starts for mode in modes.options))))
        return next((m.name for m, found in zip(modes.options, holds, strict=True) if found and m.name != besides), "")

    @cached_property
    def function(self) -> Callable[..., Any]:
        """Of each element the speed across it, its twist and the parameters in its conditions, one after another."""
        shown = list[Expr]()
        for number, element in enumerate(self._elements):
            reads = any(mode.starts.has(INTEGRAL) for mode in element.modes.options)
            twist = self._expression(number, INTEGRAL) if reads else Integer(0)
            others = (self._expression(number, symbol) for symbol in self._symbols[number])
            shown += [self._expression(number, ACROSS), twist, *others]
        return vectorised_list((TIME, *self._readings.symbols, *self._parameters), shown)

    def _expression(self, number: int, wanted: Expr) -> Expr:
        element = self._elements[number]
        return self._readings.guard(self._parts[element.part.name], element.modes, wanted)
