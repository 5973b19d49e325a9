"""A law that has no real value in the course of a motion ends it with the part, the law and the time, in any engine."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
import sympy

import shaftwork as sw

ENGINES = ("auto", "heyoka", "scipy", "scipy-radau", "sundials")
ENDS = sympy.sqrt(1 - sw.t)
"""Has no real value from 1 s on."""


def wheel(*parts: sw.Component, J: float = 1.0) -> sw.Network:
    """Parts on the node of one inertia."""
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=J), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


def braked(pull: Any, **brake: Any) -> sw.Network:
    return wheel(sw.TorqueSource("pull", tau=pull), sw.Brake("brake", **brake))


KLOSS = {"tau_k": 10.0, "s_k": 0.2, "n_sync": 1500.0}
OF_TIME: dict[str, tuple[Callable[[], sw.Network], str]] = {
    "a source": (lambda: wheel(sw.TorqueSource("pull", tau=ENDS)), r"tau = sqrt\(1 - t\) of TorqueSource 'pull'"),
    "a logarithm": (lambda: wheel(sw.TorqueSource("pull", tau=sympy.log(1 - sw.t))), r"tau = log\(1 - t\) of Torque"),
    "a table": (
        lambda: wheel(sw.TorqueSource("pull", tau=sw.Table([0.0, 1.0], [1.0, 2.0])(ENDS))),
        r"tau = Table\(.* of TorqueSource 'pull'",
    ),
    "the larger of two": (
        lambda: wheel(sw.TorqueSource("pull", tau=1 + sympy.Max(0, ENDS - 5))),
        r"tau = Max\(0, sqrt\(1 - t\) - 5\) \+ 1 of TorqueSource 'pull'",
    ),
    "a brake that slips": (lambda: braked(20.0, tau=3 * ENDS), r"tau = 3\*sqrt\(1 - t\) of Brake 'brake'"),
    "one law of two": (lambda: braked(20.0, tau=3 * ENDS, on=1 + sw.t), r"tau = 3\*sqrt\(1 - t\) of Brake 'brake'"),
    "a brake that holds": (lambda: braked(0.5, tau=3 + 3 * ENDS), r"tau = 3\*sqrt\(1 - t\) \+ 3 of Brake 'brake'"),
    "what is held": (lambda: braked(0.1 * ENDS, tau=1.0), r"tau = 0.1\*sqrt\(1 - t\) of TorqueSource 'pull'"),
    "a condition": (lambda: braked(2.0, tau=1.0, on=ENDS - 5), r"on = sqrt\(1 - t\) - 5 of Brake 'brake'"),
    "a resistance": (
        lambda: wheel(sw.WoundRotorMotor("m", **KLOSS, resistance=2 + ENDS)),
        r"resistance = sqrt\(1 - t\) \+ 2 of WoundRotorMotor 'm'",
    ),
    "a power": (
        lambda: wheel(sw.FrequencyDrive("m", **KLOSS, f=50 - 50 * sw.t, slip_exponent=0.5)),
        r"f = 50 - 50\*t of FrequencyDrive 'm'",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", OF_TIME)
def test_a_law_of_time_is_named_when_it_loses_its_value(name: str, engine: str) -> None:
    """The time is that of the engine, which is 1 s to within what a step of it may miss."""
    make, said = OF_TIME[name]
    with pytest.raises(sw.SimulationError, match=rf"^At t = (1|1\.0000\d*|0\.9999\d*) s {said}.* has no real value"):
        make().simulate(3.0, engine=engine)


def lost(net: sw.Network, engine: str = "auto", **options: Any) -> tuple[float, str]:
    """The time and the law of the error that a run ends in."""
    with pytest.raises(sw.SimulationError) as caught:
        net.simulate(3.0, engine=engine, **options)
    found = re.match(r"At t = (\S+) s (.*) has no real value\.", str(caught.value))
    assert found is not None, caught.value
    return float(found[1]), found[2]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_law_of_the_speed_is_named_when_the_motion_leaves_it(engine: str) -> None:
    """w' = sqrt(1 - w) + 1/2 brings w to 1 at 2 - ln 3; CVODE finds the edge to its tolerance, as it has no slope."""
    net = wheel(sw.TorqueSource("pull", tau=sympy.sqrt(1 - sw.omega) + 0.5))
    t, law = lost(net, engine)
    assert law == "tau = sqrt(1 - omega) + 0.5 of TorqueSource 'pull'"
    assert t == pytest.approx(2 - math.log(3.0), abs=1e-5)


