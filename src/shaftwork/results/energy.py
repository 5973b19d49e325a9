"""The energy balance of a run: what was stored, supplied and lost, and what is left over (it should be nothing).

Tellegen: the powers of all branches sum to zero at every instant, so stored(t) - stored(0) = supplied - lost. The
residual measures the error of the integration, independent of any reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.results.observer import Array, Dense, Observer

NODES = 12
"""Gauss points in one panel."""
TIGHT = 1e-13
"""The panels are halved until the work changes by less than this fraction."""
HALVINGS = 7


@dataclass(frozen=True)
class EnergyBalance:
    """Energies at the ends of the integration steps.

    Args:
        t: (s,) times.
        stored: (s,) energy in all stores, J.
        supplied: (s,) work of all sources since the start, J.
        lost: (s,) heat since the start, J.
        work: work that went through the sources, both ways counted as positive, J.
    """

    t: Array
    stored: Array
    supplied: Array
    lost: Array
    work: float

    @property
    def residual(self) -> float:
        """Largest |stored - stored(0) - supplied + lost| over the run, as a fraction of work done and energy stored."""
        gap = np.abs(self.stored - self.stored[0] - self.supplied + self.lost).max()
        size = max(self.work, float(np.abs(self.stored).max()), float(np.abs(self.lost).max()))
        return float(gap / size) if size else 0.0


def energy_balance(observer: Observer, dense: Dense, steps: Array) -> EnergyBalance:
    """Integrate the powers over every step with Gauss' formula, on panels halved until the work no longer changes.

    Args:
        observer: of the model.
        dense: states (k, n) at times (k,).
        steps: (s,) times between which `dense` is smooth.
    """
    before, after = _stored_on_both_sides(observer, dense, steps)
    impulses = np.cumsum(after - before)
    panels = 1
    supplied, lost, work = _integrate(observer, dense, steps, panels)
    for _ in range(HALVINGS):
        panels *= 2
        finer = _integrate(observer, dense, steps, panels)
        change = np.abs(finer[0] - supplied).max() + np.abs(finer[1] - lost).max()
        supplied, lost, work = finer
        if change <= TIGHT * max(work, float(np.abs(lost).max())):
            break
    return EnergyBalance(steps, after, supplied + impulses, lost, work + float(np.abs(after - before).sum()))


def _stored_on_both_sides(observer: Observer, dense: Dense, steps: Array) -> tuple[Array, Array]:
    """Stored energy just before and at every time of `steps`; they differ where an input's jump is an impulse."""
    # a time that is listed twice is read before what jumps there, and then after it
    pairs = np.column_stack([np.nextafter(steps, steps[0]), steps])
    stored = _total(observer.stored(np.repeat(steps, 2), dense(pairs.ravel()), dense), 2 * len(steps))
    return stored[::2], stored[1::2]


def _integrate(observer: Observer, dense: Dense, steps: Array, panels: int) -> tuple[Array, Array, float]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    edges = (steps[:-1, None] + np.diff(steps)[:, None] * np.linspace(0, 1, panels + 1)[:-1]).ravel()
    half = np.repeat(np.diff(steps) / panels / 2, panels)
    times = (edges[:, None] + half[:, None] * (nodes + 1)).ravel()
    lost, supplied = observer.powers(times, dense(times))
    weight = (half[:, None] * weights).ravel()

    def running(power: Array) -> Array:
        by_step = (power * weight).reshape(len(steps) - 1, -1).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(by_step)])

    given = _total(supplied, len(times))
    work = float(sum((np.abs(power) @ weight for power in supplied.values()), start=0.0))
    return running(given), running(_total(lost, len(times))), work


def _total(by_part: dict[str, Array], size: int) -> Array:
    return np.asarray(sum(by_part.values(), start=np.zeros(size)))
