"""Pieces of a chain between places with given motions: how they follow these, and how they swing while these rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shaftwork.reduce.chain import Chain
from shaftwork.reduce.tridiagonal_modes import Array, TridiagonalChain, carried

NOTHING = 1e-12
"""A share of a speed or of an inertia that is only rounding."""


@dataclass(frozen=True, eq=False)
class Carried:
    """An inertia that the boundaries carry, each by its share.

    Args:
        inertia: its size, kg m^2.
        base: (b,) share of the speed of each boundary in its own.
        between: places of the boundaries beside it, one or two.
    """

    inertia: float
    base: Array
    between: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class FixedBoundaryMode(Carried):
    """How a piece of a chain swings while its boundaries are held: an inertia on a spring that they carry.

    Args:
        c: stiffness of the spring, N m/rad.
        d: its damping, N m s/rad.
        shares: (n,) speed of each station against what the boundaries give it, over that of the inertia against its
            base; zero in other pieces.
    """

    c: float
    d: float
    shares: Array


@dataclass(frozen=True, eq=False)
class Substructure:
    """The stations between boundaries, or beyond the outer ones.

    Args:
        still: (n, b) speed of each station by those of the boundaries while nothing swings; zero in other pieces.
        joint: stiffness, N m/rad, and damping, N m s/rad, of the spring that it is between two boundaries then.
        support: (b, 2) the same of the springs that it is from the boundaries to the frame.
        between: places of the boundaries beside it, one or two.
        modes: all of its modes.
    """

    still: Array
    joint: tuple[float, float]
    support: Array
    between: tuple[int, ...]
    modes: tuple[FixedBoundaryMode, ...]


def piece_of(chain: Chain, count: int, number: int, inner: range) -> Substructure:
    """The stations before the boundary of this number, of so many, and behind the one before it.

    Law: C is the deflection of the stations under the boundaries while nothing swings; the force that it takes to hold
    one boundary while another moves is that in the last spring on the way, c C, and what is not found there has gone
    into the supports, sum c_s C.
    """
    between = tuple(k for k in (number - 1, number) if 0 <= k < count)
    still = np.zeros((len(chain.stations), count))
    if not inner:
        return Substructure(still, (0.0, 0.0), np.zeros((count, 2)), between, ())
    held = _FixedBoundaries.of(chain, inner)
    given = np.zeros((len(inner) + 2, count))
    for k, place, follow in zip((number - 1, number), (0, -1), (held.from_first, held.from_last), strict=True):
        if k in between:
            given[place, k] = 1.0
            given[1:-1, k] = follow()
    still[inner] = given[1:-1]
    stiffness = held.c[-1] * float(still[inner[-1], number - 1]) if len(between) > 1 else 0.0
    lost = held.lost(given)
    damping = max(-float(lost[between]), 0.0) if len(between) > 1 else 0.0
    support = np.stack([held.supports @ still[inner], np.maximum(lost.diagonal() - damping, 0.0)], axis=1)
    beside = [chain.stations[k].inertia for k in (inner.start - 1, inner.stop) if 0 <= k < len(chain.stations)]
    faint = math.sqrt(NOTHING * min(size for size in (*beside, *held.inertias.tolist()) if size))
    modes = tuple(_modes(held, still, between, np.array(inner), number, faint))
    return Substructure(still, (stiffness, damping), support, between, modes)


@dataclass(frozen=True, eq=False)
class _FixedBoundaries:
    """Stations while the boundaries beside them rest.

    Args:
        inertias: (m,) kg m^2.
        supports: (m,) stiffness of springs to the frame, N m/rad.
        bearings: (m,) their damping, N m s/rad.
        c: (m + 1,) stiffness of the springs between them, and before and behind them to the boundaries; there zero
            where there is none.
        d: (m + 1,) damping of the same.
    """

    inertias: Array
    supports: Array
    bearings: Array
    c: Array
    d: Array

    @classmethod
    def of(cls, chain: Chain, inner: range) -> _FixedBoundaries:
        stations = [chain.stations[k] for k in inner]
        inertias, supports = np.array([(station.inertia, station.support) for station in stations]).T
        bearings = np.array([sum(spring.d for spring in station.bearings) for station in stations])
        springs = np.array([(0.0, 0.0), *((link.c, link.d) for link in chain.links), (0.0, 0.0)])
        return cls(inertias, supports, bearings, *springs[inner.start : inner.stop + 1].T)

    @property
    def row(self) -> TridiagonalChain:
        """How they swing."""
        return TridiagonalChain(self.inertias, self.c[1:-1], _first(_last(self.supports, self.c[-1]), self.c[0]))

    def from_first(self) -> Array:
        """(m,) how they follow the boundary before them."""
        return carried(self.c[0], self.c[1:-1], _last(self.supports, self.c[-1]))

    def from_last(self) -> Array:
        """(m,) how they follow the boundary behind them."""
        return carried(self.c[-1], self.c[-2:0:-1], _first(self.supports, self.c[0])[::-1])[::-1]

    def lost(self, speeds: Array) -> Array:
        """(k, k) damping of motions in which they and the places beside them have (m + 2, k) speeds."""
        twists, inner = np.diff(speeds, axis=0), speeds[1:-1]
        return np.asarray(twists.T @ (self.d[:, None] * twists) + inner.T @ (self.bearings[:, None] * inner))


def _first(values: Array, more: float) -> Array:
    return np.concatenate([values[:1] + more, values[1:]])


def _last(values: Array, more: float) -> Array:
    return _first(values[::-1], more)[::-1]


def _modes(
    held: _FixedBoundaries, still: Array, between: tuple[int, ...], inner: Array, number: int, faint: float
) -> Iterator[FixedBoundaryMode]:
    """The modes of stations while the boundaries beside them rest.

    Law: L = Phi^T J C, which is the force on each boundary, c Phi of the station beside it, over omega^2. Below a faint
    one the inertia is not made smaller, but the share by which it is carried.
    """
    row, count = held.row, still.shape[1]
    for rate in row.rates().tolist():
        shape, _ = row.swing(rate)
        forces = dict(zip((number - 1, number), (held.c[0] * shape[0], held.c[-1] * shape[-1]), strict=True))
        participation = np.array([forces[k] if k in between else 0.0 for k in range(count)]) / rate**2
        size, base = _scaled(participation)
        if abs(size) < faint:
            size, base = faint, participation / faint
        shares = np.zeros(len(still))
        shares[inner] = size * shape
        lost = float(held.lost(np.pad(shape, 1)[:, None])[0, 0])
        yield FixedBoundaryMode(size**2, base, between, size**2 * rate**2, size**2 * lost, shares)


def _scaled(participation: Array) -> tuple[float, Array]:
    """A size and shares that multiply to a participation: shares that sum to one, unless they nearly cancel."""
    total, norm = float(participation.sum()), math.hypot(*participation)
    size = total if abs(total) > norm / 2 else norm
    return size, participation / size if size else participation


def common(inertias: Array, between: tuple[int, ...]) -> Carried | None:
    """What couples two boundaries, as an inertia that both carry and that leaves neither with less than nothing."""
    first, second = (max(float(inertias[k, k]), 0.0) for k in between)
    shared, largest = float(inertias[between]), math.sqrt(first * second)
    if abs(shared) <= NOTHING * inertias.max() or not largest:
        return None
    parts = np.zeros(len(inertias))
    parts[list(between)] = math.sqrt(first), math.copysign(math.sqrt(second), shared)
    size, base = _scaled(math.sqrt(min(abs(shared) / largest, 1.0)) * parts)
    return Carried(size**2, base, between)
