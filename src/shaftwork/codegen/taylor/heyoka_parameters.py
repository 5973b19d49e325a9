"""The parameters of a Taylor program behind those of the model: parts of these alone, and functions that step.

The parts are worked out once for the values of the parameters, and not again in every step. The functions are constant
between switches: whole numbers, and noise of them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Add, Basic, Expr, Mul, Symbol, floor

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import vectorised_list
from shaftwork.components.noise import HeldNoise


class Fixed:
    """The parts of expressions that hold parameters alone; they are further parameters, behind the others.

    In sums and products what does not move is put together: 2 c x / J is one number times x.

    Args:
        parameters: symbols, in order.
        moving: those that change in a run: states, the time, numbers of modes.
        expressions: in which the parts are.
        before: parts of other expressions, which come first.
    """

    def __init__(
        self,
        parameters: Sequence[Symbol],
        moving: Iterable[Symbol],
        expressions: Iterable[Basic],
        before: Collection[Expr] = (),
    ) -> None:
        self._parameters = tuple(parameters)
        self._moves: dict[Basic, bool] = dict.fromkeys(moving, True)
        self._put_together: dict[Basic, tuple[Basic, ...]] = {}
        self.places: dict[Expr, int] = {part: place for place, part in enumerate(before)}
        """The place of each part among all of them."""
        self._last: tuple[tuple[bytes, tuple[int, ...]], Array] | None = None
        self._find(expressions)

    def arguments(self, node: Basic) -> tuple[Basic, ...]:
        """The arguments of a sum or product, with those that do not move in one."""
        arguments: tuple[Basic, ...] = self._put_together.get(node, node.args)
        return arguments

    def values(self, p: Array) -> Array:
        """(parts,) or (parts, k) from the parameters (p,) or (p, k); the last ones are kept."""
        used = p[self._used]
        key = used.tobytes(), p.shape[1:]  # where nothing is used, the shape alone tells how many
        if self._last is None or self._last[0] != key:
            with np.errstate(all="ignore"):
                parts = [np.broadcast_to(value, p.shape[1:]) for value in self._function(*used)]
            self._last = key, np.array(parts, dtype=float).reshape(len(self.places), *p.shape[1:])
        return self._last[1]

    @cached_property
    def _used(self) -> list[int]:
        """Places of the parameters in the parts."""
        used = set[Basic]().union(*(part.free_symbols for part in self.places))
        return [place for place, symbol in enumerate(self._parameters) if symbol in used]

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return vectorised_list([self._parameters[place] for place in self._used], tuple(self.places))

    def _find(self, expressions: Iterable[Basic]) -> None:
        left = list(expressions)
        seen = set(left)
        while left:
            node = left.pop()
            if not self._moving(node) and isinstance(node, Expr) and node.args and not node.is_number:
                self.places.setdefault(node, len(self.places))
                continue
            if isinstance(node, Add | Mul):
                self._put_together[node] = self._split(node)
            new = [part for part in self.arguments(node) if part not in seen]
            seen.update(new)
            left += new

    def _split(self, node: Add | Mul) -> tuple[Basic, ...]:
        still = [part for part in node.args if not self._moving(part)]
        if len(still) < 2 or all(part.is_number for part in still):
            return node.args  # type: ignore[no-any-return]
        return (node.func(*still), *(part for part in node.args if self._moving(part)))

    def _moving(self, node: Basic) -> bool:
        if node not in self._moves:
            # whole numbers and noise that are held are parameters of their own kind
            self._moves[node] = isinstance(node, floor | HeldNoise) or any(self._moving(part) for part in node.args)
        return self._moves[node]


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
        self.first = first
        self._functions, self._places = tuple(functions), slice(first, first + len(functions))
        self.by_switch = {one.switch: k for k, one in enumerate(self._functions) if one.switch is not None}
        """The number of each function that steps with the motion, by its switch."""
        self._variables = list(variables)

    def start(self, t: float, there: float, x: Array, parameters: Array) -> None:
        """Set all of them for a piece of a run.

        Args:
            t: its start, s.
            there: a time inside it, s, at which those that depend on the time alone are read.
            x: (n,) state at the start.
            parameters: (p,) of the program, up to the held ones at least; changed in place.
        """
        values = parameters[self._places]
        all_timed = all(one.timed for one in self._functions)
        for _ in self._functions:  # one may be an argument of the next
            before = values.copy()
            inside = self._arguments(there, x, parameters)
            at_start = inside if all_timed else self._arguments(t, x, parameters)
            for k, one in enumerate(self._functions):
                values[k] = one.value(*(inside if one.timed else at_start)[k])
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
        values = parameters[self._places]
        positions = self._arguments(t, x, parameters)
        for other, k in self.by_switch.items():
            along = positions[k][0] - values[k]
            if other == switch or not 0 <= along <= 1:  # several may meet a whole number at once
                values[k] += 1.0 if along > 0.5 else -1.0
        for k, one in enumerate(self._functions):
            if not one.timed and one.switch is None:
                values[k] = one.value(*self._arguments(t, x, parameters)[k])

    @cached_property
    def _compiled(self) -> Any:
        import heyoka

        arguments = [argument for one in self._functions for argument in one.arguments]
        return heyoka.cfunc(arguments, vars=self._variables, compact_mode=True, opt_level=0)

    def _arguments(self, t: float, x: Array, parameters: Array) -> list[tuple[float, ...]]:
        """The values of the arguments of each."""
        values = iter(self._compiled(x, pars=parameters[: self._compiled.nparams], time=t).tolist())
        return [tuple(next(values) for _ in one.arguments) for one in self._functions]
