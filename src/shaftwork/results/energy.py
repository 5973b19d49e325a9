"""The energy balance of a run: what was stored, supplied and lost, and what is left over (it should be nothing).

Tellegen: the powers of all branches sum to zero at every instant, so stored(t) - stored(0) = supplied - lost. The
residual measures the error of the integration, independent of any reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

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
        supplied: (s,) work of all sources and weights since the start, J; a weight's is negative while it is lifted.
        lost: (s,) heat since the start, J.
        work: work that went through the sources and weights, both ways counted as positive, J.
        lost_in: heat of the whole run by part, J. That of an impact is the part's that is hit, less what gears lose in
            it. The balance begins after what happens at the very start.
        supplied_by: work of the whole run by source and weight, J.
    """

    t: Array
    stored: Array
    supplied: Array
    lost: Array
    work: float
    lost_in: Mapping[str, float] = field(default_factory=dict)
    supplied_by: Mapping[str, float] = field(default_factory=dict)

    @property
    def residual(self) -> float:
        """Largest |stored - stored(0) - supplied + lost| over the run, as a fraction of work done and energy stored."""
        size = max(self.work, float(np.abs(self.stored).max()), float(np.abs(self.lost).max()))
        return float(np.abs(self._gap).max() / size) if size else 0.0

    @property
    def _gap(self) -> Array:
        gap: Array = self.stored - self.stored[0] - self.supplied + self.lost
        return gap

    @property
    def worst_step(self) -> tuple[float, float]:
        """Start and end, s, of the step to which most of the residual belongs."""
        place = int(np.argmax(np.abs(np.diff(self._gap))))
        return float(self.t[place]), float(self.t[place + 1])


def energy_balance(observer: Observer, dense: Dense, steps: Array) -> EnergyBalance:
    """Integrate the powers over every step with Gauss' formula, on panels halved until the work no longer changes.

    Args:
        observer: of the model.
        dense: states (k, n) at times (k,).
        steps: (s,) times between which `dense` is smooth.
    """
    before, after = _stored_on_both_sides(observer, dense, steps)
    impulses, hits, given = _impulses(observer.impacts(dense), steps, after - before)
    panels = 1
    found = _integrate(observer, dense, steps, panels)
    for _ in range(HALVINGS):
        panels *= 2
        finer = _integrate(observer, dense, steps, panels)
        change = np.abs(finer.supplied - found.supplied).max() + np.abs(finer.lost - found.lost).max()
        found = finer
        if change <= TIGHT * max(found.work, float(np.abs(found.lost).max())):
            break
    lost_in = dict(found.lost_in)
    for part, energy in hits:
        lost_in[part] = lost_in.get(part, 0.0) + float(energy.sum())
    return EnergyBalance(
        t=steps,
        stored=after,
        supplied=found.supplied + np.cumsum(impulses),
        lost=found.lost + np.cumsum(sum((energy for _, energy in hits), start=np.zeros(len(steps)))),
        work=found.work + float(np.abs(impulses).sum()),
        lost_in=lost_in,
        supplied_by={
            part: found.supplied_by.get(part, 0.0) + given.get(part, 0.0) for part in {**found.supplied_by, **given}
        },
    )


def _impulses(
    impacts: Iterable[tuple[float, str, Mapping[str, float], Mapping[str, float]]], steps: Array, jumps: Array
) -> tuple[Array, list[tuple[str, Array]], dict[str, float]]:
    """(s,) energy that sources give at once; of impacts by part the (s,) that is lost, and what sources give."""
    impulses = jumps.copy()
    lost: dict[str, Array] = {}
    given: dict[str, float] = {}
    for time, part, sources, others in impacts:
        if time <= steps[0]:  # the balance begins after it
            continue
        places = np.flatnonzero(steps == time)[-1:]
        if part:
            own = sum(sources.values()) - impulses[places] - sum(others.values())
            lost.setdefault(part, np.zeros(len(steps)))[places] += own
        for other, energy in others.items():
            lost.setdefault(other, np.zeros(len(steps)))[places] += energy
        impulses[places] = sum(sources.values())
        for source, supplied in sources.items():
            given[source] = given.get(source, 0.0) + supplied
    return impulses, list(lost.items()), given


def _stored_on_both_sides(observer: Observer, dense: Dense, steps: Array) -> tuple[Array, Array]:
    """Stored energy just before and at every time of `steps`; they differ where an input's jump is an impulse."""
    # a time that is listed twice is read before what jumps there, and then after it
    pairs = np.column_stack([np.nextafter(steps, steps[0]), steps])
    stored = _total(observer.stored(np.repeat(steps, 2), dense(pairs.ravel()), dense), 2 * len(steps))
    return stored[::2], stored[1::2]


@dataclass(frozen=True)
class _Work:
    """What went through the parts: running sums (s,), and totals by part."""

    supplied: Array
    lost: Array
    work: float
    lost_in: Mapping[str, float]
    supplied_by: Mapping[str, float]


def _integrate(observer: Observer, dense: Dense, steps: Array, panels: int) -> _Work:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    edges = (steps[:-1, None] + np.diff(steps)[:, None] * np.linspace(0, 1, panels + 1)[:-1]).ravel()
    half = np.repeat(np.diff(steps) / panels / 2, panels)
    times = (edges[:, None] + half[:, None] * (nodes + 1)).ravel()
    lost, supplied = observer.powers(times, dense(times))
    weight = (half[:, None] * weights).ravel()

    def running(power: Array) -> Array:
        by_step = (power * weight).reshape(len(steps) - 1, -1).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(by_step)])

    return _Work(
        supplied=running(_total(supplied, len(times))),
        lost=running(_total(lost, len(times))),
        work=float(sum((np.abs(power) @ weight for power in supplied.values()), start=0.0)),
        lost_in={name: float(power @ weight) for name, power in lost.items()},
        supplied_by={name: float(power @ weight) for name, power in supplied.items()},
    )


def _total(by_part: dict[str, Array], size: int) -> Array:
    return np.asarray(sum(by_part.values(), start=np.zeros(size)))
