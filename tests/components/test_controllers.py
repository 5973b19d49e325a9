"""The speed controller: closed-loop steps, limits, anti-windup, against the equations by hand."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, step

import shaftwork as sw

ENGINES = ("scipy", "numba", "heyoka", "sundials")
INERTIA, LOSS = 0.5, 0.1


def controlled(**values: Any) -> sw.Model:
    net = sw.Network("controlled")
    net.add(sw.SpeedController("c", **values), "shaft")
    net.add(sw.Inertia("J", J=INERTIA), "shaft")
    net.add(sw.ViscousLoad("fan", d=LOSS), "shaft")
    return net.compile()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_step_response_is_that_of_the_transfer_function(engine: str) -> None:
    """k_p (1 + 1 / (t_i s)) against 1 / (J s + d); scipy's step is exact to rounding of a matrix exponential."""
    model = controlled(omega_ref=20.0, k_p=2.0, t_i=0.2)
    sol = model.simulate(3.0, rtol=1e-10, t_eval=61, engine=engine)
    loop = TransferFunction([2.0, 10.0], [INERTIA, LOSS + 2.0, 10.0])
    _, response = step(loop, T=sol.t)
    np.testing.assert_allclose(sol["J.omega"], 20.0 * response, atol=2e-7)  # 100 rtol of 20 rad/s
    assert model.states == ("J.omega", "c.tau_i")


def test_without_integral_time_it_is_a_damper_to_the_reference_and_without_state() -> None:
    model = controlled(omega_ref=20.0, k_p=2.0)
    sol = model.simulate(1.0, rtol=1e-10, t_eval=5)
    wanted = 20.0 * 2.0 / 2.1 * (1 - np.exp(-2.1 / INERTIA * sol.t))
    np.testing.assert_allclose(sol["J.omega"], wanted, atol=2e-7)
    assert model.states == ("J.omega",)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [{"tau_max": 5.0}, {"tau_max": 5.0, "tau_min": -1.0, "t_track": 0.05}, {"tau_max": 5.0, "t_on": 0.3, "t_off": 5.0}],
    ids=str,
)
@pytest.mark.parametrize("engine", ENGINES)
def test_limits_and_back_calculation_are_those_of_the_equations_by_hand(engine: str, options: dict[str, float]) -> None:
    """The reference steps up and down, so that both limits are met. By hand: small steps of DOP853 over the kinks of
    the limiter, from jump to jump, whose own error is 1e-8 of the speed.
    """
    reference = sw.Step(20.0, start=0.5) + sw.Step(-15.0, start=4.0)
    track, least = options.get("t_track", 0.2), options.get("tau_min", -5.0)
    on, off = options.get("t_on", 0.0), options.get("t_off", math.inf)

    def rates(t: float, x: NDArray[np.float64]) -> list[float]:
        lag = (20.0 if t >= 0.5 else 0.0) - (15.0 if t >= 4.0 else 0.0) - x[0]
        wanted = 2.0 * lag + x[1]
        torque = min(5.0, max(least, wanted))
        if not on <= t < off:
            return [-LOSS * x[0] / INERTIA, 0.0]
        return [(torque - LOSS * x[0]) / INERTIA, 2.0 / 0.2 * lag + (torque - wanted) / track]

    jumps = sorted({0.0, 0.5, 4.0, 7.0, *(time for time in (on, off) if time < 7.0)})
    x, wanted = np.zeros(2), []
    for left, right in pairwise(jumps):
        span = left, math.nextafter(right, left)
        x = solve_ivp(rates, span, x, "DOP853", rtol=1e-11, atol=1e-12, max_step=2e-3).y[:, -1]
        wanted.append(x)
    model = controlled(omega_ref=reference, k_p=2.0, t_i=0.2, **options)
    sol = model.simulate(7.0, rtol=1e-10, t_eval=np.array(jumps[1:]), engine=engine)
    np.testing.assert_allclose(np.array([sol["J.omega"], sol["c.tau_i"]]).T, wanted, atol=1e-6)
    dense = model.simulate(7.0, engine=engine)
    assert least <= dense["c.tau"].min() < dense["c.tau"].max() <= 5.0


@pytest.mark.slow
def test_anti_windup_takes_away_the_overshoot_that_a_wound_up_integral_makes() -> None:
    """A step that needs 2 s at the limit of the torque; t_track of 1e6 s is no anti-windup at all."""
    overshoot = {}
    for track in (0.2, 1e6):
        model = controlled(omega_ref=20.0, k_p=2.0, t_i=0.2, tau_max=5.0, t_track=track)
        overshoot[track] = model.simulate(12.0)["J.omega"].max() / 20.0 - 1
    assert overshoot[0.2] < 0.04
    assert overshoot[1e6] > 0.6


def test_a_reference_may_be_any_law_of_time() -> None:
    """A fast controller follows a sine; with J = 0.5 kg m^2 and 200 N m s/rad it lags by some 1e-3."""
    sol = controlled(omega_ref=5.0 * sympy.sin(sw.t), k_p=200.0, t_i=0.01).simulate(6.0, t_eval=61)
    np.testing.assert_allclose(sol["J.omega"][1:], 5.0 * np.sin(sol.t[1:]), atol=0.01)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"tau_min": -2.0}, "tau_min is given without tau_max"),
        ({"t_track": 1.0, "tau_max": 1.0}, "there is no integral part. Give t_i"),
        ({"t_track": 1.0, "t_i": 1.0}, "there are no limits. Give tau_max"),
        ({"tau_min": 2.0, "tau_max": 1.0}, "no room between tau_min = 2 N m and tau_max = 1 N m"),
        ({"tau_max": -1.0}, "no room between tau_min = 1 N m and tau_max = -1 N m"),
        ({"t_on": 1.0, "t_off": 1.0}, "t_off = 1 s is not later than t_on = 1 s"),
    ],
)
def test_limits_without_room_are_refused(limits: dict[str, float], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        sw.SpeedController("c", omega_ref=1.0, k_p=1.0, **limits)


def test_a_controller_supplies_the_work_of_its_torque_whatever_its_integral_part_has_stored() -> None:
    net = sw.Network("axis")
    net.add(sw.SpeedController("drive", omega_ref=10.0, k_p=0.5, t_i=0.3, tau_max=4.0), "a")
    net.add(sw.Inertia("J", J=0.2), "a")
    net.add(sw.Damper("d", d=0.1), "a")
    made = net.simulate(2.0, rtol=1e-10, t_eval=np.linspace(0, 2, 20001))
    power = made["drive.tau"] * made["J.omega"]
    # the trapezoidal rule with steps of 1e-4 s beside time constants of 0.1 s
    assert made.energy.supplied_by["drive"] == pytest.approx(np.trapezoid(power, made.t), rel=1e-6)
    assert made.energy.residual < 1e-9
    assert made["drive.tau_i"][-1] > 0.5
