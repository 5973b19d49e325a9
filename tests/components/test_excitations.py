"""Harmonic torques: their orders, their law by the angle, and what is refused."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import sympy
from sympy import Integer

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


def test_equal_cylinders_print_one_sum_each_and_one_table() -> None:
    net = sw.Network("engine")
    net.add(sw.Inertia("J1", J=1.0), "a")
    for number, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 3, 2)), 1):
        net.add(sw.HarmonicTorque(f"cylinder {number}", harmonics=HARMONICS, firing_angle=angle), "a")
    printed = net.equations().latex()
    assert printed.count(r"\sum_{k} T_{k} \, \cos") == 3
    assert printed.count(r"\\ 30 & 20 & 10") == 1
    assert printed.count(r"\\ 0.3 & -0.4 & 2") == 1
    assert r"\alpha_{\mathrm{cylinder},3}" in printed  # where the cycle begins, by its letter
    assert "varphi_{f" not in printed
    assert r"those of cylinder 1, cylinder 2 and cylinder 3." in printed
    valued = net.equations().latex(values=True)
    assert not re.search(r"(?<![\d.])1(\.0)? \\, ", valued)  # no factor 1
    document = net.equations().document()
    assert "amplitude of order $k$" in document


def test_torques_with_other_orders_have_letters_of_their_own_and_say_at_which_speed_they_hold() -> None:
    net = sw.Network("engine")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.HarmonicTorque("gas", harmonics=HARMONICS), "a")
    net.add(sw.HarmonicTorque("wake", harmonics=sw.Harmonics.propeller(4, 1000.0, 12.5)), "a")
    over_speed = sw.Harmonics((1.0, 2.0), ((10.0, 4.0), (20.0, 6.0)), speeds=(10.0, 20.0))
    net.add(sw.HarmonicTorque("pump", harmonics=over_speed), "a")
    printed = net.equations().latex()
    assert r"\left(\frac{\omega_{1}}{12.5}\right)^{2} \, \sum_{k} T_{\mathrm{B}, k}" in printed
    assert r"the amplitudes at $12.5\,\mathrm{rad/s}$" in printed
    assert r"T_{\mathrm{C}, k}(|\omega_{1}|)" in printed
    assert r"T_{\mathrm{C}, k}(20\,\mathrm{rad/s})" in printed


def test_many_equal_cylinders_are_one_row_whose_index_is_not_that_of_the_orders() -> None:
    net = sw.Network("engine")
    for number in range(1, 7):
        net.add(sw.Inertia(f"J{number}", J=1.0), f"n{number}")
        net.add(sw.HarmonicTorque(f"h{number}", harmonics=HARMONICS, firing_angle=0.5 * number), f"n{number}")
    printed = net.equations().latex(form="kirchhoff")
    assert r"\kappa_{\mathrm{h},j} \, \sum_{k} T_{k}" in printed
    assert r"\text{for } j = 1, \dots, 6" in printed


@pytest.mark.parametrize("table", [HARMONICS, sw.Harmonics.propeller(3, 900.0, 15.0)], ids=["steady", "growing"])
def test_the_printed_sum_is_the_law_that_is_computed(table: sw.Harmonics) -> None:
    angle, speed = sympy.symbols("angle speed", real=True)
    short, terms = table.summed(angle, speed), table.torque(angle, speed)
    at = {angle: 0.7, speed: 11.0}
    assert float(short.subs(at)) == pytest.approx(float(terms.subs(at)), rel=1e-12)
    assert short.doit() == terms
    other = sw.Harmonics((1.0,), (5.0,)).summed(angle, Integer(0))
    assert float((short + other).subs(at)) == pytest.approx(float(terms.subs(at)) + 5 * math.cos(0.7), rel=1e-12)
    for symbol in (angle, speed):
        assert float(short.diff(symbol).subs(at)) == pytest.approx(float(terms.diff(symbol).subs(at)), abs=1e-9)


def test_a_model_file_has_the_table_of_equal_cylinders_once(tmp_path: Path) -> None:
    net = sw.Network("engine")
    net.add(sw.Inertia("J1", J=1.0), "a")
    for number in (1, 2, 3):
        net.add(sw.HarmonicTorque(f"cylinder {number}", harmonics=HARMONICS), "a")
    net.save(tmp_path / "engine.toml")
    text = (tmp_path / "engine.toml").read_text()
    assert text.count("Harmonics(") == 1
    assert text.count('harmonics = "as in cylinder 1"') == 2
    assert sw.Network.load(tmp_path / "engine.toml").parts == net.parts
    (tmp_path / "wrong.toml").write_text(text.replace("as in cylinder 1", "as in cylinder 3", 1))
    with pytest.raises(sw.ModelFileError, match=r"line 20.*no part above is 'cylinder 3' and has harmonics"):
        sw.Network.load(tmp_path / "wrong.toml")


def test_gas_forces_over_speed_are_those_of_each_row() -> None:
    rows = (((3e5, 0.0), (4e5, 2e5)), ((1e5, 2e5), (5e5, 1e5)))  # cosines and sines at each speed
    table = sw.Harmonics.gas_force(
        (0.5, 1.0), [row[0] for row in rows], [row[1] for row in rows], bore=0.2, stroke=0.3, speeds=(40.0, 80.0)
    )
    for speed, (cosines, sines) in zip((40.0, 80.0), rows, strict=True):
        alone = sw.Harmonics.gas_force((0.5, 1.0), cosines, sines, bore=0.2, stroke=0.3)
        assert table.at(speed) == pytest.approx(alone.at(speed), rel=1e-12)
    with pytest.raises(sw.ParameterError, match="shape"):
        sw.Harmonics.gas_force((0.5, 1.0), ((1.0, 2.0),), ((1.0,),), bore=0.2, stroke=0.3, speeds=(40.0, 80.0))


def test_harmonics_and_mean_inertia_are_the_mean_of_an_inertia_that_changes() -> None:
    """At steady speed Lagrange's equation has m x' x'' omega^2, and the mean of m x'^2 over a turn is an integral."""
    mass, stroke, rod = 30.0, 0.3, 0.5
    phi = np.linspace(0.0, 2 * np.pi, 20001)
    way = stroke / 2 * np.cos(phi) + np.sqrt(rod**2 - (stroke / 2 * np.sin(phi)) ** 2)
    slope = np.gradient(way, phi, edge_order=2)
    expected = mass * np.trapezoid(slope**2, phi) / (2 * np.pi)
    inertia = sw.HarmonicTorque.reciprocating_inertia(mass, stroke=stroke, rod=rod)
    assert inertia == pytest.approx(expected, rel=1e-6)  # differences of so many angles
    r, share = stroke / 2, stroke / 2 / rod
    # the textbook's first terms; the next one is of the order of share^4
    assert inertia == pytest.approx(mass * r**2 / 2 * (1 + share**2 / 4), rel=share**4)


def test_without_a_steady_state_the_message_says_what_has_one() -> None:
    net = sw.Network("pulsating")
    net.add(sw.HarmonicTorque("h", harmonics=HARMONICS, mean=100.0), "a")  # above the swing, so it turns
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Damper("d", d=5.0), "a")
    model = net.compile()
    with pytest.raises(sw.SimulationError, match=r"sw.torsional_calculation.*parameters=\{'h.scale': 0\}"):
        model.steady_state()
    assert model.steady_state(parameters={"h.scale": 0})["J1.omega"] == pytest.approx(20.0)
