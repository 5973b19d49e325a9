"""The energy balance of a run: what was stored, supplied and lost, and what is left over (it should be nothing).

Tellegen: the powers of all branches sum to zero at every instant, so stored(t) - stored(0) = supplied - lost. The
residual measures the error of the integration, independent of any reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.observer import Array, DenseStates, Observer, blocks

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
"""Gauss points in one panel, from -1 to 1, and their weights."""
TIGHT = 1e-13
"""A panel is halved until its work changes by less than this fraction of the mean work of a step."""
HALVINGS = 7
NOISE, FALLS = 1e-11, 0.75
"""Changes below the first fraction are noise where halving leaves more than this share of them."""


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


def energy_balance(observer: Observer, dense: DenseStates, steps: Array) -> EnergyBalance:
    """Integrate the powers over every step with Gauss' formula, on panels halved until their work no longer changes.

    The run is read in blocks of steps, so that the memory that it takes does not grow with the number of steps.

    Args:
        observer: of the model.
        dense: states (k, n) at times (k,).
        steps: (s,) times between which `dense` is smooth.
    """
    before, after = _stored_on_both_sides(observer, dense, steps)
    impulses, hits, at_once = _impulses(observer.impacts(dense), steps, after - before)
    flow = _Work(observer, dense, steps)
    return EnergyBalance(
        t=steps,
        stored=after,
        supplied=flow.supplied + np.cumsum(impulses),
        lost=flow.lost + np.cumsum(_total(hits, len(steps))),
        work=flow.work + float(np.abs(impulses).sum()),
        lost_in=_sums(flow.lost_in, {part: float(energy.sum()) for part, energy in hits.items()}),
        supplied_by=_sums(flow.supplied_by, at_once),
    )


def _sums(first: Mapping[str, float], second: Mapping[str, float]) -> dict[str, float]:
    return {part: first.get(part, 0.0) + second.get(part, 0.0) for part in {**first, **second}}


def _impulses(
    impacts: Iterable[tuple[float, str, Mapping[str, float], Mapping[str, float]]], steps: Array, jumps: Array
) -> tuple[Array, dict[str, Array], dict[str, float]]:
    """(s,) energy that sources give at once; of impacts by part the (s,) that is lost, and what sources give."""
    impulses = jumps.copy()
    lost: dict[str, Array] = {}
    supplied: dict[str, float] = {}
    for time, part, sources, others in impacts:
        if time <= steps[0]:  # the balance begins after it
            continue
        places = np.flatnonzero(steps == time)[-1:]
        if part:
            rest = sum(sources.values()) - impulses[places] - sum(others.values())
            lost.setdefault(part, np.zeros(len(steps)))[places] += rest
        for other, energy in others.items():
            lost.setdefault(other, np.zeros(len(steps)))[places] += energy
        impulses[places] = sum(sources.values())
        supplied = _sums(supplied, sources)
    return impulses, lost, supplied


def _stored_on_both_sides(observer: Observer, dense: DenseStates, steps: Array) -> tuple[Array, Array]:
    """Stored energy just before and at every time of `steps`; they differ where an input's jump is an impulse."""
    before, after = np.empty(len(steps)), np.empty(len(steps))
    # a time that is listed twice is read before what jumps there, and then after it: both belong to one block
    firsts = np.flatnonzero(np.append(True, np.diff(steps) != 0))
    ends = np.append(firsts[1:], len(steps))
    for block in blocks(len(firsts), 2 * _width(observer, dense, steps)):
        places = slice(firsts[block][0], ends[block][-1])
        times = steps[places]
        pairs = np.column_stack([np.nextafter(times, steps[0]), times])
        stored = _total(observer.stored(np.repeat(times, 2), dense(pairs.ravel()), dense), 2 * len(times))
        before[places], after[places] = stored[::2], stored[1::2]
    return before, after


def _width(observer: Observer, dense: DenseStates, steps: Array) -> int:
    """Numbers that are read at one time: states, and powers lost and supplied."""
    return int(dense(steps[:1]).shape[1]) + 2 * len(observer.wiring)


