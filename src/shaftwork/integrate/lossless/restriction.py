"""The polynomials of one panel, and of a first part of it: where a guard ends a panel before its end."""

from __future__ import annotations

import numpy as np

from shaftwork.integrate.lossless.collocation import POINTS, POWERS, STAGES, STATE_POWERS
from shaftwork.integrate.problem import Array


class Restriction:
    """States, and behind them what arrives, in one panel: times (k,) in s to (k, n + q).

    Args:
        start: of the panel in s.
        length: of the panel in s.
        x: (n,) state at its start.
        rows: (q + n, s) waves that leave, then states at the Gauss points.
        arrived: (q, s) history torques there.
    """

    def __init__(self, start: float, length: float, x: Array, rows: Array, arrived: Array) -> None:
        self._start, self._length, ends = start, length, len(arrived)
        self._waves, self._arrived = rows[:ends] @ POWERS, arrived @ POWERS
        self._states = np.column_stack([x, rows[ends:]]) @ STATE_POWERS

    def __call__(self, times: Array) -> Array:
        places = 2 * (np.atleast_1d(times) - self._start) / self._length - 1
        powers = np.vander(places, STAGES + 1, increasing=True)
        return np.hstack([powers @ self._states.T, powers[:, :STAGES] @ self._arrived.T])

    def at(self, time: float) -> Array:
        """(n + q,) at one time in s."""
        return np.asarray(self(np.array([time]))[0])

    def arriving(self, place: float) -> Array:
        """(q,) what arrives at a place of [-1, 1]."""
        return np.asarray(self._arrived @ place ** np.arange(STAGES))

    def up_to(self, length: float) -> tuple[Array, Array, Array]:
        """The part of the panel of a length in s: the state (n,) at its end, rows and what arrives as in the panel."""
        share = length / self._length
        powers = np.vander(np.append((1 + POINTS) * share - 1, 2 * share - 1), STAGES + 1, increasing=True).T
        states, waves = self._states @ powers, self._waves @ powers[:STAGES, :-1]
        return states[:, -1], np.concatenate([waves, states[:, :-1]]), self._arrived @ powers[:STAGES, :-1]
