"""Sources of voltage whose law reads their own current and charge: mirror images of torques over speed and angle."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.codegen.compiled_model import CompiledModel


def train() -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=60 - 2 * sw.omega - 0.01 * sw.omega**3), "a")
    net.add(sw.TorqueSource("weight", tau=-3 * sympy.sin(sw.phi)), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    return net


def series() -> sw.Network:
    """The dual of it, typed by hand."""
    net = sw.Network("series")
    net.add(sw.VoltageSource("motor", u=60 - 2 * sw.i - 0.01 * sw.i**3), "p", "ground")
    net.add(sw.VoltageSource("weight", u=-3 * sympy.sin(sw.q)), "r", "p")
    net.add(sw.Inductor("J", L=2.0), "r", "ground")
    return net


@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
def test_a_current_over_voltage_moves_as_a_speed_over_torque(engine: str) -> None:
    wanted, found = (
        net.simulate(3.0, rtol=1e-10, engine=engine, t_eval=31, initial=start)
        for net, start in ((train(), {"weight.phi": 0.5}), (series(), {"weight.q": 0.5}))
    )
    for name, other in (
        ("J.omega", "J.i"),
        ("motor.tau", "motor.u"),
        ("weight.phi", "weight.q"),
        ("weight.power", "weight.power"),
    ):
        # engines are asked for 1e-10 a step, over some hundreds of steps
        np.testing.assert_allclose(found[other], wanted[name], rtol=0, atol=1e-8 * np.abs(wanted[name]).max())
    assert found.energy_residual < 1e-8


def test_scalar_and_array_code_agree_and_the_jacobian_is_that_of_differences() -> None:
    model: CompiledModel = series().compile()
    assert model.scalar is not None
    dice = np.random.default_rng(3)
    for _ in range(5):
        x, step = dice.normal(size=len(model.states)), 1e-6
        np.testing.assert_allclose(model.rhs(0.0, x), model.bind().rhs(0.0, x), rtol=1e-12, atol=1e-12)
        slopes = [
            (model.rhs(0.0, x + step * unit) - model.rhs(0.0, x - step * unit)) / (2 * step) for unit in np.eye(len(x))
        ]
        # central differences of rates up to 1e2 leave 1e2 * 1e-16 / 1e-6 and the third derivative times 1e-12
        np.testing.assert_allclose(model.jacobian(0.0, x).toarray(), np.array(slopes).T, rtol=1e-6, atol=1e-7)


def test_small_motions_about_a_current_are_those_about_a_speed() -> None:
    train, circuit = sw.Network("train"), sw.Network("circuit")
    train.add(sw.TorqueSource("motor", tau=60 - 2 * sw.omega - 0.01 * sw.omega**3), "a")
    train.add(sw.Inertia("J", J=2.0), "a")
    circuit.add(sw.VoltageSource("motor", u=60 - 2 * sw.i - 0.01 * sw.i**3), "p", "ground")
    circuit.add(sw.Inductor("J", L=2.0), "p", "ground")
    slopes = [net.compile().linearize(at={f"J.{name}": 7.0}).A for net, name in ((train, "omega"), (circuit, "i"))]
    np.testing.assert_allclose(slopes[1], slopes[0], rtol=1e-12)


def test_a_charge_is_counted_beside_resistors() -> None:
    """A diode-like source over its charge, in a loop without an inductor: q' = (10 - q) / R."""
    net = sw.Network("charge")
    net.add(sw.VoltageSource("store", u=10 - sw.q), "p", "ground")
    net.add(sw.Resistor("R", R=2.0), "p", "ground")
    sol = net.simulate(3.0, rtol=1e-10, t_eval=31)
    np.testing.assert_allclose(sol["store.q"], 10 * (1 - np.exp(-sol.t / 2)), rtol=0, atol=1e-8)


def test_a_current_that_is_no_state_cannot_be_read() -> None:
    net = sw.Network("no coil")
    net.add(sw.VoltageSource("battery", u=12 - sw.i**3), "p", "ground")
    net.add(sw.Resistor("lamp", R=2.0), "p", "ground")
    with pytest.raises(sw.NetworkError, match=r"VoltageSource 'battery' reads a current that Resistor 'lamp' decides"):
        net.compile()


def test_equations_print_the_current_that_a_law_reads() -> None:
    text = str(series().equations())
    assert "law p: motor.u = -0.01*motor.i**3 - 2*motor.i + 60" in text
    assert "weight.i_counted = -weight.i" in text


@pytest.mark.parametrize("part", [sw.CurrentSource("part", i=sw.i), sw.TorqueSource("part", tau=sw.q)])
def test_other_parts_read_no_current_and_no_charge(part: sw.Component) -> None:
    net = sw.Network("other")
    net.add(part, "a", *("ground",) * (len(part.ports) - 1))
    with pytest.raises(sw.NetworkError, match=r"reads [iq], which belongs to another"):
        net.compile()
