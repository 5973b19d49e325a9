"""Linear networks under smooth inputs on the exact engine."""

from __future__ import annotations

import tracemalloc

import mpmath
import numpy as np
import pytest
import sympy
from scipy.special import ive

import shaftwork as sw
from shaftwork.integrate.linear.linear_system import phi

t = sw.t
SMOOTH = [
    sympy.sin(62.5 * t),
    sympy.exp(-3 * t) * sympy.cos(300 * t),
    sympy.sin(30 * t**2),
    t**17,
    sympy.tanh(50 * t - 25),
    1 / (1 + 100 * (t - sympy.Rational(1, 2)) ** 2),
    sympy.Piecewise((sympy.sin(10 * t), t < 0.3), (sympy.cos(40 * t), True)),
]


def chain(law: object) -> sw.Network:
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=law), "a")
    net.add(sw.Inertia("J1", J=0.3), "a")
    net.add(sw.Spring("s1", c=900.0, d=0.2), "a", "b")
    net.add(sw.Inertia("J2", J=0.7), "b")
    net.add(sw.Spring("s2", c=9e4, d=0.2), "b", "c")
    net.add(sw.Inertia("J3", J=0.07), "c")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("law", SMOOTH, ids=str)
def test_smooth_inputs_are_followed_to_rounding(law: object) -> None:
    """Against DOP853 at its tightest tolerance, whose own error is some 1e-9 of the stiff spring's torque."""
    model = chain(law).compile()
    sol = model.simulate(1.0)
    reference = model.simulate(1.0, engine="scipy", rtol=3e-14)
    assert sol.engine == "exact"
    assert sol.energy_residual < 2e-12
    for name in ("J1.omega", "s1.tau", "s2.tau"):
        np.testing.assert_allclose(sol[name], reference[name], atol=3e-9 * np.abs(reference[name]).max())


def test_a_resonance_grows_as_its_closed_form() -> None:
    """J omega' = T - tau, tau' = c omega under T = sin(w t) with w = sqrt(c / J): omega = t sin(w t) / (2 J)."""
    net = sw.Network("resonance")
    net.add(sw.TorqueSource("motor", tau=sympy.sin(20 * t)), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("s", c=800.0), "a", "ground")
    sol = net.simulate(100.0, engine="exact")
    expected = sol.t * np.sin(20 * sol.t) / 4
    # the phase 20 t is rounded at 2000 rad, and so is its part in the input
    np.testing.assert_allclose(sol["J.omega"], expected, atol=1e-11 * 25)


def test_between_the_outputs_it_is_as_right() -> None:
    sol = chain(SMOOTH[0]).simulate(1.0, t_eval=3)
    fine = chain(SMOOTH[0]).simulate(1.0, t_eval=997)
    times = fine.t[1:-1]
    np.testing.assert_allclose(sol.at(times)["s1.tau"], fine["s1.tau"][1:-1], atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.1, 0.02, 0.003])
def test_no_blow_of_a_train_of_them_is_overlooked(width: float) -> None:
    """100 N m and ten blows of 500 exp(-(sin(pi (t - 0.3)) / w)^2): its mean is exp(-1 / 2 w^2) I0(1 / 2 w^2)."""
    net = sw.Network("hammer mill")
    blow = sympy.exp(-((sympy.sin(sympy.pi * (t - sympy.Rational(3, 10))) / width) ** 2))
    net.add(sw.TorqueSource("motor", tau=100 + 500 * blow), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("s", c=1e4, d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    sol = net.simulate(10.0)
    assert sol.engine == "exact"
    momentum = 2 * sol["J1.omega"][-1] + 3 * sol["J2.omega"][-1]
    assert momentum == pytest.approx(1000 + 5000 * ive(0, 0.5 / width**2), rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("outputs", [2, 1001])
def test_the_largest_value_of_an_input_does_not_hang_on_the_output_times(outputs: int) -> None:
    law = 100 + 500 * sympy.sin(sympy.pi * (t - sympy.Rational(3, 10))) ** 20000
    assert chain(law).simulate(10.0, t_eval=outputs).max("motor.tau") == pytest.approx(600.0, rel=1e-6)


def test_runs_to_other_ends_do_not_pile_up_what_they_have_made_of_the_inputs() -> None:
    model = chain(sympy.sin(300 * t)).compile()
    model.simulate(1.0)
    tracemalloc.start()
    for end in (1.1, 1.2, 1.3, 1.4):
        model.simulate(end)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < 1.5e6  # of each 1.1 MB


def test_phi_functions_are_right_on_both_sides_of_their_series() -> None:
    """Against 60 digits, on the left half plane, where decaying and lossless modes lie."""
    rng = np.random.default_rng(1)
    z = 10 ** rng.uniform(-5, 2.5, 40) * np.exp(1j * rng.uniform(np.pi / 2, np.pi, 40))
    found = phi(z, np.exp(z), 9)
    with mpmath.workdps(60):
        for column, value in enumerate(z):
            exact = mpmath.mpc(complex(value))
            row = mpmath.exp(exact)
            for k in range(1, 10):
                row = (row - 1 / mpmath.factorial(k - 1)) / exact
                assert abs(complex(row) - found[k - 1, column]) < 1e-13 * abs(complex(row))
