"""An independent reference: stick-slip of a drill string by the method of steps; it shares nothing with the library.

The string is a lossless line of impedance Z and delay T between a top drive with a PI controller and a bit with dry
friction. Between two kinks what arrives is a known smooth function, so DOP853 of scipy integrates ordinary differential
equations, and its `brentq` locates where the bit sticks and slips. What leaves the ends is kept as Chebyshev
interpolants of each piece, and every kink comes back a delay later as the edge of a piece.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

DEGREE, PARTS, TIGHT, CLOSE = 20, 6, 1e-12, 1e-9


class Stop(NamedTuple):
    """When the bit slips or sticks."""

    time: float
    sticks: bool


@dataclass(frozen=True)
class String:
    """The drill string; SI units, torques in N m, inertias in kg m2."""

    Z: float
    T: float
    J_top: float
    J_bit: float
    k_p: float
    t_i: float
    omega_ref: float
    t_ramp: float
    tau_c: float
    tau_s: float
    omega_s: float

    def friction(self, omega: float) -> float:
        """Of the bit that turns forward."""
        return self.tau_c + (self.tau_s - self.tau_c) * np.exp(-((omega / self.omega_s) ** 2))


class _Line:
    """What has left both ends, piece by piece, zero before the start."""

    def __init__(self, delay: float) -> None:
        self.delay, self.starts = delay, [0.0]
        self.pieces: list[tuple[Chebyshev, Chebyshev]] = []

    def arriving(self, t: float, end: int) -> float:
        """The torque that arrives at the top (0) or the bit (1) at a time in s, from what left the other end."""
        then = t - self.delay
        if then <= 0:
            return 0.0
        number = min(bisect.bisect_right(self.starts, then) - 1, len(self.pieces) - 1)
        return -float(self.pieces[number][1 - end](then))


def motion(string: String, t_end: float) -> tuple[list[Stop], np.ndarray, np.ndarray]:
    """Events, and times with the speed of the bit at them."""
    line, x, t, stuck = _Line(string.T), np.zeros(3), 0.0, True
    edges = [k * string.T / PARTS for k in range(1, int(t_end / string.T * PARTS) + 1)] + [string.t_ramp, t_end]
    edges += [string.t_ramp + k * string.T for k in range(1, int((t_end - string.t_ramp) / string.T) + 1)]
    stops: list[Stop] = []
    times, speeds = [np.zeros(1)], [np.zeros(1)]
    edges.sort()
    while t < t_end - CLOSE:
        end = next(edge for edge in edges if edge > t + CLOSE)
        met, x_met, dense = _piece(string, line, (t, end), x, stuck=stuck)
        nodes = t + (met - t) * (np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1)) + 1) / 2
        states = dense(nodes)
        waves = (2 * string.Z * states[2 * k] + [line.arriving(s, k) for s in nodes] for k in (0, 1))
        line.pieces.append(tuple(Chebyshev.fit(nodes, wave, DEGREE, [t, met]) for wave in waves))
        line.starts.append(met)
        shown = np.linspace(t, met, 21)[1:]
        times.append(shown)
        speeds.append(dense(shown)[2])
        if met < end:
            stuck = not stuck
            stops.append(Stop(met, stuck))
            for k in range(1, int((t_end - met) / string.T) + 1):
                bisect.insort(edges, met + k * string.T)
        t, x = met, x_met
        if stuck:
            x[2] = 0.0
    return stops, np.concatenate(times), np.concatenate(speeds)


Found = tuple[float, np.ndarray, Callable[..., np.ndarray]]


def _piece(string: String, line: _Line, span: tuple[float, float], x: np.ndarray, *, stuck: bool) -> Found:
    """The motion up to the end of a span or the first event in it: the time, the state there, and dense output."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        omega, tau_i, bit = y
        late = string.omega_ref * min(1.0, t / string.t_ramp) - omega
        top = (string.k_p * late + tau_i - string.Z * omega - line.arriving(t, 0)) / string.J_top
        if stuck:
            return [top, string.k_p / string.t_i * late, 0.0]
        slips = (-string.Z * bit - line.arriving(t, 1) - string.friction(bit)) / string.J_bit
        return [top, string.k_p / string.t_i * late, slips]

    def guard(t: float, y: np.ndarray) -> float:
        return -line.arriving(t, 1) - string.tau_s if stuck else -y[2]

    found = solve_ivp(rates, span, x, "DOP853", dense_output=True, rtol=TIGHT, atol=TIGHT)
    looks = np.linspace(*span, 201)[1:]
    values = np.array([guard(t, found.sol(t)) for t in looks])
    beyond = np.flatnonzero(values > 0)
    begun = np.flatnonzero(values <= 0)
    if not beyond.size or not begun.size or beyond[-1] < begun[0]:
        return span[1], found.y[:, -1].copy(), found.sol
    first = int(beyond[beyond > begun[0]][0])
    low = looks[first - 1] if first else span[0]
    met = brentq(lambda t: guard(t, found.sol(t)), low, looks[first], xtol=1e-14)
    return met, found.sol(met).copy(), found.sol
