"""Functions that are constant between switches as parameters of a Taylor program: whole numbers, and noise of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Held:
    """A function whose value is a parameter of the program.

    Args:
        arguments: heyoka expressions.
        value: the function, from numbers to a number.
        timed: its arguments depend on no state: it is known for each piece.
        switch: number of the switch (x - n) (n + 1 - x) where it is the whole number n that x, which depends on the
            motion, has reached; else None.
    """

    arguments: tuple[Any, ...]
    value: Callable[..., float]
    timed: bool
    switch: int | None


class HeldParameters:
    """The held functions of a program, each after those in its arguments.

    Args:
        functions: of the program.
        variables: heyoka's state variables.
        first: place of the first of them among the parameters.
    """

    def __init__(self, functions: Sequence[Held], variables: Sequence[Any], first: int) -> None:
        self.functions, self.first = tuple(functions), first
        self.by_switch = {held.switch: k for k, held in enumerate(self.functions) if held.switch is not None}
        self._variables = list(variables)

    def start(self, t: float, there: float, x: Array, parameters: Array) -> None:
        """Set all of them for a piece of a run.

        Args:
            t: its start, s.
            there: a time inside it, s, at which those that depend on the time alone are read.
            x: (n,) state at the start.
            parameters: (p,) of the program, up to the held ones at least; changed in place.
        """
        values = parameters[self.first : self.first + len(self.functions)]
        all_timed = all(held.timed for held in self.functions)
        for _ in self.functions:  # one may be an argument of the next
            before = values.copy()
            inside = self._arguments(there, x, parameters)
            at_start = inside if all_timed else self._arguments(t, x, parameters)
            for k, held in enumerate(self.functions):
                values[k] = held.value(*(inside if held.timed else at_start)[k])
            if np.array_equal(before, values, equal_nan=True):
                return

    def step(self, switch: int, t: float, x: Array, parameters: Array) -> None:
        """Go on to the next whole number, or back to the last, where the motion has reached the end of one.

        Args:
            switch: number of the switch that says so.
            t: s.
            x: (n,) state.
            parameters: (p,) of the program; changed in place.
        """
        values = parameters[self.first : self.first + len(self.functions)]
        positions = self._arguments(t, x, parameters)
        for other, k in self.by_switch.items():
            along = positions[k][0] - values[k]
            if other == switch or not 0 <= along <= 1:  # several may meet a whole number at once
                values[k] += 1.0 if along > 0.5 else -1.0
        for k, held in enumerate(self.functions):
            if not held.timed and held.switch is None:
                values[k] = held.value(*self._arguments(t, x, parameters)[k])

    @cached_property
    def _compiled(self) -> Any:
        import heyoka

        arguments = [argument for held in self.functions for argument in held.arguments]
        return heyoka.cfunc(arguments, vars=self._variables, compact_mode=True, opt_level=0)

    def _arguments(self, t: float, x: Array, parameters: Array) -> list[tuple[float, ...]]:
        """The values of the arguments of each."""
        found = iter(self._compiled(x, pars=parameters[: self._compiled.nparams], time=t).tolist())
        return [tuple(next(found) for _ in held.arguments) for held in self.functions]
