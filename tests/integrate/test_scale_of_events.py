"""What ends a step of a Taylor series may be large, and neither the motion nor the times of events suffer from it."""

import math

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq
from scipy.special import ive

import shaftwork as sw

pytestmark = pytest.mark.heyoka

# Limits are met where they are beyond zero by more than rounding moves them, here within 2e-10 s.
EVENT = 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e-3], ids=["torques of 7 N m", "torques of 7 mN m"])
@pytest.mark.parametrize("asked", [{"rtol": 1e-9}, {"rtol": 1e-9, "t_eval": 5001}, {"rtol": 1e-13}], ids=str)
def test_a_slow_ramp_breaks_a_friction_away_on_time_whatever_is_asked_for(size: float, asked: dict[str, float]) -> None:
    net = sw.Network("breakaway")
    net.add(sw.Inertia("J", J=0.7 * size), "a")
    net.add(sw.DryFriction("friction", tau_c=3.0 * size, tau_s=7.3 * size, omega_s=0.2), "a")
    net.add(sw.TorqueSource("T", tau=size * (sw.Ramp(7.5, duration=1e4) + sympy.sin(0.3 * sw.t) / 1000)), "a")
    expected = brentq(lambda t: 7.5e-4 * t + 1e-3 * math.sin(0.3 * t) - 7.3, 9700.0, 9750.0, xtol=1e-12)
    assert net.simulate(9800.0, engine="heyoka", **asked).events[0][0] == pytest.approx(expected, rel=0, abs=EVENT)


@pytest.mark.slow
@pytest.mark.parametrize("asked", [{"rtol": 1e-9}, {"rtol": 1e-9, "t_eval": 5001}], ids=str)
def test_a_brake_that_fades_slowly_slips_on_time_and_as_often_as_with_another_engine(asked: dict[str, float]) -> None:
    net = sw.Network("brake")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=5 * sympy.exp(-sw.t / 2000) + sympy.sin(3 * sw.t) / 1000), "a")
    net.add(sw.TorqueSource("T", tau=0.4), "a")
    expected = brentq(lambda t: 0.4 - 5 * math.exp(-t / 2000) - 1e-3 * math.sin(3 * t), 5046.6, 5046.9, xtol=1e-12)
    sol = net.simulate(5100.0, engine="heyoka", **asked)
    other = net.simulate(5100.0, engine="scipy")
    assert sol.events[0][0] == pytest.approx(expected, rel=0, abs=EVENT)
    assert [event[1:] for event in sol.events] == [event[1:] for event in other.events]


# The speeds of 500 rad/s are right to 1e-8; what they leave open in the spring's 0.7 N m is 1e-6, and the run says so.
@pytest.mark.filterwarnings("ignore:the engine 'heyoka' is off by 1e-06:shaftwork.AccuracyWarning")
def test_the_end_of_a_ramp_costs_no_digits_of_a_long_motion() -> None:
    net = sw.Network("long ramp")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("c", c=1.0), "a", "b")
    net.add(sw.Inertia("K", J=2.0), "b")
    net.add(sw.TorqueSource("T", tau=sw.Ramp(1.0, duration=9e3)), "a")
    found, exact = (net.simulate(1e4, engine=engine, t_eval=11)["J.omega"] for engine in ("heyoka", "exact"))
    # the tolerance of 1e-10 for each of some thousand steps, which an undamped motion keeps
    assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()


PULSES = {
    "bell": (lambda x: sympy.exp(-(x**2)), lambda x: math.sqrt(math.pi) * math.erf(x) / 2),
    "fraction": (lambda x: 1 / (1 + x**2) ** 2, lambda x: (math.atan(x) + x / (1 + x**2)) / 2),
    "power": (
        lambda x: 2 ** -(x**2),
        lambda x: math.sqrt(math.pi / math.log(2)) * math.erf(x * math.sqrt(math.log(2))) / 2,
    ),
    "edges": (lambda x: (sympy.tanh(x + 1) - sympy.tanh(x - 1)) / 2, lambda x: _softplus(x + 1) - _softplus(x - 1)),
}
"""Pulses of width one, and their integrals."""


def _softplus(x: float) -> float:
    """Half the logarithm of cosh x, but for a constant."""
    return (abs(x) + math.log1p(math.exp(-2 * abs(x)))) / 2


@pytest.mark.slow
@pytest.mark.parametrize("pulse", PULSES)
@pytest.mark.parametrize("width", [1.0, 1e-4], ids=lambda width: f"{width:g} s wide")
@pytest.mark.parametrize(
    "middle", [pytest.param(5.0, marks=pytest.mark.slow), 3333.3], ids=lambda middle: f"at {middle:g} s"
)
@pytest.mark.parametrize(
    "engine", ["auto", *(pytest.param(name, marks=pytest.mark.slow) for name in ("heyoka", "scipy", "sundials"))]
)
def test_a_pulse_of_torque_gives_its_impulse_however_far_away_it_is(
    width: float, middle: float, pulse: str, engine: str
) -> None:
    shape, integral = PULSES[pulse]
    net = sw.Network("pulse")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=shape((sw.t - middle) / width) / width), "a")
    sol = net.simulate(1e4, engine=engine, rtol=1e-9, t_eval=2)
    impulse = integral((1e4 - middle) / width) - integral(-middle / width)
    # the time itself is rounded to 1e-12 s, a part of 1e-8 of the narrowest pulse; steps add 1e-10 each, of CVODE more
    assert sol["J.omega"][-1] == pytest.approx(impulse, rel=3e-7 if engine == "sundials" else 3e-8)


