"""What does not move in equations: worked out once for the values of the parameters, and not again in every step."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Basic, Expr, Mul, Symbol, floor

from shaftwork.codegen.code import vectorised_list
from shaftwork.components.noise import HeldNoise

Array = NDArray[np.float64]


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
        self.found: dict[Expr, int] = {part: place for place, part in enumerate(before)}
        """The parts and their places."""
        self._last: tuple[bytes, Array] | None = None
        self._find(expressions)

    def arguments(self, node: Basic) -> tuple[Basic, ...]:
        """The arguments of a sum or product, with those that do not move in one."""
        made: tuple[Basic, ...] = self._put_together.get(node, node.args)
        return made

    def values(self, p: Array) -> Array:
        """(parts,) or (parts, k) from the parameters (p,) or (p, k); the last ones are kept."""
        used = p[self._used]
        key = used.tobytes()
        if self._last is None or self._last[0] != key:
            with np.errstate(all="ignore"):
                made = [np.broadcast_to(value, p.shape[1:]) for value in self._function(*used)]
            self._last = key, np.array(made, dtype=float).reshape(len(self.found), *p.shape[1:])
        return self._last[1]

    @cached_property
    def _used(self) -> list[int]:
        """Places of the parameters in the parts."""
        used = set[Basic]().union(*(part.free_symbols for part in self.found))
        return [place for place, symbol in enumerate(self._parameters) if symbol in used]

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return vectorised_list([self._parameters[place] for place in self._used], tuple(self.found))

    def _find(self, expressions: Iterable[Basic]) -> None:
        left = list(expressions)
        known = set(left)
        while left:
            node = left.pop()
            if not self._moving(node) and isinstance(node, Expr) and node.args and not node.is_number:
                self.found.setdefault(node, len(self.found))
                continue
            if isinstance(node, Add | Mul):
                self._put_together[node] = self._split(node)
            new = [part for part in self.arguments(node) if part not in known]
            known.update(new)
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
