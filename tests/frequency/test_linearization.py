"""Linearisation: against closed forms, against central differences, about any point, and where there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw


def _net(*placed: tuple[sw.Component, tuple[str, ...]], name: str = "by hand") -> sw.Network:
    net = sw.Network(name)
    for part, nodes in placed:
        net.add(part, *nodes)
    return net


def _nonlinear() -> sw.Network:
    return _net(
        (sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5), ("a",)),
        (sw.Inertia("J1", J=27.35), ("a",)),
        (sw.Spring("shaft", c=24206.0, d=14.0), ("a", "b")),
        (sw.Gear("gear", ratio=3.0), ("b", "c")),
        (sw.Inertia("J2", J=62.5), ("c",)),
        (sw.TorqueSource("load", tau=-3 * sw.omega * sympy.Abs(sw.omega) - 50 * sympy.sin(sw.phi)), ("c",)),
        (sw.CoulombLoad("rail", tau=22.4, omega_s=0.3), ("b",)),
    )


def _transfer(linear: Any, s: complex) -> Any:
    identity = np.eye(len(linear.states))
    return linear.C @ np.linalg.solve(s * identity - linear.A, linear.B) + linear.D + s * linear.D1


def test_an_oscillator_has_the_matrices_of_the_textbook() -> None:
    net = _net(
        (sw.TorqueSource("motor", tau=5.0), ("a",)),
        (sw.Inertia("J", J=2.0), ("a",)),
        (sw.Spring("shaft", c=10.0, d=0.5), ("a", "wall")),
        (sw.Ground("frame"), ("wall",)),
    )
    linear = net.compile().linearize(outputs=("shaft.tau", "J.tau"))
    assert linear.states == ("J.omega", "shaft.tau_c")
    assert linear.inputs == ("motor.tau",)
    np.testing.assert_allclose(linear.A, [[-0.25, -0.5], [10.0, 0.0]], rtol=1e-15)
    np.testing.assert_allclose(linear.B, [[0.5], [0.0]], rtol=1e-15)
    np.testing.assert_allclose(linear.C, [[0.5, 1.0], [-0.5, -1.0]], rtol=1e-15)
    np.testing.assert_allclose(linear.D, [[0.0], [1.0]], atol=1e-15)
    assert not linear.D1.any()


def test_slopes_are_the_central_differences_of_the_right_hand_side() -> None:
    """Steps of 1e-5 leave an error of their square, and 1e-16 / 1e-5 of the largest rate by rounding."""
    model = _nonlinear().compile()
    point = dict(zip(model.states, np.random.default_rng(2).uniform(0.5, 3.0, len(model.states)).tolist(), strict=True))
    linear = model.linearize(point)
    x, step = np.array(list(point.values())), 1e-5
    differences = [(model.rhs(1.0, x + h) - model.rhs(1.0, x - h)) / (2 * step) for h in step * np.eye(len(x))]
    size = np.abs(linear.A).max()
    np.testing.assert_allclose(linear.A, np.transpose(differences), atol=1e-9 * size)


def test_a_torque_input_is_a_torque_beside_the_source_whatever_its_law() -> None:
    """The same network with one more constant source gives the same step in the rates, and no others."""
    for part in (
        sw.TorqueSource("push", tau=0.0),
        sw.TorqueSource("push", tau=4.0),
        sw.TorqueSource("push", tau=-2.0 * sw.omega),
        sw.CoulombLoad("push", tau=4.0, omega_s=1.0),
    ):
        rest = (
            (sw.Inertia("J", J=2.0), ("a",)),
            (sw.Spring("s", c=10.0), ("a", "b")),
            (sw.Inertia("K", J=5.0), ("b",)),
        )
        model = _net((part, ("a",)), *rest).compile()
        more = _net((part, ("a",)), *rest, (sw.TorqueSource("more", tau=1.0), ("a",))).compile()
        x = np.array([0.3, -0.2, 1.0])
        wanted = more.rhs(1.0, x) - model.rhs(1.0, x)
        np.testing.assert_allclose(model.linearize(inputs="push.tau").B[:, 0], wanted, atol=1e-15)


def test_a_torque_between_two_nodes_acts_on_both() -> None:
    net = _net(
        (sw.TorqueSource("push", tau=0.0), ("a", "b")),
        (sw.Inertia("J", J=2.0), ("a",)),
        (sw.Spring("s", c=10.0), ("a", "b")),
        (sw.Inertia("K", J=5.0), ("b",)),
    )
    np.testing.assert_allclose(net.compile().linearize().B[:, 0], [0.5, -0.2, 0.0], atol=1e-16)


def test_an_input_moves_the_signal_of_its_own_part() -> None:
    linear = (
        _nonlinear().compile().linearize({"J1.omega": 8.0, "J2.omega": 8.0}, inputs="motor.tau", outputs="motor.tau")
    )
    assert linear.D[0, 0] == pytest.approx(1.0, abs=1e-15)
    assert linear.C[0, 0] < 0.0  # the torque of the motor falls with its speed


def test_a_rigidly_driven_inertia_answers_the_derivative_of_its_speed() -> None:
    """drive.tau = J1 w' + the torque of the spring, 1 / (1 / (d + c / s) + 1 / (J2 s)) times the speed."""
    model = _net(
        (sw.SpeedSource("drive", omega=5.0), ("a",)),
        (sw.Inertia("J1", J=2.0), ("a",)),
        (sw.Spring("shaft", c=100.0, d=1.0), ("a", "b")),
        (sw.Inertia("J2", J=3.0), ("b",)),
    ).compile()
    linear = model.linearize(outputs=("drive.tau", "J1.tau", "J2.omega"))
    assert linear.inputs == ("drive.omega",)
    np.testing.assert_allclose(linear.D1[:, 0], [2.0, 2.0, 0.0], rtol=1e-15)
    for s in (0.3 + 1j, 40j):
        shaft = 1 / (1 / (1.0 + 100.0 / s) + 1 / (3.0 * s))
        wanted = [2.0 * s + shaft, 2.0 * s, shaft / (3.0 * s)]
        np.testing.assert_allclose(_transfer(linear, s)[:, 0], wanted, rtol=1e-13)


