"""Transfer functions in symbols against the linearised model, closed forms and other libraries' reading of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.signal
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import compiled, network_of, share_of_examples
from tests.reference.mna import SOURCE_VALUE
from tests.strategies import Network, networks

F = np.array([0.03, 0.7, 5.0])


def two_masses() -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=50.0, d=0.3), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.Damper("load", d=0.1), "b")
    return net


def symbols(*names: str) -> tuple[sympy.Symbol, ...]:
    return tuple(sympy.Symbol(name, real=True) for name in names)


def test_the_torque_of_a_shaft_between_two_masses_is_the_quotient_that_one_finds_by_hand() -> None:
    H = two_masses().equations().transfer_function("motor.tau", "shaft.tau")
    J1, J2, c, d, load = symbols("J1.J", "J2.J", "shaft.c", "shaft.d", "load.d")
    Z = d + c / H.s  # the shaft's torque over the difference of the speeds
    loads = 1 / (J2 * H.s + load)
    byhand = Z * (1 / (J1 * H.s)) / (1 + Z * (1 / (J1 * H.s) + loads))
    assert sympy.simplify(H.expression - byhand) == 0
    assert not H.slopes


def test_poles_are_the_rates_of_the_modes_and_zeros_those_of_the_part_behind_the_output() -> None:
    net = two_masses()
    H = net.equations().transfer_function("motor.tau", "J1.omega")
    np.testing.assert_allclose(
        sorted(H.poles(), key=abs)[1:], sorted([*net.modes().rates[-1:], *net.modes().rates[-1:].conj()], key=np.imag)
    )
    # with J1 held still: J2 on the shaft
    np.testing.assert_allclose(H.zeros(), np.roots([3.0, 0.4, 50.0])[::-1])


def test_coefficients_are_what_other_libraries_take() -> None:
    net = two_masses()
    system = scipy.signal.TransferFunction(*net.equations().transfer_function("motor.tau", "J2.omega").coefficients())
    _, found = scipy.signal.freqresp(system, 2 * np.pi * F)
    np.testing.assert_allclose(found, net.frequency_response("motor.tau", "J2.omega", F).values, rtol=1e-12)


def test_other_values_and_points_go_in_afterwards() -> None:
    net = sw.scenes.crane()
    H = net.equations().transfer_function("motor.tau", "shaft.tau")
    (slope,) = H.slopes.values()
    assert str(slope.by) == "J1.omega"
    assert str(slope.of) == "-motor.tau"
    numeric = H.numeric({"shaft.c": 3e4}, {"J1.omega": 8.0}, t=0.0)
    linear = net.compile().linearize({"J1.omega": 8.0, "J2.omega": 8.0}, t=0.0, parameters={"shaft.c": 3e4})
    np.testing.assert_allclose(
        numeric(2j * np.pi * F), linear.frequency_response("motor.tau", "shaft.tau", F).values, rtol=1e-10
    )


def test_a_crane_is_printed_with_the_slope_of_its_motor_as_a_letter() -> None:
    printed = sw.scenes.crane().equations().transfer_function("motor.tau", "shaft.tau").latex()
    assert r"k_{\mathrm{motor}} &= -\frac{\partial \tau_{M}}{\partial \omega_{1}}" in printed
    assert r"Z(s) &= J_{2} \, d_{\mathrm{sh}} \, s^{2} + J_{2} \, c_{\mathrm{sh}} \, s" in printed


def test_in_a_phase_what_holds_is_one_body() -> None:
    net = sw.scenes.crane()
    phase = net.start_phase()
    assert "load stuck" in phase
    H = net.equations(phase=phase).transfer_function("motor.tau", "shaft.tau")
    response = net.frequency_response("motor.tau", "shaft.tau", F).values  # at rest, where the load is stuck
    np.testing.assert_allclose(H(2j * np.pi * F), response, rtol=1e-10)


def test_a_speed_that_drives_an_inertia_rigidly_asks_for_its_rate() -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=3.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    H = net.equations().transfer_function("drive.omega", "drive.tau")
    (J,) = symbols("J.J")
    assert H.expression == J * H.s


def test_a_long_shaft_takes_numbers_and_keeps_its_digits() -> None:
    """Degree 100: its coefficients are larger than floats are."""
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(50)), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    H = net.equations().transfer_function("motor.tau", "line.tau_b", values=True)
    assert H.denominator.degree() == 100
    with pytest.raises(sw.ParameterError, match="degree 100, and coefficients larger than floats"):
        H.coefficients()
    assert "inf" not in H.latex()
    f = np.array([0.1, 50.0, 3000.0])
    np.testing.assert_allclose(
        H(2j * np.pi * f), net.frequency_response("motor.tau", "line.tau_b", f).values, rtol=1e-10
    )


def test_poles_in_numbers_are_those_of_the_modes() -> None:
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=1.0), "n0")
    for k in range(8):
        net.add(sw.Inertia(f"J{k}", J=1.0 + 0.1 * k), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=10.0**k, d=0.01), f"n{k - 1}", f"n{k}")
    H = net.equations().transfer_function("motor.tau", "n7.omega", values=True)
    rates = np.array([rate for rate in net.modes().rates if rate])
    wanted = np.concatenate([rates, rates.conj()])
    found = H.poles()
    assert H.poles()[0] == 0.0
    np.testing.assert_allclose(np.sort_complex(found[1:]), np.sort_complex(wanted), rtol=1e-8)


def test_a_pole_has_no_value() -> None:
    with pytest.raises(sw.ParameterError, match=r"s = 0.*is a pole"):
        two_masses().equations().transfer_function("motor.tau", "J1.omega").numeric({"load.d": 0.0})(0.0)


@pytest.mark.parametrize(
    ("names", "error", "says"),
    [
        (("motr.tau", "shaft.tau"), sw.SignalError, "'motr.tau' is no input of 'two masses'.*motor.tau"),
        (("motor.tau", "shaft.tua"), sw.SignalError, r"No quantity 'shaft\.tua' in 'two masses'\. 'shaft' has: "),
        (("motor.tau", "shaft.power"), sw.SignalError, "'shaft.power' is a product of speeds and torques"),
    ],
)
def test_names_that_are_not_there_are_told(names: tuple[str, str], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        two_masses().equations().transfer_function(*names)


def test_values_and_points_that_are_not_there_are_told() -> None:
    H = two_masses().equations().transfer_function("motor.tau", "shaft.tau")
    with pytest.raises(sw.ParameterError, match=r"There is no parameter 'shaft\.k'"):
        H.numeric({"shaft.k": 1.0})
    with pytest.raises(sw.ParameterError, match=r"at: No quantity 'J3\.omega'"):
        H.numeric(at={"J3.omega": 1.0})


def fed(*parts: tuple[object, ...]) -> sw.Network:
    """Parts at nodes, with a source that drives node a."""
    net = sw.Network("fed")
    net.add(sw.TorqueSource("drive", tau=1.0), "a")
    for part, *nodes in parts:
        net.add(part, *nodes)
    return net


@pytest.mark.filterwarnings("ignore:.*have the same name:shaftwork.core.errors.NetworkWarning")
def test_a_point_is_what_laws_read_of_it_and_no_zero_in_silence() -> None:
    """Behind a gear, between two nodes, and beside a node that bears the name of a part."""
    geared = fed(
        (sw.TorqueSource("m", tau=-0.1 * sw.omega**2), "a"),
        (sw.Inertia("J1", J=2.0), "a"),
        (sw.Gear("g", ratio=3.0), "a", "b"),
        (sw.Inertia("J2", J=3.0), "b"),
    )
    with pytest.raises(sw.ParameterError, match=r"the law of 'm' reads J1\.omega, which is not given"):
        geared.equations().transfer_function("drive.tau", "J1.omega", values=True, at={"J2.omega": 3.0})
    between = fed(
        (sw.Inertia("J1", J=2.0), "a"),
        (sw.TorqueSource("m", tau=-0.1 * sw.omega**3), "a", "b"),
        (sw.Spring("s", c=10.0), "a", "b"),
        (sw.Inertia("J2", J=3.0), "b"),
    )
    alike = fed(
        (sw.TorqueSource("m", tau=-0.1 * sw.omega**3), "a"),
        (sw.Inertia("J1", J=2.0), "a"),
        (sw.Spring("s", c=5.0), "a", "J1"),
        (sw.Inertia("J2", J=2.0), "J1"),
    )
    for net, at in ((between, {"J1.omega": 9.0, "J2.omega": 1.0}), (alike, {"J1.omega": 4.0})):
        H = net.equations().transfer_function("drive.tau", "a.omega", values=True, at=at)
        response = net.compile().linearize(at).frequency_response("drive.tau", "a.omega", F).values
        np.testing.assert_allclose(H(2j * np.pi * F), response, rtol=1e-10)


def test_laws_are_read_when_none_of_them_switches_any_more() -> None:
    net = fed(
        (sw.TorqueSource("late", tau=sw.Step(1.0, start=9.0)), "a"),
        (sw.TorqueSource("m", tau=-sw.omega * sw.t), "a"),
        (sw.Inertia("J", J=2.0), "a"),
    )
    H = net.equations().transfer_function("drive.tau", "J.omega")
    np.testing.assert_allclose(H(2j * np.pi * F), net.frequency_response("drive.tau", "J.omega", F).values, rtol=1e-10)


@pytest.mark.parametrize(
    ("law", "at"), [(-5 * sympy.sign(sw.omega), None), (-sympy.sqrt(sw.omega + 1), {"J.omega": -3.0})]
)
def test_a_law_without_a_slope_at_the_point_is_refused(law: sympy.Expr, at: dict[str, float] | None) -> None:
    equations = fed((sw.TorqueSource("m", tau=law), "a"), (sw.Inertia("J", J=2.0), "a")).equations()
    with pytest.raises(sw.ParameterError, match="The law of 'm' has no finite slope at this point"):
        equations.transfer_function("drive.tau", "J.omega", values=True, at=at)


def test_numbers_that_go_in_afterwards_leave_no_common_factors_and_are_looked_at() -> None:
    H = two_masses().equations().transfer_function("motor.tau", "shaft.tau")
    assert H.numeric({"load.d": 0.0})(0.0) == pytest.approx(0.6)
    assert len(H.numeric({"load.d": 0.0}).poles()) == 2
    for value, says in ((math.nan, "no finite number"), (-50.0, "must be at least 0"), ("abc", "no finite number")):
        with pytest.raises(sw.ParameterError, match=says):
            H.numeric({"shaft.c": value})
    with pytest.raises(sw.ParameterError, match="no finite value with these numbers"):
        H.numeric({"J1.J": 0.0, "shaft.c": 0.0, "shaft.d": 0.0})
    with pytest.raises(sw.ParameterError, match="in numbers already"):
        two_masses().equations().transfer_function("motor.tau", "shaft.tau", values=True).numeric({"shaft.c": 5.0})
    with pytest.raises(sw.ParameterError, match="is no finite number"):
        H(np.inf)


def test_a_train_that_the_input_does_not_reach_neither_answers_nor_counts() -> None:
    parts = [
        part
        for x in "ab"
        for k in range(4)
        for part in (
            (sw.Inertia(f"J{x}{k}", J=1.0 + k), f"{x}{k}" if x + str(k) != "a0" else "a"),
            (sw.Damper(f"D{x}{k}", d=0.1 + k), f"{x}{k}" if x + str(k) != "a0" else "a"),
        )
    ]
    parts += [
        (sw.Spring(f"s{x}{k}", c=3.0 + k, d=0.1), f"{x}{k - 1}" if x + str(k) != "a1" else "a", f"{x}{k}")
        for x in "ab"
        for k in (1, 2, 3)
    ]
    equations = fed(*parts).equations()
    assert equations.transfer_function("drive.tau", "Jb0.omega").expression == 0
    assert equations.transfer_function("drive.tau", "Ja3.omega").denominator.degree() == 7


def test_a_mesh_takes_numbers() -> None:
    nodes = [(i, k) for i in range(4) for k in range(4)]
    name = {(i, k): "a" if i == k == 0 else f"n{i}{k}" for i, k in nodes}
    parts: list[tuple[object, ...]] = [(sw.Inertia(f"J{i}{k}", J=1.0 + 0.01 * i), name[i, k]) for i, k in nodes]
    parts += [(sw.Spring(f"v{i}{k}", c=3.0, d=0.1), name[i - 1, k], name[i, k]) for i, k in nodes if i]
    parts += [(sw.Spring(f"h{i}{k}", c=3.0, d=0.1), name[i, k - 1], name[i, k]) for i, k in nodes if k]
    net = fed(*parts)
    with pytest.raises(sw.CompileError, match="values=True"):
        net.equations().transfer_function("drive.tau", "J11.omega")
    H = net.equations().transfer_function("drive.tau", "J11.omega", values=True)
    np.testing.assert_allclose(
        H(2j * np.pi * F), net.frequency_response("drive.tau", "J11.omega", F).values, rtol=1e-10
    )


def test_a_point_without_numbers_or_one_that_contradicts_itself_is_refused() -> None:
    equations = sw.scenes.crane().equations()
    with pytest.raises(sw.ParameterError, match="Take values=True"):
        equations.transfer_function("motor.tau", "shaft.tau", at={"J1.omega": 8.0})
    H = equations.transfer_function("motor.tau", "shaft.tau")
    with pytest.raises(sw.ParameterError, match="contradicts another speed at the same node"):
        H.numeric(at={"J1.omega": 1.0, "rotor.omega": 8.0})
    with pytest.raises(sw.ParameterError, match="must be values by name"):
        H.numeric(at=[1.0])


def test_a_travelling_wave_is_refused_with_what_can_be_taken_instead() -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    with pytest.raises(sw.CompileError, match=r"Shaft 'line' is a travelling wave.*Spectral\(8\)"):
        net.equations().transfer_function("motor.tau", "J2.omega")


@share_of_examples(0.25)
@given(networks(max_inertias=6), st.integers(0, 63))
def test_random_networks_respond_as_their_linearised_model_does(pieces: Network, number: int) -> None:
    """In symbols where these are short enough, and in numbers; 1e-10 of the largest value of the same quantity."""
    net = network_of(pieces)
    drive = next(piece for piece in pieces if piece.type in SOURCE_VALUE)
    given = f"{drive.name}.{SOURCE_VALUE[drive.type]}"
    linear = compiled(net).linearize()
    names = [name for name in linear.slopes.units if not name.endswith((".power", ".energy"))]
    wanted = names[number % len(names)]
    response = linear.frequency_response(given, wanted, F).values
    in_numbers = net.equations().transfer_function(given, wanted, values=True)
    made = [in_numbers]
    try:
        made.append(net.equations().transfer_function(given, wanted))
    except sw.CompileError as error:
        if len(pieces) < 8 or "thousands of terms" not in str(error):
            raise
    for H in made:
        np.testing.assert_allclose(H(2j * np.pi * F), response, rtol=0, atol=1e-10 * np.abs(response).max())


def test_numbers_in_laws_stand_in_a_transfer_function_as_they_were_typed() -> None:
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=2 - 0.05 * sw.omega), "a")
    net.add(sw.Inertia("J", J=0.3), "a")
    transfer = net.equations().transfer_function("motor.tau", "J.omega")
    above, below = transfer.expression.as_numer_denom()
    assert max(abs(number) for made in (above, below) for number in made.atoms(sympy.Number)) <= 20


def test_an_output_without_a_letter_of_its_own_is_printed_with_that_of_its_kind() -> None:
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.OneSpring()), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    text = net.equations().transfer_function("motor.tau", "line.tau_a").latex()
    assert r"\frac{\tau_{\mathrm{line},a}}{\tau_{\mathrm{motor}}}" in text


def test_slopes_of_an_inertia_that_changes_are_taken_at_a_point_that_names_no_acceleration() -> None:
    net = sw.Network("arm")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("arm", J=2 + sympy.sin(sw.phi)), "a")
    net.add(sw.Spring("shaft", c=9.0), "a", "b")
    net.add(sw.Inertia("wheel", J=1.0), "b")
    transfer = net.equations().transfer_function("motor.tau", "shaft.tau")
    poles = transfer.numeric(at={"arm.phi": 0.5, "arm.omega": 0.0}).poles()
    assert np.abs(poles).max() == pytest.approx(math.sqrt(9 * (1 + 1 / (2 + math.sin(0.5)))), rel=1e-12)
    with pytest.raises(sw.ParameterError, match=r"reads arm\.omega, which is not given\. Give it, 0\.0 for rest"):
        transfer.numeric(at={"arm.phi": 0.5})
