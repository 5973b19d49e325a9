"""The states inside the steps of methods that know them as polynomials of the part of the step that is over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shaftwork.integrate.problem import Array


@dataclass(frozen=True)
class StepPolynomial:
    """The states inside one step.

    Law: y + x (T_0 + z (T_1 + x (T_2 + ...))), with x the part of the step that is over and z = 1 - x where the
    polynomial alternates, else x.

    Args:
        start: of the step, s.
        length: of the step, s.
        state: (n,) y, at its start.
        terms: (m, n) T.
        alternates: whether every other factor is 1 - x.
    """

    start: float
    length: float
    state: Array
    terms: Array
    alternates: bool

    def __call__(self, times: Array) -> Array:
        """States (k, n) at times (k,)."""
        weights = _weights((times - self.start) / self.length, len(self.terms), alternates=self.alternates)
        return np.asarray(weights.T @ self.terms + self.state)


class StepPolynomials:
    """The states inside all steps of a run, each from the last step that has started.

    Args:
        steps: the steps, in order.
    """

    def __init__(self, steps: Sequence[StepPolynomial]) -> None:
        self._steps, self._starts = tuple(steps), np.array([step.start for step in steps])

    def __call__(self, times: Array) -> Array:
        """States (k, n) at times (k,)."""
        lengths, states, terms = self._joined
        rows = np.maximum(np.searchsorted(self._starts, times, side="right") - 1, 0)
        shares = (times - self._starts[rows]) / lengths[rows]
        weights = _weights(shares, terms.shape[1], alternates=self._steps[0].alternates)
        return np.asarray(np.einsum("mk,kmn->kn", weights, terms[rows]) + states[rows])

    @cached_property
    def _joined(self) -> tuple[Array, Array, Array]:
        lengths = np.array([step.length for step in self._steps])
        states, terms = np.array([step.state for step in self._steps]), np.array([step.terms for step in self._steps])
        return lengths, states, terms


def _weights(shares: Array, count: int, *, alternates: bool) -> Array:
    """(count, k) what is multiplied with each term at parts (k,) of a step."""
    factors = np.empty((count, shares.size))
    factors[:] = shares
    if alternates:
        factors[1::2] = 1 - shares
    return np.asarray(np.multiply.accumulate(factors, axis=0))