def test_states_that_jump_with_an_input_are_shifted_by_it() -> None:
    """A planetary gear driven at the sun: the free carrier takes up J dw/dt of the ring by a jump of the input."""
    model = _net(
        (sw.SpeedSource("drive", omega=6.0), ("sun",)),
        (sw.PlanetaryGear("set", ratio=2.0), ("sun", "carrier", "ring")),
        (sw.Inertia("Jc", J=1.0), ("carrier",)),
        (sw.Inertia("Jr", J=1.0), ("ring",)),
        (sw.Damper("bearing", d=0.7), ("ring",)),
    ).compile()
    linear = model.linearize(outputs=("Jc.omega", "Jr.omega"))
    assert linear.B1.any()
    for s in (1j, 2.0 + 5j):
        carrier = 2.0 / 3.0  # speed of the carrier by that of the ring: w_sun + 2 w_ring = 3 w_carrier
        # J s (w_c * carrier + w_r) + d w_r = 0 with w_c = 1/3 + carrier w_r
        ring = -(s * carrier / 3.0) / (s * (carrier**2 + 1.0) + 0.7)
        np.testing.assert_allclose(_transfer(linear, s)[:, 0], [1 / 3 + carrier * ring, ring], rtol=1e-13)


def test_springs_in_series_answer_the_derivative_of_a_torque() -> None:
    """The torque at the massless node winds up the spring before it: its speed has a part t' / c."""
    model = _net(
        (sw.Inertia("J", J=2.0), ("a",)),
        (sw.Spring("s1", c=50.0), ("a", "x")),
        (sw.Spring("s2", c=20.0), ("x", "b")),
        (sw.Inertia("K", J=3.0), ("b",)),
        (sw.TorqueSource("push", tau=1.0), ("x",)),
    ).compile()
    linear = model.linearize(outputs="x.omega")
    for s in (1j, 3j):
        to_left, to_right = 1 / (s / 50.0 + 1 / (2.0 * s)), 1 / (s / 20.0 + 1 / (3.0 * s))
        assert _transfer(linear, s)[0, 0] == pytest.approx(1 / (to_left + to_right), rel=1e-13)


