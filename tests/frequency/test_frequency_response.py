"""Frequency response: closed forms, steady amplitudes of simulated drives, resonance, large networks, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw


def _two_masses(d: float = 40.0, tau: Any = 0.0) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4, d=d), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    return net


def _chain(n: int, d: float = 0.01) -> sw.Network:
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=0.0), "n0")
    for k in range(n):
        net.add(sw.Inertia(f"J{k}", J=1e-3), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=1e4, d=d), f"n{k - 1}", f"n{k}")
    return net


def _chain_end_speed(n: int, s: complex, J: float = 1e-3, c: float = 1e4, d: float = 0.01) -> complex:
    """Speed of the far end of the free chain by the torque at its first inertia, by transfer matrices."""
    speed, torque = 1.0 + 0j, 0.0 + 0j  # backwards from the free end
    for k in range(n):
        torque += J * s * speed
        if k < n - 1:
            speed += torque / (d + c / s)
    return 1.0 / torque


F = np.geomspace(0.1, 1e3, 40)


def test_the_shaft_torque_of_two_masses_has_its_closed_form() -> None:
    s, c, d = 2j * np.pi * F, 1e4, 40.0
    wanted = (d * s + c) / 2.0 / (s**2 + (1 / 2 + 1 / 3) * (d * s + c))
    response = _two_masses().frequency_response("motor.tau", "shaft.tau", F)
    np.testing.assert_allclose(response.values, wanted, rtol=1e-12)
    np.testing.assert_allclose(response.magnitude, np.abs(wanted), rtol=1e-12)
    np.testing.assert_allclose(response.phase, np.angle(wanted), atol=1e-12)
    assert response.units == ("N*m", "N*m")


def test_numpy_takes_a_response_for_its_values() -> None:
    response = _two_masses().frequency_response("motor.tau", "shaft.tau", F)
    np.testing.assert_array_equal(np.abs(response), response.magnitude)
    np.testing.assert_array_equal(abs(response), response.magnitude)
    assert response[3] == response.values[3]
    assert len(response) == len(list(response)) == len(F)
    assert np.asarray(response, dtype=np.complex64).dtype == np.complex64


def test_one_frequency_is_a_response_of_one() -> None:
    response = _two_masses().frequency_response("motor.tau", "J1.omega", 10.0)
    assert response.values.shape == (1,)


@pytest.mark.parametrize("f", [2.0, 10.3, 25.0])
def test_a_simulated_sinusoidal_drive_settles_to_the_amplitude_and_phase(f: float) -> None:
    """After 12 s transients are down by exp(-16.7 * 12); sine and cosine are fitted over whole periods."""
    law = 3.0 * sympy.cos(2 * sympy.pi * sympy.Float(f) * sw.t)
    net = _two_masses(tau=law)
    response = net.frequency_response("motor.tau", "shaft.tau", f)
    periods = np.floor(4.0 * f) / f
    times = 12.0 + np.linspace(0.0, periods, 4001)[:-1]
    torque = net.simulate(17.0, rtol=1e-11, t_eval=2).at(times)["shaft.tau"]
    fitted = 2 * (torque * np.exp(-2j * np.pi * f * times)).mean()
    assert fitted / 3.0 == pytest.approx(response.values[0], rel=1e-7)


@pytest.mark.slow
def test_a_small_swing_of_a_nonlinear_drive_is_that_of_its_linearisation() -> None:
    """A motor under load, its load swinging by 0.001 of its size: second order terms are of that size squared."""

    def drive(load: Any) -> sw.Network:
        net = sw.Network("loaded")
        net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000), "a")
        net.add(sw.Inertia("J1", J=0.05), "a")
        net.add(sw.Spring("shaft", c=50.0, d=0.05), "a", "b")
        net.add(sw.Inertia("J2", J=0.08), "b")
        net.add(sw.TorqueSource("load", tau=load), "b")
        return net

    f, size = 3.0, 4e-3
    model = drive(-4.0).compile()
    steady = model.steady_state()
    response = model.linearize(steady).frequency_response("load.tau", "shaft.tau", f)
    sol = drive(-4.0 + size * sympy.cos(2 * sympy.pi * 3 * sw.t)).simulate(16.0, initial=steady, rtol=1e-12, t_eval=2)
    times = 12.0 + np.arange(4000) / 4000 * 3.0
    fitted = 2 * (sol.at(times)["shaft.tau"] * np.exp(-2j * np.pi * f * times)).mean()
    assert fitted / size == pytest.approx(response.values[0], rel=1e-5)


def test_a_direct_current_machine_has_the_transfer_function_of_the_textbook() -> None:
    """omega / u = k / ((R + L s)(J s + b) + k^2), i / u = (J s + b) / the same."""
    k, R, L, J, b = 0.8, 1.2, 0.02, 0.03, 0.01
    net = sw.Network("servo")
    net.add(sw.VoltageSource("supply", u=100.0), "p", "n")
    net.add(sw.Ground("earth"), "n")
    net.add(sw.DCMachine("machine", k=k, R=R, L=L), "p", "n", "rotor")
    net.add(sw.Inertia("J", J=J), "rotor")
    net.add(sw.Damper("bearing", d=b), "rotor")
    s = 2j * np.pi * F
    below = (R + L * s) * (J * s + b) + k**2
    speed = net.frequency_response("supply.u", "machine.omega", F)
    np.testing.assert_allclose(speed.values, k / below, rtol=1e-12)
    assert speed.units == ("V", "rad/s")
    current = net.frequency_response("supply.u", "machine.i", F)
    np.testing.assert_allclose(current.values, (J * s + b) / below, rtol=1e-12)


def test_r_l_c_in_series_takes_the_current_of_its_impedance() -> None:
    R, L, C = 3.0, 0.02, 5e-6
    net = sw.Network("series circuit")
    net.add(sw.VoltageSource("supply", u=1.0), "p", "n")
    net.add(sw.Resistor("R", R=R), "p", "x")
    net.add(sw.Inductor("L", L=L), "x", "y")
    net.add(sw.Capacitor("C", C=C), "y", "n")
    net.add(sw.Ground("earth"), "n")
    s = 2j * np.pi * F
    response = net.frequency_response("supply.u", "supply.i", F)
    np.testing.assert_allclose(response.values, 1 / (R + L * s + 1 / (C * s)), rtol=1e-12)


def test_a_torque_of_a_rigidly_driven_inertia_grows_with_the_frequency() -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=5.0), "a")
    net.add(sw.Gear("gear", ratio=4.0), "a", "b")
    net.add(sw.Inertia("J", J=32.0), "b")
    response = net.frequency_response("drive.omega", "drive.tau", F)
    np.testing.assert_allclose(response.values, 2j * np.pi * F * 32.0 / 16.0, rtol=1e-14)


def test_the_matrices_give_the_same_response() -> None:
    linear = _two_masses().compile().linearize(outputs=("shaft.tau", "J2.omega"))
    for row, output in enumerate(linear.outputs):
        values = linear.frequency_response("motor.tau", output, F).values
        for f, value in zip(F, values, strict=True):
            s = 2j * np.pi * f
            wanted = linear.C @ np.linalg.solve(s * np.eye(3) - linear.A, linear.B) + linear.D + s * linear.D1
            assert value == pytest.approx(wanted[row, 0], rel=1e-12)


@pytest.mark.parametrize("n", [10, 60])
def test_a_chain_responds_as_its_transfer_matrices_say(n: int) -> None:
    """19 states are solved densely, 119 sparsely."""
    response = _chain(n).frequency_response("motor.tau", f"J{n - 1}.omega", F)
    wanted = [_chain_end_speed(n, 2j * np.pi * f) for f in F]
    np.testing.assert_allclose(response.values, wanted, rtol=1e-9)


@pytest.mark.slow
def test_a_chain_of_ten_thousand_states_responds_as_its_transfer_matrices_say() -> None:
    """Both round: the product of 5000 transfer matrices loses some ten digits of sixteen near a resonance."""
    n, f = 5001, np.array([0.05, 3.0, 40.0])
    response = _chain(n).frequency_response("motor.tau", f"J{n - 1}.omega", f)
    wanted = [_chain_end_speed(n, 2j * np.pi * value) for value in f]
    np.testing.assert_allclose(response.values, wanted, rtol=1e-6)


def test_a_resonance_hit_exactly_is_infinite_and_named() -> None:
    net = _two_masses(d=0.0)
    f = net.modes().frequencies[1]
    response = net.frequency_response("motor.tau", "shaft.tau", [1.0, f, 100.0])
    assert response.infinite == (f,)
    assert np.isinf(response.magnitude[1])
    assert not np.isnan(response.phase).any()
    assert "infinite at" in str(response)
    assert np.isfinite(response.magnitude[[0, 2]]).all()


@pytest.mark.parametrize("n", [5, 60])
def test_a_resonance_that_the_output_does_not_see_stays_finite(n: int) -> None:
    """Two equal trains driven at their common middle: the mode in which they swing against each other is not excited.

    At its frequency the response is that of the two together, which is the limit from both sides; 1e-6 is where it is
    read beside.
    """
    net = sw.Network("symmetric")
    net.add(sw.TorqueSource("motor", tau=0.0), "middle")
    net.add(sw.Inertia("J", J=1.0), "middle")
    for side in ("left", "right"):
        before = "middle"
        for k in range(n):
            net.add(sw.Spring(f"{side} s{k}", c=100.0), before, f"{side}{k}")
            net.add(sw.Inertia(f"{side} J{k}", J=1.0), f"{side}{k}")
            before = f"{side}{k}"
    modes = net.modes()
    still = np.flatnonzero((np.abs(modes.shapes["J.omega"]) < 1e-9) & (modes.frequencies > 0))
    f = modes.frequencies[still[0]]
    exact, beside = net.frequency_response("motor.tau", "J.omega", [f, f * (1 + 1e-7)]).values
    assert np.isfinite(exact)
    assert abs(exact - beside) < 1e-5 * max(abs(exact), 1e-3)


def test_units_of_measure_scale_the_response_and_nothing_else() -> None:
    plain = _two_masses().frequency_response("motor.tau", "J2.omega", F).values
    net = sw.Network("small")
    net.add(sw.TorqueSource("motor", tau=0.0), "a")
    net.add(sw.Inertia("J1", J=2e-9), "a")
    net.add(sw.Spring("shaft", c=1e-5, d=40e-9), "a", "b")
    net.add(sw.Inertia("J2", J=3e-9), "b")
    np.testing.assert_allclose(net.frequency_response("motor.tau", "J2.omega", F).values * 1e-9, plain, rtol=1e-11)


@pytest.mark.parametrize(
    ("f", "said"),
    [
        (0.0, r"f\[0\] = 0 must be a finite frequency above 0 Hz"),
        ([1.0, -2.0], r"f\[1\] = -2"),
        ([1.0, 2.0, float("nan")], r"f\[2\] = nan"),
        ([float("inf")], r"f\[0\] = inf"),
        ([], "no list of frequencies"),
        ([[1.0], [2.0]], "no list of frequencies"),
        ("fast", "no list of frequencies"),
        (None, "must be a finite frequency"),
    ],
)
def test_what_is_no_frequency_is_named(f: Any, said: str) -> None:
    with pytest.raises(sw.ParameterError, match=said):
        _two_masses().frequency_response("motor.tau", "shaft.tau", f)


def test_what_is_no_input_or_output_is_answered_with_what_is() -> None:
    net = _two_masses()
    with pytest.raises(sw.SignalError, match=r"'shaft\.tau' is no input.*motor\.tau"):
        net.frequency_response("shaft.tau", "J1.omega", 1.0)
    with pytest.raises(sw.SignalError, match=r"No quantity 'shaft\.torque'.*shaft\.tau"):
        net.frequency_response("motor.tau", "shaft.torque", 1.0)
    with pytest.raises(sw.SignalError, match=r"No quantity 7 in"):
        net.frequency_response("motor.tau", 7, 1.0)  # type: ignore[arg-type]
    with pytest.raises(sw.SignalError, match=r"no input here. There are: motor\.tau"):
        net.compile().linearize().frequency_response("J1.tau", "J1.omega", 1.0)


def test_the_bode_plot_has_a_magnitude_and_a_phase() -> None:
    pytest.importorskip("matplotlib")
    net = _two_masses(d=0.0)
    resonance = net.modes().frequencies[1]
    magnitude, phase = net.frequency_response("motor.tau", "J1.omega", [1.0, 5.0, resonance, 50.0]).plot().axes
    assert "(rad/s) / (N m)" in magnitude.get_ylabel()
    assert magnitude.get_shared_x_axes().joined(magnitude, phase)  # zoomed into as one
    assert np.isfinite(magnitude.lines[0].get_ydata()).all()
    assert np.isfinite(phase.lines[0].get_ydata()).all()
    assert magnitude.lines[1].get_xdata()[0] == resonance  # marked, for it has no height


def test_the_largest_finite_value_of_a_response_is_named_beside_a_resonance_however_small_it_is() -> None:
    net = _two_masses(d=0.0)
    f = net.modes().frequencies[1]
    response = net.frequency_response("motor.tau", "J1.omega", [f, 1e5, 1e6])
    assert response.infinite == (f,)
    assert 0 < response.magnitude[1] < 0.01
    assert f"largest {response.magnitude[1]:.6g} at 100000 Hz; infinite at" in str(response)


def test_small_motions_of_many_columns_are_not_taken_for_the_motion_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long trajectory is read in blocks of times; deviations from a point must not be read as such a one."""
    net = sw.Network("driven chain")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    shaft = sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=sw.Lumped(20))
    net.add(shaft, "a", "b")
    model = net.compile()
    whole = model.linearize(outputs=("line.tau_a", "J.omega")).C
    monkeypatch.setattr("shaftwork.codegen.array_form.elements.blocks.__defaults__", (100,))
    np.testing.assert_array_equal(model.linearize(outputs=("line.tau_a", "J.omega")).C, whole)
