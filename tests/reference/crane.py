"""The start of a crane's travelling gear, typed by hand: the reference for the two-mass model with a Kloss motor.

    J1 w1' = ratio eta M(s) - tau,        M(s) = 2 tau_k / (s/s_k + s_k/s),  s = 1 - ratio w1 / (2 pi n_sync / 60)
    J2 w2' = tau - tau_w tanh(w2 / omega_s),   tau = c phi + d (w1 - w2),  phi' = w1 - w2

Source: Marinkovic 2012, section 3 and equations (12)-(14) without the gap. J1, J2, c, d, ratio, the efficiency, the
load and the wheel diameter are the paper's; tau_k, s_k (in the paper only in a figure) and omega_s are chosen.
``shaft_torque`` integrates with DOP853 at 1e-13; ``taylor`` integrates the same equations with Taylor series in
40-digit arithmetic and says how good that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt, tanh
from typing import Any

import mpmath  # type: ignore[import-untyped]
import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray[Any, np.dtype[np.float64]]


def kloss_slip(tau_k: float, n_rated: float = 2510.0, tau_rated: float = 3.8, n_sync: float = 3000.0) -> float:
    """Pull-out slip s_k of the Kloss curve with pull-out torque tau_k through the rated point, N m and 1/min.

    Of the two solutions of s_k/s_n + s_n/s_k = 2 tau_k/tau_rated the one with s_k > s_n: the rated point is stable.
    """
    quotient = tau_k / tau_rated
    return (1.0 - n_rated / n_sync) * (quotient + sqrt(quotient**2 - 1.0))


@dataclass(frozen=True)
class Crane:
    """Parameters in SI units; n_sync in 1/min, tau_k at the motor, everything else at the wheel's shaft."""

    J1: float = 27.35
    J2: float = 62.5
    c: float = 24206.0
    d: float = 14.0
    tau_k: float = 9.6
    s_k: float = 0.25
    n_sync: float = 3000.0
    ratio: float = 35.5
    efficiency: float = 0.95
    tau_w: float = 22.4
    omega_s: float = 0.01
    radius: float = 0.125


def _rates(crane: Crane, state: Array) -> list[float]:
    phi, w1, w2 = state.tolist()
    slip = 1.0 - crane.ratio * w1 / (2.0 * pi * crane.n_sync / 60.0)
    # the Kloss curve multiplied by s s_k, so that it has a value at s = 0 too
    motor = crane.ratio * crane.efficiency * 2.0 * crane.tau_k * slip * crane.s_k / (slip**2 + crane.s_k**2)
    tau = crane.c * phi + crane.d * (w1 - w2)
    return [w1 - w2, (motor - tau) / crane.J1, (tau - crane.tau_w * tanh(w2 / crane.omega_s)) / crane.J2]


def states(crane: Crane, t: Sequence[float] | Array) -> Array:
    """Twist (rad) and the two speeds (rad/s) from rest, shape (3, time), by DOP853 at a relative tolerance of 1e-13."""
    times = np.asarray(t, dtype=float)
    solution = solve_ivp(
        lambda _, y: _rates(crane, y),
        (0.0, float(times[-1])),
        np.zeros(3),
        method="DOP853",
        t_eval=times,
        rtol=1e-13,
        atol=1e-18,
        max_step=2e-3,  # t_eval is read from a dense output of order 7: short steps keep that as good as the steps
    )
    if not solution.success:
        raise ArithmeticError(solution.message)
    return np.asarray(solution.y, dtype=float)


def shaft_torque(crane: Crane, t: Sequence[float] | Array) -> Array:
    """Torque c phi + d (w1 - w2) of the shaft in N m at the increasing times t, s, from rest at t = 0."""
    phi, w1, w2 = states(crane, t)
    return np.asarray(crane.c * phi + crane.d * (w1 - w2), dtype=float)


def _product(a: list[Any], b: list[Any], k: int) -> Any:
    return mpmath.fdot(a[: k + 1], reversed(b[: k + 1]))


def _series(crane: Crane, start: Sequence[Any], order: int) -> list[list[Any]]:
    """Taylor coefficients of (phi, w1, w2) by the recurrences of product, quotient and tanh."""
    mpf = mpmath.mpf
    J1, J2, c, d, tau_w, s_k = (mpf(v) for v in (crane.J1, crane.J2, crane.c, crane.d, crane.tau_w, crane.s_k))
    per_speed = mpf(crane.ratio) * 30 / (mpmath.pi * mpf(crane.n_sync))
    strength = 2 * mpf(crane.ratio) * mpf(crane.efficiency) * mpf(crane.tau_k) * s_k
    phi, w1, w2 = ([value] for value in start)
    slip: list[Any] = []
    square: list[Any] = []
    curve: list[Any] = []
    friction: list[Any] = []
    slope: list[Any] = []
    for k in range(order):
        slip.append((1 if k == 0 else 0) - per_speed * w1[k])
        square.append(_product(slip, slip, k) + (s_k**2 if k == 0 else 0))
        curve.append((slip[k] - mpmath.fdot(square[1:], reversed(curve))) / square[0])
        if k == 0:
            friction.append(mpmath.tanh(w2[0] / mpf(crane.omega_s)))
        else:
            rate = [(j + 1) * w2[j + 1] / mpf(crane.omega_s) for j in range(k)]
            friction.append(_product(slope, rate, k - 1) / k)
        slope.append((1 if k == 0 else 0) - _product(friction, friction, k))
        tau = c * phi[k] + d * (w1[k] - w2[k])
        phi.append((w1[k] - w2[k]) / (k + 1))
        w1.append((strength * curve[k] - tau) / J1 / (k + 1))
        w2.append((tau - tau_w * friction[k]) / J2 / (k + 1))
    return [phi, w1, w2]


def taylor(crane: Crane, t: Sequence[float], step: float = 1e-3, order: int = 30, digits: int = 40) -> Array:
    """Shaft torque (N m) at multiples of ``step``, by Taylor series of the given order in ``digits`` decimal digits.

    The time of one step is rounded once and all times are multiples of it, so that no error of time is left.
    """
    wanted = {round(time / step): k for k, time in enumerate(t)}
    result = np.zeros(len(t))
    with mpmath.workdps(digits):
        h, state = mpmath.mpf(step), [mpmath.mpf(0)] * 3
        for number in range(max(wanted) + 1):
            if number in wanted:
                torque = mpmath.mpf(crane.c) * state[0] + mpmath.mpf(crane.d) * (state[1] - state[2])
                result[wanted[number]] = float(torque)
            state = [mpmath.polyval(row[::-1], h) for row in _series(crane, state, order)]
    return result
