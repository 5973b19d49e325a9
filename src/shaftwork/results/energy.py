"""The energy balance of a run: what was stored, supplied and lost, and what is left over (it should be nothing).

Tellegen: the powers of all branches sum to zero at every instant, so stored(t) - stored(0) = supplied - lost. The
residual measures the error of the integration, independent of any reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from shaftwork.results.course import NODES, GaussPanels, LobattoPanels, integrate
from shaftwork.results.observer import Array, DenseStates, Observer, blocks


@dataclass(frozen=True, repr=False)
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

    def __repr__(self) -> str:
        lost, supplied = (sum(parts.values()) for parts in (self.lost_in, self.supplied_by))
        return (
            f"EnergyBalance from {self.t[0]:g} to {self.t[-1]:g} s: {supplied:.6g} J supplied, {lost:.6g} J lost, "
            f"{self.stored[-1] - self.stored[0]:.6g} J stored, residual {self.residual:.1e}"
        )

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
    """Integrate the powers over every step.

    The run is read in blocks of steps, so that the memory that it takes does not grow with the number of steps.

    Args:
        observer: of the model.
        dense: states (k, n) at times (k,).
        steps: (s,) times between which `dense` is smooth.
    """
    before, after = _stored_on_both_sides(observer, dense, steps)
    impulses, hits, at_once = _impulses(observer.impacts(dense), steps, after - before)
    lost, supplied = (tuple(by_part) for by_part in observer.powers(steps[:1], dense(steps[:1])))

    def powers(panels: LobattoPanels) -> Array:
        times = panels.times.ravel()
        rows = [power for by_part in observer.powers(times, dense(times)) for power in by_part.values()]
        return np.array(rows).reshape(len(rows), *panels.times.shape)

    count = len(lost) + len(supplied)
    by_step, totals, sizes = np.zeros((2, len(steps))), np.zeros(count), np.zeros(count)
    losses, supplies = slice(len(lost)), slice(len(lost), None)
    for block in blocks(len(steps) - 1, 2 * len(NODES) * _width(observer, dense, steps)):  # of both parts of each
        ends = slice(block.start, block.stop + 1)
        flow = integrate(powers, steps[ends], rule=GaussPanels, alike=True, size=float(sizes.max(initial=0.0)))
        inside = np.searchsorted(steps[ends], flow.panels.start, side="right")  # the end of the step of each panel
        rows = [flow.values[part].sum(axis=0) for part in (losses, supplies)]
        by_step[:, ends] += [np.bincount(inside, row, minlength=len(steps[ends])) for row in rows]
        totals += flow.totals
        sizes += flow.sizes.sum(axis=1)
    return EnergyBalance(
        t=steps,
        stored=after,
        supplied=np.cumsum(by_step[1] + impulses),
        lost=np.cumsum(by_step[0] + _total(hits, len(steps))),
        work=float(sizes[supplies].sum() + np.abs(impulses).sum()),
        lost_in=_sums(
            dict(zip(lost, totals[losses].tolist(), strict=True)),
            {part: float(energy.sum()) for part, energy in hits.items()},
        ),
        supplied_by=_sums(dict(zip(supplied, totals[supplies].tolist(), strict=True)), at_once),
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


def _total(by_part: Mapping[str, Array], shape: int) -> Array:
    return np.asarray(sum(by_part.values(), start=np.zeros(shape)))
