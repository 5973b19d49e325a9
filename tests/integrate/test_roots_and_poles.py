"""Laws with a root or a pole that the motion reaches: a Taylor series may pass one without a trace."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.integrate.problem import SeriesError

w, t = sw.omega, sw.t
ENGINES = ("auto", "heyoka", "scipy", "sundials")


def coasting(law: sympy.Expr, J: float = 1.0) -> sw.Network:
    net = sw.Network("coast")
    net.add(sw.TorqueSource("oil", tau=law), "a")
    net.add(sw.Inertia("J", J=J), "a")
    return net


@pytest.mark.parametrize("engine", [pytest.param("auto", marks=pytest.mark.slow), "sundials"])
@pytest.mark.parametrize(
    ("law", "J", "start"),
    [
        (-sympy.sqrt(sympy.Abs(w)) * sympy.sign(w), 1.0, 1.0),
        (-2 * sympy.sqrt(sympy.Abs(w)) * sympy.sign(w), 1.0, 4.0),
        (-3 * sympy.sqrt(sympy.Max(0, w)), 2.0, 10.0),
    ],
    ids=str,
)
def test_a_brake_by_the_root_of_the_speed_brings_it_to_rest_and_never_back(
    law: sympy.Expr, J: float, start: float, engine: str
) -> None:
    """J w' = -k sqrt(w) from w0: sqrt(w) = sqrt(w0) - k t / 2 J, and then rest."""
    k = -float(law.subs(w, 1.0))
    stop = 2 * J * np.sqrt(start) / k
    sol = coasting(law, J).simulate(1.2 * stop, initial={"J.omega": start}, engine=engine)
    wanted = (np.sqrt(start) * np.maximum(0.0, 1 - sol.t / stop)) ** 2
    np.testing.assert_allclose(sol["J.omega"], wanted, atol=1e-6 * start)  # a hundred times the tolerance of a step


@pytest.mark.parametrize("engine", ENGINES)
def test_a_root_of_a_speed_that_would_become_negative_ends_the_run_where_it_has_no_value(engine: str) -> None:
    with pytest.raises(sw.SimulationError, match=r"oil|root or a pole"):
        coasting(-3 * sympy.sqrt(w), 2.0).simulate(6.0, initial={"J.omega": 10.0}, engine=engine)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "law",
    [
        sympy.tan(50 * t),
        *(
            pytest.param(law, marks=pytest.mark.slow)
            for law in (sympy.tan(t), 1 / sympy.cos(t), 1 / (t**2 - sympy.Rational(1, 2)))
        ),
    ],
    ids=str,
)
def test_no_engine_steps_over_a_pole_of_the_time(law: sympy.Expr, engine: str) -> None:
    with pytest.raises(sw.SimulationError, match="failed at t = "):
        coasting(law).simulate(2.0, engine=engine)


@pytest.mark.heyoka
def test_heyoka_alone_says_what_its_series_does_not_show() -> None:
    with pytest.raises(SeriesError, match="a root or a pole that a Taylor series does not show"):
        coasting(-(sympy.Abs(w) ** 0.75)).simulate(6.0, initial={"J.omega": 1.0}, engine="heyoka")


@pytest.mark.slow
def test_a_root_in_one_phase_of_several_is_followed_or_refused_and_no_motion_ends_early() -> None:
    """Released from the clutch at 1 s, the wheel comes to rest at 3 s: it is followed up to there, and rests then.

    Engines that step over the infinite slope of the law at rest say so.
    """

    def run(t_end: float) -> sw.Solution:
        net = coasting(-sympy.sqrt(sympy.Abs(w)) * sympy.sign(w))
        net.add(sw.SpeedSource("line", omega=1.0), "b")
        net.add(sw.Clutch("C", tau=10.0, t_off=1.0), "b", "a")
        return net.simulate(t_end)

    sol = run(2.5)
    assert sol.steps[-1] == sol.t[-1] == 2.5
    assert sol.at([2.5])["J.omega"][0] == pytest.approx(0.25**2, rel=1e-6)
    try:
        rested = run(5.0)
    except sw.SimulationError as failed:
        assert "failed at t = 3.0" in str(failed)  # noqa: PT017 (engines differ)
    else:
        assert abs(rested["J.omega"][-1]) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy", "scipy-radau"])
def test_a_bell_over_the_angle_gives_its_work_and_one_over_the_speed_is_no_door(engine: str) -> None:
    """J w^2 / 2 is the work of 10 N m over phi and of the bell, A sqrt(pi) width; the barrier holds w where it is 0."""
    over_angle = coasting(10 + 1e4 * sympy.exp(-(((sw.phi - 5) / 1e-3) ** 2)))
    sol = over_angle.simulate(2.0, engine=engine, angles="J")
    work = 10 * sol["J.phi"][-1] + 1e4 * 1e-3 * np.sqrt(np.pi)
    assert sol["J.omega"][-1] == pytest.approx(np.sqrt(2 * work), rel=1e-6)
    barrier = coasting(10 - 100 * sympy.exp(-(((w - 5) / 1e-2) ** 2)))
    before = 5 - 1e-2 * np.sqrt(np.log(10))
    assert barrier.simulate(2.0, engine=engine)["J.omega"][-1] == pytest.approx(before, rel=1e-6)


def test_what_an_engine_has_missed_is_said_by_the_energy() -> None:
    """Two steep edges, one after another, are a barrier that nothing looks for; a coarse run jumps over a part."""
    edges = (sympy.tanh((w - 4.9) / 1e-2) - sympy.tanh((w - 5.1) / 1e-2)) / 2
    sol = coasting(10 + 100 * edges).simulate(2.0, engine="scipy", rtol=1e-4)
    with pytest.warns(sw.AccuracyWarning, match=r"leaves 0.05 of the work done unexplained.* engine 'scipy'"):
        assert sol.energy_residual > 0.01