class _Work:
    """What goes through the parts: running sums (s,), and totals by part.

    Args:
        observer: of the model.
        dense: the motion.
        steps: (s,) times.
    """

    def __init__(self, observer: Observer, dense: DenseStates, steps: Array) -> None:
        self._observer, self._dense = observer, dense
        self._rows = _width(observer, dense, steps) * len(NODES)
        self._by_step = np.zeros((2, len(steps) - 1))
        self.work, self.lost_in, self.supplied_by = 0.0, dict[str, float](), dict[str, float]()
        panels = _Panels(np.arange(len(steps) - 1), steps[:-1], np.diff(steps))
        whole, turnover = np.zeros_like(self._by_step), 0.0
        for block in blocks(len(panels.step), self._rows):
            part = panels.taken(block)
            powers = self._powers(part)
            whole[:, block] = part.works(powers)
            turnover += part.turnover(powers[1])
        self._each = max(turnover, float(np.abs(np.cumsum(whole[0])).max(initial=0.0))) / len(steps)
        self._settle(panels, whole, np.full(len(panels.step), np.inf), HALVINGS)

    @property
    def lost(self) -> Array:
        """(s,) heat since the start, J."""
        return np.append(0.0, np.cumsum(self._by_step[0]))

    @property
    def supplied(self) -> Array:
        """(s,) work of the sources since the start, J."""
        return np.append(0.0, np.cumsum(self._by_step[1]))

    def _powers(self, panels: _Panels) -> tuple[dict[str, Array], dict[str, Array]]:
        """(p, 12) lost and supplied power by part at the nodes of panels."""
        times = panels.times.ravel()
        lost, supplied = self._observer.powers(times, self._dense(times))
        shape = panels.times.shape
        first, second = ({name: power.reshape(shape) for name, power in by.items()} for by in (lost, supplied))
        return first, second

    def _settle(self, panels: _Panels, whole: Array, before: Array, halvings: int) -> None:
        """Add the work of panels; of each the halves, and theirs in turn where the work still changes by that.

        Args:
            panels: p of them.
            whole: (2, p) lost and supplied work of each by its own nodes, J.
            before: (p,) by how much the work of that changed which each is a half of, J.
            halvings: so many at most.
        """
        for block in blocks(len(panels.step), 2 * self._rows):
            halves = panels.taken(block).halved()
            powers = self._powers(halves)
            parts = halves.works(powers)
            change = np.abs(parts.reshape(2, -1, 2).sum(axis=2) - whole[:, block]).sum(axis=0)
            noisy = (change > FALLS * before[block]) & (change <= NOISE * self._each)
            still = (change > TIGHT * self._each) & ~noisy if halvings > 1 else np.zeros(len(change), dtype=bool)
            open_ = np.repeat(still, 2)
            settled = ({name: power[~open_] for name, power in by_part.items()} for by_part in powers)
            self._add(halves.taken(~open_), *settled)
            if still.any():
                self._settle(halves.taken(open_), parts[:, open_], np.repeat(change, 2)[open_], halvings - 1)

    def _add(self, panels: _Panels, lost: Mapping[str, Array], supplied: Mapping[str, Array]) -> None:
        """Add the work of panels from the powers (p, 12) at their nodes."""
        for row, powers, totals in ((0, lost, self.lost_in), (1, supplied, self.supplied_by)):
            for name, power in powers.items():
                work = panels.integrals(power)
                np.add.at(self._by_step[row], panels.step, work)
                totals[name] = totals.get(name, 0.0) + float(work.sum())
        self.work += panels.turnover(supplied)


@dataclass(frozen=True, eq=False)
class _Panels:
    """Parts of steps, ascending.

    Args:
        step: (p,) numbers of their steps.
        start: (p,) s.
        length: (p,) s.
    """

    step: NDArray[np.intp]
    start: Array
    length: Array

    @property
    def times(self) -> Array:
        """(p, 12) nodes of Gauss' formula, s."""
        times: Array = self.start[:, None] + self.length[:, None] * (NODES + 1) / 2
        return times

    def integrals(self, values: Array) -> Array:
        """(p,) over each of values (p, 12) at the nodes."""
        return np.asarray(values @ WEIGHTS * self.length / 2)

    def works(self, powers: Iterable[Mapping[str, Array]]) -> Array:
        """(2, p) integrals over each of all that is lost and of all that is supplied, from powers (p, 12) by part."""
        return np.stack([self.integrals(_total(by_part, self.times.shape)) for by_part in powers])

    def turnover(self, supplied: Mapping[str, Array]) -> float:
        """The integral over all of them of the sizes of supplied powers (p, 12)."""
        return sum(float(self.integrals(np.abs(power)).sum()) for power in supplied.values())

    def halved(self) -> _Panels:
        """Two for each."""
        start, half = np.repeat(self.start, 2), np.repeat(self.length / 2, 2)
        start[1::2] += half[1::2]
        return _Panels(np.repeat(self.step, 2), start, half)

    def taken(self, which: slice | NDArray[np.bool_]) -> _Panels:
        """Some of them."""
        return _Panels(self.step[which], self.start[which], self.length[which])


def _total(by_part: Mapping[str, Array], shape: int | tuple[int, ...]) -> Array:
    return np.asarray(sum(by_part.values(), start=np.zeros(shape)))
