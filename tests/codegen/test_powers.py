"""Laws with powers act from rest and through it: they have Taylor series at zero, and their steps are found."""

from __future__ import annotations

import itertools
from typing import Any

import mpmath
import numpy as np
import pytest
from sympy import Abs, Expr, Rational, sign, sqrt

import shaftwork as sw
from shaftwork.integrate.engines import available

W, T = sw.omega, sw.t
ENGINES = ("heyoka", "numba")
RESISTANCES: dict[str, tuple[Expr, Any]] = {
    "omega^6": (W**6, 6),
    "omega^7": (W**7, 7),
    "omega^13": (W**13, 13),
    "|omega|^1.5": (Abs(W) ** 1.5, 1.5),
    "|omega|^(4/3)": (Abs(W) ** Rational(4, 3), mpmath.mpf(4) / 3),
    "|omega|^1.1": (Abs(W) ** 1.1, 1.1),
    "omega sqrt|omega|": (W * sqrt(Abs(W)), 1.5),
    "sign(omega) |omega|^2.5": (sign(W) * Abs(W) ** 2.5, 2.5),
}
"""A resistance and its power."""


def wheel(tau: Expr, t_end: float, times: Any, engine: str, initial: float = 0.0) -> sw.Solution:
    net = sw.Network("wheel")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("drive", tau=tau), "a")
    return net.simulate(t_end, engine=engine, rtol=1e-10, t_eval=times, initial={"J1.omega": initial})


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", RESISTANCES)
def test_a_wheel_starts_from_rest_against_a_power_of_its_speed(name: str, engine: str) -> None:
    """omega' = 1 - omega^n has come to omega after the integral of 1 / (1 - x^n) from 0 to omega.

    1e-9 of the time: ten times rtol, for what adds up over some thirty steps; heyoka's tolerance is one of 1 rad/s.
    """
    law, power = RESISTANCES[name]
    times = np.array([0.0, 0.01, 0.3, 0.8, 1.5])
    for t, omega in zip(times, wheel(1 - law, 1.5, times, engine)["J1.omega"], strict=True):
        assert mpmath.quad(lambda x: 1 / (1 - x**power), [0, mpmath.mpf(omega)]) == pytest.approx(
            t, rel=1e-9, abs=1e-10
        )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["sign(omega) |omega|^2.5", "omega sqrt|omega|"])
def test_a_wheel_passes_through_rest_where_its_resistance_has_a_root(name: str, engine: str) -> None:
    law, power = RESISTANCES[name]
    turn = mpmath.quad(lambda x: 1 / (1 + x**power), [0, 1])
    times = np.array([0.0, float(turn) - 0.1, float(turn) + 0.1, float(turn) + 1.0])
    for t, omega in zip(times, wheel(1 - law, 2.5, times, engine, initial=-1.0)["J1.omega"], strict=True):
        resistance = 1 if omega < 0 else -1
        way = mpmath.quad(lambda x, s=resistance: 1 / (1 + s * x**power), [0, abs(mpmath.mpf(omega))])
        assert turn - resistance * way == pytest.approx(t, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("power", [6, 9, 13])
def test_a_torque_that_grows_as_a_power_of_time_has_its_integral(power: Any, engine: str) -> None:
    times = np.array([0.5, 1.0, 2.0])
    n = float(power)
    np.testing.assert_allclose(
        wheel(T**power, 2.0, times, engine)["J1.omega"], times ** (n + 1) / (n + 1), rtol=1e-9, atol=1e-10
    )


def test_auto_stays_with_the_compiled_engine() -> None:
    for law, _ in itertools.islice(RESISTANCES.values(), 5):
        net = sw.Network("wheel")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(sw.TorqueSource("drive", tau=1 - law), "a")
        assert net.simulate(1.0).engine == next(filter(available, ENGINES))
