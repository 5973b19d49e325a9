"""A branch of a law whose condition does not hold may have no value: the motion goes on as if it were not there."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import Abs, Expr, Max, Piecewise, cos, exp, log, sqrt

import shaftwork as sw
from shaftwork.components.laws import omega, t

HIGH, LOW = sqrt(omega - 5), log(omega)
SPEED = 1 - omega / 2
# Of each law the first is written with a branch without value at rest, the second is the same where the motion passes.
LAWS = {
    "a root twice in a branch that never holds": (Piecewise((-HIGH / (1 + HIGH), omega > 5), (SPEED, True)), SPEED),
    "a logarithm twice": (
        Piecewise((1 - LOW * cos(LOW), omega > 0.3), (SPEED, True)),
        Piecewise((1 - log(Max(omega, 0.1)) * cos(log(Max(omega, 0.1))), omega > 0.3), (SPEED, True)),
    ),
    "of the time": (
        Piecewise((log(t) + cos(log(t)), t > 0.3), (SPEED, True)),
        Piecewise((log(Max(t, 0.1)) + cos(log(Max(t, 0.1))), t > 0.3), (SPEED, True)),
    ),
    "a power that is not whole": (
        Piecewise((1 - (omega - 1) ** 0.3 * exp(-((omega - 1) ** 0.3)), omega > 9), (SPEED, True)),
        SPEED,
    ),
}


def train(tau: Expr, *parts: sw.Component) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("pull", tau=tau), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=100.0, d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=0.2), "b")
    for part in parts:
        net.add(part, "b")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy", "scipy-radau", "sundials"])
@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "with modes"])
@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_asked_for_the_branch_that_holds_alone(name: str, rubs: bool, engine: str) -> None:  # noqa: FBT001
    parts = (sw.CoulombLoad("friction", tau=0.05),) if rubs else ()
    found, wanted = (train(law, *parts).simulate(2.0, engine=engine, rtol=1e-9, t_eval=41) for law in LAWS[name])
    # two runs of an implicit engine at rtol 1e-9 differ by some hundred tolerances
    np.testing.assert_allclose(found["J1.omega"], wanted["J1.omega"], rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("part", [sw.Brake, sw.Clutch])
def test_a_condition_of_a_part_is_asked_for_the_branch_that_holds_alone(part: type[sw.Brake]) -> None:
    speeds = []
    for inside in (omega - 1, Max(omega - 1, 0.1)):
        net = train(5 * exp(-t))
        if part is sw.Clutch:
            net.add(sw.Inertia("J3", J=0.1), "c")
        nodes = ("b", "c") if part is sw.Clutch else ("b",)
        on = Piecewise((log(inside) + cos(log(inside)), omega > 2), (-1, True))
        net.add(part("shoe", tau=0.4, on=on), *nodes)
        speeds.append(net.simulate(2.0, rtol=1e-9, t_eval=41)["J1.omega"])
    np.testing.assert_allclose(speeds[0], speeds[1], rtol=0, atol=1e-7)  # 100 tolerances


@pytest.mark.parametrize("engine", ["auto", "scipy", "heyoka"])
@pytest.mark.parametrize("on", [log(omega - 1), 1 / omega - 0.5])
def test_a_part_whose_condition_has_no_value_at_the_start_is_refused(on: Expr, engine: str) -> None:
    with pytest.raises(sw.SimulationError, match=r"^At t = 0 s on = .* of Brake 'shoe' has no real value"):
        train(t, sw.Brake("shoe", tau=1.0, on=on)).simulate(1.0, engine=engine)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "part", "said"),
    [
        (Piecewise((-Abs(log(omega - 5)), omega > 5.5), (SPEED, True)), None, "tau = .* of TorqueSource 'pull'"),
        (Piecewise((2 * sqrt(t - 0.5), t > 0.5), (1, True)), None, "tau = .* of TorqueSource 'pull'"),
        (1 + t, sw.Brake("shoe", tau=Piecewise((9 * sqrt(1 - t), t < 1), (3, True))), "tau = .* of Brake 'shoe'"),
    ],
)
def test_heyoka_names_the_law_that_has_no_series_and_auto_does_without(
    law: Expr, part: sw.Component | None, said: str
) -> None:
    net = train(law, *([] if part is None else [part]))
    with pytest.raises(sw.SimulationError, match=rf"{said} has a value there.*engine='scipy'"):
        net.simulate(2.0, engine="heyoka")
    found, wanted = (net.simulate(2.0, engine=name, rtol=1e-9, t_eval=21) for name in ("auto", "scipy"))
    np.testing.assert_allclose(found["J1.omega"], wanted["J1.omega"], rtol=0, atol=1e-7)  # 100 tolerances
