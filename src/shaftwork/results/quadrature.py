"""Integrals over a motion, to rounding: Lobatto's rule in panels that are parted where that still changes something."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.numerics.polynomials import lobatto_rule, to_slopes
from shaftwork.results.observer import Array

NODES, WEIGHTS = lobatto_rule(7)
"""Of Lobatto's rule, which reads both ends: there peaks are, and a jump close to an end is not overlooked."""
LEAST = 64
"""Panels of a run at least: an exact engine has few steps."""
TIGHT = 1e-13
"""Change of an integral by parting all panels that is none, as a fraction of the integral of the integrand's size."""
MOST = 100_000
"""Panels in all; a motion that asks for more, such as torque of mere noise, is integrated as far as that."""
ROUNDINGS = 16
"""A panel of so many rounding units of time is not parted: it holds a jump that no step ends at."""
SHARE = 0.41
"""Of a panel is the first of its two parts: of a jump in the middle, halves and the whole would say the same."""
NOISE, FALLS, GROWS = 1e-9, 0.75, 1.5
"""Changes below the first fraction are noise where parting leaves this share of them, and so many times the panels."""

_SLOPES = to_slopes(NODES, NODES)


@dataclass(frozen=True, eq=False)
class LobattoPanels:
    """Parts of a span of time, each with the nodes of Lobatto's rule.

    Args:
        start: (p,) ascending, s.
        end: (p,) s.
    """

    start: Array
    end: Array

    @classmethod
    def between(cls, edges: Array) -> LobattoPanels:
        """Panels from each time to the next, s."""
        return cls(edges[:-1], edges[1:])

    @classmethod
    def joined(cls, parts: Sequence[LobattoPanels]) -> tuple[LobattoPanels, NDArray[np.intp]]:
        """The panels of all parts, ascending, and their order."""
        start, end = (np.concatenate([getattr(part, side) for part in parts]) for side in ("start", "end"))
        order = np.argsort(start, kind="stable")
        return cls(start[order], end[order]), order

    @property
    def length(self) -> Array:
        """(p,) s."""
        return self.end - self.start

    @property
    def times(self) -> Array:
        """(p, 8) nodes, ascending, s; the last a rounding before the end, where another panel may begin with a jump."""
        times: Array = self.start[:, None] + self.length[:, None] * (NODES + 1) / 2
        times[:, -1] = np.nextafter(self.end, self.start)
        return times

    def parted(self) -> LobattoPanels:
        """Two panels for each."""
        middle = self.start + SHARE * self.length
        start, end = np.stack([self.start, middle], axis=1), np.stack([middle, self.end], axis=1)
        return LobattoPanels(start.ravel(), end.ravel())

    def split(self, times: Array) -> LobattoPanels:
        """Panels that also end at times (k,) inside the span, which they fill without gaps."""
        start = np.unique(np.append(self.start, times))
        return LobattoPanels(start, np.append(start[1:], self.end[-1]))

    def integrals(self, values: Array) -> Array:
        """(..., p) integrals over each panel of values (..., p, 8) at the nodes."""
        return np.asarray(values @ WEIGHTS * self.length / 2)

    def slopes(self, values: Array) -> Array:
        """(p, 8) derivatives by time of the polynomials through values (p, 8)."""
        return np.asarray(values @ _SLOPES.T * 2 / self.length[:, None])

    def taken(self, which: NDArray[Any]) -> LobattoPanels:
        """Some of them, marked or numbered."""
        return LobattoPanels(self.start[which], self.end[which])


def integrate(integrand: Callable[[LobattoPanels], Array], steps: Array) -> tuple[Array, LobattoPanels]:
    """Integrals of several quantities over a run, and the panels in which all of them are smooth.

    A kink or a jump within a step is closed in by parting; the ends of steps are ends of panels.

    Args:
        integrand: (m, p, 8) the quantities at the nodes of panels.
        steps: (s,) times between which the motion is smooth, s.
    """
    least = max(1, LEAST // len(steps))
    edges = np.append((steps[:-1, None] + np.diff(steps)[:, None] * np.arange(least) / least).ravel(), steps[-1])
    panels = LobattoPanels.between(edges)
    shortest = ROUNDINGS * np.spacing(np.abs(steps).max())
    whole, first, count, before = panels.integrals(integrand(panels)), len(panels.start), 0, (np.inf, 0)
    total, size, settled = np.zeros(len(whole)), np.zeros(len(whole)), list[LobattoPanels]()
    while len(panels.start):
        parts = panels.parted()
        values = integrand(parts)
        fine, sizes = parts.integrals(values), parts.integrals(np.abs(values))
        change = np.abs(fine.reshape(len(fine), -1, 2).sum(axis=2) - whole)
        scale = np.maximum(size + sizes.sum(axis=1), np.finfo(float).tiny)[:, None]
        rough, open_ = float((change / scale).sum(axis=1).max()), len(panels.start)
        count += 2 * open_
        noisy = FALLS * before[0] < rough <= NOISE and open_ > GROWS * before[1]
        done = (change <= TIGHT * scale / first).all(axis=0) | (panels.length <= shortest)
        if rough <= TIGHT or count > MOST or noisy:
            done[:] = True
        done = np.repeat(done, 2)
        total, size = total + fine[:, done].sum(axis=1), size + sizes[:, done].sum(axis=1)
        settled.append(parts.taken(done))
        panels, whole, before = parts.taken(~done), fine[:, ~done], (rough, open_)
    return total, LobattoPanels.joined(settled)[0]
