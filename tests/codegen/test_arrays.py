"""The array program: matrices of known networks, many times at once, impulses, values that have no solution."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw


def _model(*placed: tuple[sw.Component, tuple[str, ...]]) -> sw.Model:
    net = sw.Network("by hand")
    for part, nodes in placed:
        net.add(part, *nodes)
    return net.compile()


def _drive(tau: object = 5.0) -> sw.Model:
    return _model(
        (sw.TorqueSource("motor", tau=tau), ("a",)),
        (sw.Inertia("J1", J=2.0), ("a",)),
        (sw.Spring("shaft", c=10.0, d=0.5), ("a", "b")),
        (sw.Inertia("J2", J=4.0), ("b",)),
        (sw.CoulombLoad("load", tau=3.0, omega_s=0.2), ("b",)),
    )


def test_the_linear_part_holds_the_coefficients_of_the_two_mass_drive() -> None:
    part = _drive().bind().part
    wanted = [[-0.5 / 2, 0.5 / 2, -1 / 2], [0.5 / 4, -0.5 / 4, 1 / 4], [10.0, -10.0, 0.0]]
    np.testing.assert_allclose(part.A.toarray(), wanted, rtol=1e-15)
    np.testing.assert_allclose(np.sort(part.B.toarray().sum(axis=1)), np.sort([-1 / 2, -1 / 4, 0.0]), rtol=1e-15)


def test_a_parameter_vector_changes_the_numbers_alone() -> None:
    model = _drive()
    p = model.vector({"shaft.c": 40.0, "J1.J": 1.0})
    assert model.bind(p).part.A.toarray()[2, 0] == 40.0
    assert model.bind(p).part.A.toarray()[0, 2] == -1.0
    assert model.bind().part.A.toarray()[2, 0] == 10.0


def test_many_times_at_once_give_the_same_rates_as_one_by_one() -> None:
    """Rounding alone may differ: numpy sums products of one vector and of a matrix in another order."""
    bound = _drive(5.0 * sympy.sin(3 * sw.t) - sw.omega**3 + sw.phi).bind()
    dice = np.random.default_rng(1)
    times, x = dice.uniform(size=7), dice.normal(size=(4, 7))
    singly = np.column_stack([bound.rhs(float(t), x[:, k]) for k, t in enumerate(times)])
    np.testing.assert_allclose(bound.rhs(times, x), singly, rtol=1e-13, atol=1e-13)


def test_the_jacobian_holds_the_slope_of_a_law_at_the_state() -> None:
    """d(-3 tanh(w / 0.2)) / dw = -15 (1 - tanh^2) over J2 = 4."""
    slope = _drive().jacobian(0.0, np.array([0.3, 0.1, 2.0])).toarray()[1, 1]
    assert slope == pytest.approx(-0.5 / 4 - 15.0 * (1 - np.tanh(0.5) ** 2) / 4, rel=1e-14)


def test_a_jump_of_a_prescribed_speed_moves_what_is_rigidly_joined_at_once() -> None:
    """omega_sun + 2 omega_ring = 3 omega_carrier holds from the first instant, and no momentum is lost."""
    model = _model(
        (sw.SpeedSource("drive", omega=6.0), ("sun",)),
        (sw.PlanetaryGear("set", ratio=2.0), ("sun", "carrier", "ring")),
        (sw.Inertia("Jc", J=1.0), ("carrier",)),
        (sw.Inertia("Jr", J=1.0), ("ring",)),
    )
    assert len(model.states) == 1
    sol = model.simulate(0.1)
    # the impulse of the gear acts with -3 on the carrier and with 2 on the ring
    np.testing.assert_allclose(sol["Jc.omega"] / sol["Jr.omega"], -3.0 / 2.0, rtol=1e-12)
    np.testing.assert_allclose(6.0 + 2.0 * sol["Jr.omega"], 3.0 * sol["Jc.omega"], rtol=1e-12)


def test_a_circuit_in_which_conductances_cancel_is_named() -> None:
    """A torque source of 2 N m s/rad times its own speed against a damper of 2: no torque answers a speed there."""
    net = sw.Network("cancelling")
    net.add(sw.TorqueSource("push", tau=2.0 * sw.omega), "m")
    net.add(sw.Damper("bearing", d=2.0), "m")
    net.add(sw.Spring("shaft", c=1.0), "m", "r")
    net.add(sw.Inertia("J", J=1.0), "r")
    with pytest.raises(sw.NetworkError, match=r"cancel(.|\n)*'m'"):
        net.compile()


def test_values_that_cancel_only_after_a_change_are_named_as_well() -> None:
    net = sw.Network("cancelling")
    net.add(sw.TorqueSource("push", tau=2.0 * sw.omega), "m")
    net.add(sw.Damper("bearing", d=3.0), "m")
    net.add(sw.Spring("shaft", c=1.0), "m", "r")
    net.add(sw.Inertia("J", J=1.0), "r")
    model = net.compile()
    with pytest.raises(sw.ShaftworkError, match=r"bearing|push"):
        model.simulate(1.0, parameters={"bearing.d": 2.0})