def test_power_and_energy_have_the_slopes_of_their_products_at_the_point() -> None:
    model = _nonlinear().compile()
    point = dict(zip(model.states, [8.0, 2.0, 22.0, 0.4], strict=True))
    names = ("shaft.power", "J1.energy", "shaft.energy", "motor.power")
    linear = model.linearize(point, outputs=names)
    step = 1e-5
    for k, state in enumerate(model.states):
        values = [
            model.simulate(2.0 + 1e-9, t_start=2.0, initial=point | {state: point[state] + h}, t_eval=2, engine="scipy")
            for h in (step, -step)
        ]
        for row, name in enumerate(names):
            slope = (values[0][name][0] - values[1][name][0]) / (2 * step)
            assert linear.C[row, k] == pytest.approx(slope, rel=1e-6, abs=1e-6 * np.abs(linear.C[row]).max())


@pytest.mark.slow
def test_a_motion_at_one_time_is_a_point() -> None:
    model = _nonlinear().compile()
    sol = model.simulate(0.5)
    named = dict(zip(model.states, sol.x[-1].tolist(), strict=True))
    here, there = model.linearize(sol.at([0.5])), model.linearize(named)
    np.testing.assert_allclose(here.A, there.A, rtol=1e-12)
    assert here.t == 0.5
    with pytest.raises(sw.ParameterError, match=r"take one of them, such as at=sol\.at"):
        model.linearize(sol)
    with pytest.raises(sw.ParameterError, match=r"other states\. The states here are"):
        _net((sw.Inertia("J", J=1.0), ("a",))).compile().linearize(sol.at([0.5]))


def test_laws_are_read_after_their_last_breakpoint_unless_a_time_is_named() -> None:
    law = sympy.Piecewise((0, sw.t < 3.0), (-2.0 * sw.omega, True))
    model = _net((sw.TorqueSource("brake", tau=law), ("a",)), (sw.Inertia("J", J=1.0), ("a",))).compile()
    assert model.linearize().A[0, 0] == -2.0
    assert model.linearize(t=1.0).A[0, 0] == 0.0


def test_other_parameter_values_need_no_other_model() -> None:
    model = _nonlinear().compile()
    point = {"J1.omega": 8.0, "J2.omega": 8.0 / 3}
    changed = model.linearize(point, parameters={"shaft.c": 3e4, "shaft.d": 0.0})
    assert changed.A[changed.states.index("shaft.tau_c"), 0] == pytest.approx(3e4, rel=1e-15)
    assert changed.A[0, 0] != model.linearize(point).A[0, 0]


def test_an_algebraic_loop_is_passed_through_by_its_slope() -> None:
    """A motor at a massless node with a damper: its slope k and the spring's torque fix the speed of the node."""
    net = _net(
        (sw.KlossMotor("motor", tau_k=8.0, s_k=0.3, n_sync=3000), ("a",)),
        (sw.Damper("bearing", d=0.1), ("a",)),
        (sw.Spring("shaft", c=100.0, d=0.1), ("a", "b")),
        (sw.Inertia("J", J=0.05), ("b",)),
    )
    model = net.compile(algebraic_loops="solve")
    point = {"J.omega": 312.0, "shaft.tau_c": 1.0}
    linear = model.linearize(point, outputs=("a.omega", "J.omega"))
    x, step = np.array([312.0, 1.0]), 1e-4
    differences = [(model.rhs(0.0, x + h) - model.rhs(0.0, x - h)) / (2 * step) for h in step * np.eye(2)]
    np.testing.assert_allclose(linear.A, np.transpose(differences), rtol=1e-6, atol=1e-6 * np.abs(linear.A).max())
    np.testing.assert_allclose(linear.A, model.jacobian(0.0, x).toarray(), rtol=1e-9)
    more = net.compile(algebraic_loops="solve").linearize(point, inputs="motor.tau", outputs="a.omega")
    slope = linear.slopes.motion(*(np.zeros((k, 1), dtype=complex) for k in (2, 1, 1)))  # nothing moves: nothing read
    assert not slope("a.omega").any()
    speed = 1 / more.D[0, 0]  # torque that the node asks for a speed: damper, spring's damper and the motor's slope
    motor = model.linearize(point, outputs="motor.tau")
    assert speed == pytest.approx(0.1 + 0.1 - motor.C[0, 0] / linear.C[0, 0], rel=1e-9)