@pytest.mark.slow
def test_a_pulse_beside_a_friction_is_not_stepped_over_either() -> None:
    """The friction takes 0.1 N m off a pulse of 20 N m that is 0.01 s wide; scipy stepped over it."""
    net = sw.Network("pulse and friction")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.DryFriction("friction", tau_c=0.1), "a")
    net.add(sw.TorqueSource("T", tau=20 / (1 + ((sw.t - 50.0) / 0.01) ** 2) ** 2), "a")
    peaks = [net.simulate(100.0, engine=engine).max("J.omega") for engine in ("heyoka", "scipy", "sundials")]
    assert 0.3 < peaks[0] < 0.1 * math.pi
    assert peaks[1:] == pytest.approx([peaks[0]] * 2, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize("wave", [sympy.sin, sympy.cos])
def test_no_blow_of_a_train_is_stepped_over(wave: type[sympy.Expr], engine: str) -> None:
    """Blows of exp(-(sin(pi (t - 0.3)) / w)^2), whose mean is exp(-1 / 2 w^2) I0(1 / 2 w^2), beside a friction."""
    width = 0.02
    net = sw.Network("hammer mill")
    net.add(sw.Inertia("J", J=20.0), "a")
    net.add(sw.DryFriction("friction", tau_c=40.0), "a")
    blow = sympy.exp(-((wave(sympy.pi * (sw.t - sympy.Rational(3, 10))) / width) ** 2))
    net.add(sw.TorqueSource("T", tau=100 + 500 * blow), "a")
    sol = net.simulate(30.0, engine=engine, rtol=1e-9)
    momentum = 30 * (100 - 40 + 500 * ive(0, 0.5 / width**2))
    assert 20 * sol["J.omega"][-1] == pytest.approx(momentum, rel=1e-5)


BLOWS = {
    "power of a wave": (sympy.sin(sympy.pi * sw.t) ** 20000, 4.0),
    "root inside exp": (sympy.exp(1 - sympy.sqrt(1 + ((sw.t - 3.3) / 1e-3) ** 2)), 10.0),
    "blow that shifts": (sympy.exp(-(((sw.t - 3.3 + 1e-4 * sympy.atan(sw.t)) / 2e-3) ** 2)), 10.0),
}
"""Laws of time with narrow blows that no formula places, and how long they run in s."""


@pytest.mark.slow
@pytest.mark.parametrize("blows", BLOWS)
@pytest.mark.parametrize(
    "engine",
    ["auto", *(pytest.param(name, marks=pytest.mark.slow) for name in ("scipy", "scipy-radau", "sundials"))],
)
def test_no_blow_of_a_law_without_a_name_is_stepped_over(blows: str, engine: str) -> None:
    """Beside a friction of 0.1 N m, blows that give ten times the momentum of the rest; up to nine tenths were lost."""
    shape, end = BLOWS[blows]
    grid = np.linspace(0.0, end, 2_000_001)
    blow = np.trapezoid(sympy.lambdify(sw.t, shape)(grid), grid)  # 500 points and more for each blow: exact for bells
    net = sw.Network("press")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.DryFriction("friction", tau_c=0.1), "a")
    net.add(sw.TorqueSource("T", tau=0.2 + end / blow * shape), "a")
    sol = net.simulate(end, engine=engine, rtol=1e-9, t_eval=2)
    # the tolerance of steps adds up; one that passed a part of a blow would show as 1e-2 and more
    assert sol["J.omega"][-1] == pytest.approx(1.1 * end, rel=3e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine", ["heyoka", *(pytest.param(name, marks=pytest.mark.slow) for name in ("scipy", "sundials"))]
)
def test_no_reversal_of_a_smooth_square_wave_is_stepped_over(engine: str) -> None:
    net = sw.Network("reversing drive")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=10 * sympy.tanh(300 * sympy.sin(2 * sympy.pi * (sw.t - 0.3)))), "a")
    sol = net.simulate(20.3, engine=engine, rtol=1e-9, t_eval=2)
    assert sol["J.omega"][-1] == pytest.approx(-3.0, rel=1e-2)  # 0.3 s backwards, then whole turns
    assert sol.max("J.omega") < 2.1


@pytest.mark.slow
def test_a_motion_long_after_a_pulse_is_as_exact_as_before_it() -> None:
    net = sw.Network("after a pulse")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("c", c=1.0), "a", "b")
    net.add(sw.Inertia("K", J=2.0), "b")
    net.add(sw.TorqueSource("T", tau=sympy.exp(-(((sw.t - 5.0) / 0.3) ** 2))), "a")
    sol = net.simulate(1e4, engine="heyoka", rtol=1e-9, t_eval=11)
    # sqrt(pi) 0.3 e^(-(0.3 omega)^2 / 4) is the pulse at the frequency omega; the steps before it add nothing
    omega, impulse = math.sqrt(1.5), math.sqrt(math.pi) * 0.3
    swing = impulse * math.exp(-((0.3 * omega) ** 2) / 4) * np.cos(omega * (sol.t[1:] - 5.0))
    assert np.abs(sol["J.omega"][1:] - (impulse + 2 * swing) / 3).max() < 1e-7
