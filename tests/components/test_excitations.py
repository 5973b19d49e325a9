"""Harmonic torques: their orders, their law by the angle, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import shaftwork as sw

HARMONICS = sw.Harmonics((0.5, 1.0, 2.5), (30.0, 20.0, 10.0), (0.3, -0.4, 2.0))


def torque_at(part: sw.HarmonicTorque, angle: float, speed: float) -> float:
    """The torque that a part gives in a network, at an angle and a speed."""
    net = sw.Network("one")
    net.add(part, "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    motion = net.simulate(1e-9, initial={f"{part.name}.phi": angle, "J.omega": speed}, angles=[part.name], t_eval=2)
    return float(motion[f"{part.name}.tau"][0])


@pytest.mark.parametrize("angle", [0.0, 1.0, -4.0, 30.0])
def test_the_torque_is_the_sum_of_its_orders_at_the_angle(angle: float) -> None:
    part = sw.HarmonicTorque("h", harmonics=HARMONICS, mean=5.0, firing_angle=0.7, scale=0.5)
    expected = 5.0 + 0.5 * sum(
        a * math.cos(k * (angle - 0.7) + psi)
        for k, a, psi in zip(HARMONICS.orders, HARMONICS.amplitudes, HARMONICS.phases, strict=True)
    )
    assert torque_at(part, angle, 3.0) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("speed", [0.0, 10.0, 15.0, 20.0, 30.0, -15.0])
def test_between_its_speeds_a_table_of_harmonics_is_linear_in_cosine_and_sine(speed: float) -> None:
    table = sw.Harmonics((1.0, 2.0), ((10.0, 4.0), (20.0, 6.0)), ((0.0, 3.0), (1.0, -3.0)), speeds=(10.0, 20.0))
    share = min(max(abs(speed) / 10 - 1, 0.0), 1.0)
    first, last = (
        [a * np.exp(1j * p) for a, p in zip(*row, strict=True)]
        for row in zip(table.amplitudes, table.phases, strict=True)
    )
    expected = (1 - share) * np.array(first) + share * np.array(last)
    assert table.at(speed) == pytest.approx(expected)
    assert table.at([speed, speed]).shape == (2, 2)
    part = sw.HarmonicTorque("h", harmonics=table)
    angle = 0.6
    assert torque_at(part, angle, speed) == pytest.approx(
        float((expected * np.exp(1j * angle * np.array([1.0, 2.0]))).real.sum()), rel=1e-7, abs=1e-7
    )


def test_a_propeller_swings_as_the_square_of_the_speed() -> None:
    blades = sw.Harmonics.propeller(4, 1000.0, 10.0, shares=(0.05, 0.02))
    assert blades.orders == (4.0, 8.0)
    assert blades.at(5.0) == pytest.approx([12.5, 5.0])
    assert torque_at(sw.HarmonicTorque("p", harmonics=blades), 0.0, 5.0) == pytest.approx(17.5, rel=1e-7)


def test_gas_force_coefficients_act_on_the_piston_at_the_crank() -> None:
    gas = sw.Harmonics.gas_force((0.5, 1.0), (3e5, 0.0), (4e5, 2e5), bore=0.2, stroke=0.3)
    lever = math.pi / 4 * 0.2**2 * 0.15
    assert np.abs(gas.at(0.0)) == pytest.approx([5e5 * lever, 2e5 * lever])
    phi = 0.9
    expected = lever * (3e5 * math.cos(0.5 * phi) + 4e5 * math.sin(0.5 * phi) + 2e5 * math.sin(phi))
    assert float(gas.torque(sympy.Float(phi), sympy.Float(0))) == pytest.approx(expected)


def test_reciprocating_masses_take_the_torque_that_their_kinetic_energy_asks_for() -> None:
    """At a steady speed the torque is -d/dphi of m x'(phi)^2 omega^2 / 2, with the exact slope x' of the mechanism."""
    m, stroke, rod = 3.0, 0.2, 0.38
    phi, r = sympy.Symbol("phi", real=True), sympy.Rational(1, 10)
    way = r * sympy.cos(phi) + sympy.sqrt(sympy.Float(rod) ** 2 - r**2 * sympy.sin(phi) ** 2)
    exact = sympy.lambdify(phi, -(m * sympy.diff(way, phi) ** 2 / 2).diff(phi))
    harmonics = sw.Harmonics.reciprocating(m, stroke=stroke, rod=rod)
    angles = np.linspace(0.0, 2 * math.pi, 17)
    parts = harmonics.at(7.0)
    ours = (parts * np.exp(1j * np.multiply.outer(angles, harmonics.orders))).real.sum(axis=1)
    # orders below 1e-6 of the largest are left out
    assert ours == pytest.approx(49.0 * exact(angles), abs=1e-5 * 49.0 * float(np.abs(exact(angles)).max()))


def test_cylinders_fire_in_their_order_evenly_over_a_cycle() -> None:
    assert sw.HarmonicTorque.firing_angles((1, 3, 4, 2)) == pytest.approx((0.0, 3 * math.pi, math.pi, 2 * math.pi))
    assert sw.HarmonicTorque.firing_angles((1, 2, 3), turns=1) == pytest.approx((0.0, 2 * math.pi / 3, 4 * math.pi / 3))
    for order, turns in (((1, 2, 4), 2), ("123", 2), ((), 2), ((1, 2), 3)):
        with pytest.raises(sw.ParameterError, match=r"must name each|of a cycle"):
            sw.HarmonicTorque.firing_angles(order, turns)  # type: ignore[arg-type]


def test_a_part_without_swing_reads_no_angle() -> None:
    net = sw.Network("quiet")
    net.add(sw.HarmonicTorque("h", harmonics=HARMONICS, mean=2.0, scale=0.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    assert net.compile().states == ("J.omega",)


def test_a_network_with_harmonics_comes_back_from_its_text(tmp_path) -> None:  # type: ignore[no-untyped-def]
    net = sw.scenes.ship_engine()
    net.save(tmp_path / "ship.toml")
    assert sw.Network.load(tmp_path / "ship.toml") == net


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"orders": (1, 1), "amplitudes": (1, 2)}, "different numbers above 0"),
        ({"orders": (-1,), "amplitudes": (1,)}, "different numbers above 0"),
        ({"orders": (1, 2), "amplitudes": (1,)}, r"amplitudes has the shape \(1,\), and there are 2 orders"),
        ({"orders": (1,), "amplitudes": ("x",)}, "must be a list of finite numbers, in N"),
        ({"orders": (1,), "amplitudes": (math.nan,)}, "must be a list of finite numbers"),
        ({"orders": (1,), "amplitudes": ((1,), (2,)), "speeds": (2.0, 1.0)}, "ascending"),
        ({"orders": (1,), "amplitudes": ((1,),), "speeds": (2.0, 3.0)}, "at 2 speeds"),
        ({"orders": (1,), "amplitudes": (1,), "exponent": 2.0}, "go together"),
    ],
)
def test_wrong_harmonics_are_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        sw.Harmonics(**values)  # type: ignore[arg-type]


def test_a_text_that_is_no_harmonics_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match="are no harmonics"):
        sw.HarmonicTorque("h", harmonics="loud")  # type: ignore[arg-type]
    assert sw.Harmonics.read(repr(HARMONICS)) == HARMONICS