def test_the_columns_of_many_states_are_those_of_few() -> None:
    """Above a few hundred states C is found by groups; a shorter chain's torque reads the same two states."""
    net = sw.Network("long")
    net.add(sw.TorqueSource("motor", tau=0.0), "n0")
    for k in range(400):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=3.0, d=0.5), f"n{k - 1}", f"n{k}")
    linear = net.compile().linearize(outputs=("s200.tau", "n7.omega", "motor.tau"))
    wanted = np.zeros((3, 799))
    wanted[0, [199, 200, 400 + 199]] = 0.5, -0.5, 1.0
    wanted[1, 7] = 1.0
    np.testing.assert_array_equal(linear.C, wanted)
    assert linear.D[2, 0] == 1.0


def test_a_law_that_jumps_or_is_infinitely_steep_at_the_point_is_named() -> None:
    dry = _net(
        (sw.TorqueSource("friction", tau=-5.0 * sympy.sign(sw.omega)), ("a",)), (sw.Inertia("J", J=1.0), ("a",))
    ).compile()
    with pytest.raises(sw.SimulationError, match=r"TorqueSource 'friction' has a jump at this point.*at="):
        dry.linearize()
    assert dry.linearize({"J.omega": 2.0}).A[0, 0] == 0.0
    steep = _net(
        (sw.TorqueSource("root", tau=-sympy.sqrt(sympy.Abs(sw.omega))), ("a",)), (sw.Inertia("J", J=1.0), ("a",))
    ).compile()
    with pytest.raises(sw.SimulationError, match=r"TorqueSource 'root' has no finite slope at this point"):
        steep.linearize()


def test_what_is_no_input_or_output_is_answered_with_those_that_exist() -> None:
    model = _nonlinear().compile()
    with pytest.raises(sw.SignalError, match=r"'J1\.tau' is no input.*motor\.tau.*its law may be 0"):
        model.linearize(inputs="J1.tau")
    with pytest.raises(sw.SignalError, match=r"No quantity 'shaft\.torque'.*'shaft' has: shaft\.tau"):
        model.linearize(outputs="shaft.torque")
    with pytest.raises(sw.SignalError, match="no speed, twist or torque"):
        model.linearize({"J9.omega": 1.0})


def test_a_long_train_is_sparse_and_a_short_one_dense() -> None:
    assert isinstance(_nonlinear().compile().linearize().A, np.ndarray)
    assert sw.scenes.shaft_chain(m=600).compile().linearize().A.nnz < 5000


def test_a_travelling_wave_is_refused_with_the_model_that_can_be_linearised() -> None:
    net = _net(
        (sw.Inertia("J1", J=0.1), ("a",)),
        (sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave()), ("a", "b")),
        (sw.Inertia("J2", J=0.2), ("b",)),
    )
    with pytest.raises(sw.SimulationError, match=r"Shaft 'line' is a travelling wave.*model=Spectral\(16\)"):
        net.compile().linearize()


def test_values_that_change_no_structure_need_no_other_equations_beside_a_lossy_gear() -> None:
    """Its balances have other factors than its loops, and neither degenerates."""
    net = sw.Network("lossy")
    net.add(sw.TorqueSource("m", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.LossyGear("g", ratio=3.0, efficiency=0.9), "a", "b")
    net.add(sw.Spring("s", c=10.0), "b", "c")
    net.add(sw.Inertia("J2", J=1.0), "c")
    for model in (net.compile(), net.compile().phase("g driving forward")):
        p = {**model.parameters, "s.c": 20.0}
        assert not model.arrays.assembly.degenerates(model.vector(p))