CONDITIONS = {
    "sqrt": sympy.sqrt(1 - sw.omega) - 5,
    "Piecewise": sympy.Piecewise((-sw.omega - 1, sw.omega < 1), (sympy.sqrt(-sw.omega), True)),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", CONDITIONS)
def test_a_condition_that_is_neither_true_nor_false_is_named(name: str, engine: str) -> None:
    """It moves no state: an engine meets it where it looks, some time after 0.5 s, when 2 t passes 1."""
    t, law = lost(braked(2.0, tau=1.0, on=CONDITIONS[name]), engine)
    assert law.startswith(f"on = {name}(")
    assert law.endswith("of Brake 'brake'")
    assert t > 0.5 - 1e-9


def test_a_prescribed_speed_is_named_though_no_state_moves() -> None:
    net = wheel(sw.SpeedSource("drive", omega=ENDS))
    t, law = lost(net, t_eval=301)
    assert law == "omega = sqrt(1 - t) of SpeedSource 'drive'"
    assert t == pytest.approx(1.01)  # the first output past 1 s


def test_a_law_beside_travelling_waves_is_named() -> None:
    """In the panel, a part of the 3 ms that a wave takes."""
    net = wheel(sw.TorqueSource("pull", tau=ENDS))
    shaft = sw.Shaft("line", length=10.0, diameter=0.2, density=7850.0, shear_modulus=8e10, model=sw.Wave())
    net.add(shaft, "wheel", "end")
    net.add(sw.Inertia("J2", J=1.0), "end")
    t, law = lost(net)
    assert law == "tau = sqrt(1 - t) of TorqueSource 'pull'"
    assert t == pytest.approx(1.0, abs=3e-3)


@pytest.mark.slow
def test_a_law_in_an_algebraic_loop_is_named() -> None:
    pytest.importorskip("sksundae")
    net = wheel(sw.Inertia("J2", J=1.0))
    net.add(sw.Damper("slip", d=1.0), "wheel", "bare")
    net.add(sw.TorqueSource("drag", tau=-sw.omega * sympy.Abs(sw.omega)), "bare")
    net.add(sw.TorqueSource("pull", tau=ENDS), "bare")
    t, law = lost(net, algebraic_loops="solve")
    assert law == "tau = sqrt(1 - t) of TorqueSource 'pull'"
    assert t == pytest.approx(1.0, abs=1e-3)


def test_a_law_whose_value_is_lost_where_it_is_not_asked_is_none_the_worse() -> None:
    """0.2 rad/s^2 from 0.9 rad/s on, past the speed at which the root has no value."""
    law = sympy.Piecewise((sympy.sqrt(1 - sw.omega), sw.omega < 0.9), (0.2, True))
    found = wheel(sw.TorqueSource("pull", tau=law)).simulate(3.0, rtol=1e-10)["J.omega"][-1]
    until = 2 * (1 - math.sqrt(0.1))
    assert found == pytest.approx(0.9 + 0.2 * (3.0 - until), rel=1e-8)


def test_what_is_read_of_a_motion_without_its_law_is_refused() -> None:
    """A prescribed speed moves no state here, so that the run itself does not need it."""
    net = wheel(sw.TorqueSource("pull", tau=1.0))
    net.add(sw.SpeedSource("drive", omega=ENDS), "other")
    net.add(sw.Inertia("J2", J=1.0), "other")
    sol = net.simulate(3.0)
    assert sol["J.omega"][-1] == pytest.approx(3.0)
    with pytest.raises(sw.SimulationError, match=r"omega = sqrt\(1 - t\) of SpeedSource 'drive' has no real value"):
        _ = sol["J2.omega"]


READERS: dict[str, Callable[[sw.Solution], Any]] = {
    "values": lambda sol: sol["pull.tau"],
    "energy": lambda sol: sol.energy,
    "maximum": lambda sol: sol.max("pull.tau"),
}


@pytest.mark.parametrize("name", READERS)
def test_a_torque_at_a_pole_beside_a_prescribed_speed_is_named(name: str) -> None:
    """No state moves by it, so the run knows nothing of it; 1 / (t - 1) is infinite at t = 1."""
    net = wheel(sw.TorqueSource("free", tau=1.0))
    net.add(sw.TorqueSource("pull", tau=1 / (sw.t - 1)), "other")
    net.add(sw.SpeedSource("drive", omega=1.0), "other")
    sol = net.simulate(2.0, t_eval=5)
    assert sol["J.omega"][-1] == pytest.approx(2.0)
    with pytest.raises(sw.SimulationError, match=r"At t = 1 s tau = 1/\(t - 1\) of TorqueSource 'pull' has no real"):
        READERS[name](sol)


@pytest.mark.parametrize("engine", ["heyoka", "scipy"])
def test_a_motion_into_a_pole_ends_in_an_error_and_goes_through_by_no_engine(engine: str) -> None:
    """J phi'' = 10 - d phi' + 0.001 / (phi - 5) climbs to the pole at phi = 5, and no number lies beyond its wall.

    Without the pole phi = 10 (t - 1 + e^-t) comes to 5 where t + e^-t = 1.5, at t = 1.1983 s.
    """
    net = wheel(sw.TorqueSource("pull", tau=10 + 0.001 / (sw.phi - 5)), sw.Damper("d", d=1.0))
    with pytest.raises(
        sw.SimulationError, match=r"failed at t = 1\.198.*(spacing of|spacing between) numbers.*J\.omega"
    ):
        net.simulate(10.0, engine=engine)
