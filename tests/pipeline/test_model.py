"""Model.simulate: engines, outputs, start values, parameters, steady operation, failures."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import sympy
from scipy.integrate import simpson

import shaftwork as sw
from tests.reference.crane import Crane, shaft_torque

ENGINES = ("heyoka", "scipy", "scipy-radau", "sundials")


def crane(**shaft: float) -> sw.Network:
    net = sw.Network("crane travel")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", **{"c": 24206.0, "d": 14.0, **shaft}), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.CoulombLoad("load", tau=22.4, omega_s=0.01), "wheel")
    return net


def two_masses(**source: object) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", **{"tau": 10.0, **source}), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


@pytest.mark.slow
def test_auto_solves_the_crane_to_1e_8_of_the_largest_torque_at_rtol_1e_9() -> None:
    sol = crane().simulate(t_end=6.5, rtol=1e-9, t_eval=651)
    truth = shaft_torque(Crane(tau_k=9.6, s_k=0.25), sol.t)
    assert np.abs(sol["shaft.tau"] - truth).max() < 1e-8 * np.abs(truth).max()
    assert sol.energy_residual < 1e-8
    assert sol.engine == "heyoka"
    assert "Taylor" in sol.why


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_agrees_with_the_hand_typed_crane(engine: str) -> None:
    sol = crane().simulate(t_end=1.0, rtol=1e-9, t_eval=101, engine=engine)
    truth = shaft_torque(Crane(tau_k=9.6, s_k=0.25), sol.t)
    # the error of an adaptive engine may exceed rtol by a factor that grows with the number of steps
    assert np.abs(sol["shaft.tau"] - truth).max() < 1e-6 * np.abs(truth).max()
    assert sol.energy_residual < 1e-6


def test_a_linear_train_is_propagated_exactly_through_steps_and_ramps() -> None:
    law = sw.Step(10.0, start=0.1) + sw.Ramp(-4.0, duration=0.2, start=0.3)
    net = two_masses(tau=law)
    exact = net.simulate(t_end=1.0, t_eval=101)
    assert exact.engine == "exact"
    adaptive = net.simulate(t_end=1.0, t_eval=101, engine="scipy", rtol=1e-12)
    for name in ("J1.omega", "shaft.tau", "motor.tau"):
        # the adaptive engine's own error at rtol 1e-12
        assert np.abs(exact[name] - adaptive[name]).max() < 1e-9 * np.abs(exact[name]).max()


def test_momentum_is_the_integral_of_the_torque() -> None:
    sol = two_masses(tau=sw.Table([0.0, 0.5, 1.0], [0.0, 8.0, 0.0])).simulate(t_end=1.0, t_eval=[0.0, 0.5, 1.0])
    momentum = 2.0 * sol["J1.omega"] + 3.0 * sol["J2.omega"]
    assert momentum == pytest.approx([0.0, 2.0, 4.0], abs=1e-12)  # rounding of the exact propagation


def test_output_times_are_those_asked_for() -> None:
    model = two_masses().compile()
    assert len(model.simulate(1.0).t) == 1001
    assert model.simulate(1.0, t_eval=11).t == pytest.approx(np.linspace(0, 1, 11))
    assert model.simulate(1.0, t_eval=[0.25, 0.5]).t.tolist() == [0.25, 0.5]
    steps = model.simulate(1.0, t_eval="steps", engine="scipy")
    assert steps.t.tolist() == steps.steps.tolist()
    assert model.simulate(2.0, t_start=1.0).t[0] == 1.0


@pytest.mark.slow
def test_dense_output_agrees_with_output_times() -> None:
    model = crane().compile()
    for engine in ENGINES:
        coarse = model.simulate(1.0, rtol=1e-9, engine=engine, t_eval=[0.0, 1.0])
        fine = model.simulate(1.0, rtol=1e-9, engine=engine, t_eval=201)
        # dense output is as accurate as the steps, not as exact as they are equal
        assert np.abs(coarse.at(fine.t)["shaft.tau"] - fine["shaft.tau"]).max() < 1e-6 * np.abs(fine["shaft.tau"]).max()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"t_end": 0.0}, "after t_start"),
        ({"t_end": math.nan}, "finite"),
        ({"t_end": "abc"}, "t_end"),
        ({"t_end": None}, "t_end"),
        ({"t_end": 1.0, "t_start": 1j}, "t_start"),
        ({"t_end": 1.0, "rtol": "a"}, "rtol"),
        ({"t_end": 1.0, "atol": 0.0}, "atol"),
        ({"t_end": 1.0, "atol": math.nan}, "atol"),
        ({"t_end": 1.0, "atol": [1e-9, 1e-9]}, "3 numbers"),
        ({"t_end": 1.0, "t_eval": ["a"]}, "list of times"),
        ({"t_end": 1.0, "t_eval": 10**12}, "at most"),
        ({"t_end": 1.0, "initial": {"J1.omega": "a"}}, r"J1\.omega"),
        ({"t_end": 1.0, "initial": [1.0]}, "must map"),
        ({"t_end": 1.0, "parameters": [1.0]}, "must map"),
        ({"t_end": 1.0, "parameters": {"motor.tau": sw.Step(1.0)}}, "must be a number here"),
        ({"t_end": 1.0, "algebraic_loops": "x"}, "'refuse' or 'solve'"),
        ({"t_end": 1.0, "rtol": 0.0}, "rtol"),
        ({"t_end": 1.0, "rtol": 1e-16}, "rounding of double precision"),
        ({"t_end": 1.0, "t_eval": 1}, "at least 2"),
        ({"t_end": 1.0, "t_eval": [0.5, 0.4]}, "strictly increasing"),
        ({"t_end": 1.0, "t_eval": [0.5, 2.0]}, "between 0 and 1"),
        ({"t_end": 1.0, "t_eval": "all"}, "'steps'"),
        ({"t_end": 1.0, "engine": "euler"}, "scipy"),
        ({"t_end": 1.0, "parameters": {"shaft.k": 1.0}}, "shaft.c"),
        ({"t_end": 1.0, "parameters": {"axle.c": 1.0}}, "shaft.c"),
        ({"t_end": 1.0, "parameters": {"shaft.c": -1.0}}, "at least 0"),
        ({"t_end": 1.0, "parameters": {"shaft.c": math.nan}}, "finite"),
        ({"t_end": 1.0, "initial": {"J1.omega": math.inf}}, "finite"),
    ],
)
def test_a_wrong_argument_is_named_with_what_would_be_right(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        two_masses().simulate(**arguments)


@pytest.mark.parametrize("rtol", [1e-16, 1.0, math.nan])
def test_wherever_a_relative_tolerance_is_asked_for_it_is_one_that_doubles_can_keep(rtol: float) -> None:
    net, measures, finest = two_masses(), {"speed": "end J1.omega"}, float(np.finfo(float).eps)
    model = net.compile()
    with pytest.raises(sw.ParameterError, match="rtol"):
        model.choose_engine(1.0, rtol=rtol)
    with pytest.raises(sw.ParameterError, match="rtol"):
        sw.studies.sweep(net, samples={"J1.J": [1.0]}, t_end=1.0, measures=measures, rtol=rtol)
    with pytest.raises(sw.ParameterError, match="rtol"):
        sw.studies.motion_sensitivities(net, measures, t_end=1.0, rtol=rtol)
    assert model.simulate(1.0, rtol=finest).t[-1] == 1.0


def test_changed_parameters_give_the_same_motion_as_a_new_network() -> None:
    model = crane().compile()
    for changed in ({"shaft.c": 3e4}, {"shaft.d": 0.0}, {"shaft.c": 3e4, "J1.J": 20.0}):
        built = crane()
        shaft = {key.split(".")[1]: value for key, value in changed.items() if key.startswith("shaft")}
        built = crane(**shaft)
        if "J1.J" in changed:
            built = sw.Network("crane travel")
            built.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
            built.add(sw.Inertia("J1", J=20.0), "rotor")
            built.add(sw.Spring("shaft", c=3e4, d=14.0), "rotor", "wheel")
            built.add(sw.Inertia("J2", J=62.5), "wheel")
            built.add(sw.CoulombLoad("load", tau=22.4, omega_s=0.01), "wheel")
        one = model.simulate(1.0, parameters=changed, engine="scipy", t_eval=11)
        two = built.simulate(1.0, engine="scipy", t_eval=11)
        # the same code with the same numbers: equal to the last bits
        assert one["shaft.tau"] == pytest.approx(two["shaft.tau"], rel=1e-12, abs=1e-9)


def test_changed_parameters_do_not_compile_again() -> None:
    model = crane().compile()
    model.simulate(0.1)
    program = model.taylor_program
    model.simulate(0.1, parameters={"shaft.c": 3e4})
    assert model.taylor_program is program


def test_a_damping_that_was_zero_can_be_given_later() -> None:
    one = crane(d=0.0).compile().simulate(1.0, parameters={"shaft.d": 14.0}, t_eval=11)
    two = crane().simulate(1.0, t_eval=11)
    assert one["shaft.tau"] == pytest.approx(two["shaft.tau"], rel=1e-12)


def test_start_values_may_be_speeds_twists_and_torques() -> None:
    model = two_masses().compile()
    sol = model.simulate(0.1, initial={"J1.omega": 3.0, "shaft.phi_rel": 0.01}, t_eval=11)
    assert sol["J1.omega"][0] == 3.0
    assert sol["shaft.tau_c"][0] == pytest.approx(100.0)
    assert sol["J2.omega"][0] == 0.0


def test_a_start_value_of_a_geared_inertia_moves_its_group() -> None:
    net = sw.Network("geared")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=4.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Damper("d", d=1e-3), "b")
    sol = net.simulate(0.1, initial={"J2.omega": 5.0}, t_eval=3)
    assert sol["J1.omega"][0] == pytest.approx(20.0)
    with pytest.raises(sw.ParameterError, match="contradicts"):
        net.simulate(0.1, initial={"J1.omega": 1.0, "J2.omega": 5.0})
    with pytest.raises(sw.SignalError, match=r"J1\.omega"):
        net.simulate(0.1, initial={"J1.speed": 1.0})


def test_the_torque_of_a_damped_spring_starts_with_everything_else_at_rest() -> None:
    sol = crane().simulate(0.1, initial={"shaft.tau": 10.0}, t_eval=3)
    assert {name: sol[name][0] for name in sol.states} == {"J1.omega": 0.0, "J2.omega": 0.0, "shaft.tau_c": 10.0}
    moving = crane().simulate(0.1, initial={"shaft.tau": 10.0, "J2.omega": 2.0}, t_eval=3)
    assert moving["shaft.tau"][0] == pytest.approx(10.0, rel=1e-15)
    assert moving["shaft.tau_c"][0] == pytest.approx(10.0 + 14.0 * 2.0, rel=1e-15)
    assert moving["J1.omega"][0] == 0.0


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("shaft.omega_rel", "'J1.omega': ..., 'J2.omega': ..."),
        ("motor.tau", "'J1.omega': ..."),
        ("J2.tau", "'J2.omega': ..."),
        ("shaft.energy", "'shaft.tau_c': ..."),
        ("J1.power", "'J1.omega': ..."),
    ],
)
def test_what_no_store_alone_has_is_refused_with_the_start_values_that_set_it(name: str, instead: str) -> None:
    with pytest.raises(sw.ParameterError, match=re.escape(f"Give initial={{{instead}}}.")):
        crane().simulate(0.1, initial={name: 1.0})


def test_a_planetary_gear_starts_with_the_speeds_of_two_of_its_wheels() -> None:
    """One speed leaves open how the other two share it, and so it is refused; any two of them give the third."""
    net = sw.Network("planetary")
    for node in ("sun", "carrier", "ring"):
        net.add(sw.Inertia(f"{node} wheel", J=1.0), node)
    net.add(sw.PlanetaryGear("gear", ratio=2.0), "sun", "carrier", "ring")
    model = net.compile()
    for name in ("sun wheel.omega", "carrier wheel.omega", "ring wheel.omega"):
        with pytest.raises(sw.ParameterError, match="share the motion"):
            model.simulate(0.1, initial={name: 1.0})
    speeds = {"sun wheel.omega": 9.0, "carrier wheel.omega": 3.0, "ring wheel.omega": 0.0}  # 9 + 2 * 0 = (1 + 2) * 3
    for name in speeds:
        two = {other: value for other, value in speeds.items() if other != name}
        sol = model.simulate(0.1, initial=two, t_eval=2)
        assert {other: sol[other][0] for other in speeds} == pytest.approx(speeds, abs=1e-14)


def test_a_start_value_of_a_prescribed_speed_is_refused_with_what_the_source_makes_it() -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=3.0), "a")
    net.add(sw.Gear("gear", ratio=2.0), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    net.add(sw.Spring("shaft", c=10.0), "b", "c")
    net.add(sw.Inertia("end", J=1.0), "c")
    model = net.compile()
    assert model.simulate(0.1, initial={"J.omega": 1.5, "a.omega": 3.0}, t_eval=2)["J.omega"][0] == 1.5
    for name in ("J.omega", "a.omega"):
        with pytest.raises(sw.ParameterError, match=r"contradicts its sources: with them it would be (1\.5|3)\b"):
            model.simulate(0.1, initial={name: 2.0})


def test_steady_operation_is_where_the_start_runs_to() -> None:
    model = sw.scenes.crane_start().compile()
    steady = model.steady_state()
    late = model.simulate(40.0, t_eval=[40.0])
    for name in late.states:
        assert steady[name] == pytest.approx(late.x[0, late.states.index(name)], rel=1e-6)
    again = model.simulate(5.0, initial=steady, t_eval=11)
    assert again["J2.omega"] == pytest.approx(np.full(11, steady["J2.omega"]), rel=1e-9)


@pytest.mark.slow
def test_no_steady_operation_is_said_with_the_state_that_keeps_changing() -> None:
    with pytest.raises(sw.SimulationError, match="omega"):
        two_masses().compile().steady_state()


@pytest.mark.slow
def test_an_impossible_law_fails_with_time_state_and_reason() -> None:
    net = two_masses(tau=1 / (sw.t - sympy.Rational(1, 2)) ** 2)
    for engine in ("scipy", "heyoka", "sundials"):
        with pytest.raises(sw.SimulationError, match=r"t = .*s"):
            net.simulate(1.0, engine=engine)


def test_an_angle_is_recorded_when_asked_for() -> None:
    sol = two_masses().simulate(1.0, angles=["J2"], t_eval=11)
    steps = sol.at(np.linspace(0, 1, 20001))
    trapezoid = np.sum((steps["J2.omega"][1:] + steps["J2.omega"][:-1]) / 2) / 20000
    assert sol["J2.phi"][-1] == pytest.approx(trapezoid, rel=1e-7)  # error of the trapezoidal rule
    with pytest.raises(sw.SignalError, match="shaft"):
        two_masses().compile(angles=["axle"])


def test_a_law_that_reads_the_angle_adds_an_angle_state_and_swings() -> None:
    net = sw.Network("pendulum")
    net.add(sw.Inertia("J", J=2.0), "arm")
    net.add(sw.TorqueSource("gravity", tau=-50.0 * sw.phi), "arm")
    model = net.compile()
    assert "gravity.phi" in model.states
    sol = model.simulate(1.0, initial={"gravity.phi": 0.1}, t_eval=101)
    assert sol["gravity.phi"] == pytest.approx(0.1 * np.cos(5.0 * sol.t), abs=1e-9)


def test_a_speed_jump_is_an_impulse_to_what_is_rigidly_joined() -> None:
    net = sw.Network("impulse")
    net.add(sw.SpeedSource("drive", omega=sw.Step(10.0, start=0.5)), "ring")
    net.add(sw.PlanetaryGear("planet", ratio=2.0), "sun", "carrier", "ring")
    net.add(sw.Inertia("Js", J=1.0), "sun")
    net.add(sw.Inertia("Jc", J=3.0), "carrier")
    with pytest.warns(sw.NetworkWarning, match="drive"):
        model = net.compile()
    sol = model.simulate(1.0, t_eval=[0.25, 0.75])
    # lever: sun + 2 ring = 3 carrier; the impulse P on the carrier is three times that on the sun, and opposite:
    # Js ws = -P, Jc wc = 3 P, ws = 3 wc - 20
    carrier = 60.0 / (9.0 + 3.0)
    assert sol["Jc.omega"] == pytest.approx([0.0, carrier])
    assert sol["Js.omega"] == pytest.approx([0.0, 3 * carrier - 20.0])
    assert sol.energy_residual < 1e-12


def test_a_motion_that_is_prescribed_needs_no_states() -> None:
    net = sw.Network("servo test bench")
    net.add(sw.SpeedSource("drive", omega=sw.t**2), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Damper("bearing", d=0.5), "a")
    sol = net.simulate(1.0, t_eval=[0.0, 0.5, 1.0])
    assert sol["drive.tau"] == pytest.approx(4.0 * sol.t + 0.5 * sol.t**2)
    assert sol.energy_residual < 1e-12
    static = sw.Network("static")
    static.add(sw.VoltageSource("supply", u=1.0), "p", "ground")
    static.add(sw.Resistor("load", R=2.0), "p", "ground")
    assert static.simulate(1.0, t_eval=2)["load.i"] == pytest.approx([0.5, 0.5])


def test_ratios_may_be_changed_into_and_out_of_a_locked_loop() -> None:
    def train(ratio: float) -> sw.Network:
        net = sw.Network("two gears")
        net.add(sw.TorqueSource("motor", tau=1.0), "a")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(sw.Gear("upper", ratio=ratio), "a", "b")
        net.add(sw.Gear("lower", ratio=3.0), "a", "b")
        net.add(sw.Inertia("J2", J=9.0), "b")
        net.add(sw.Spring("shaft", c=10.0), "b", "c")
        net.add(sw.Inertia("J3", J=1.0), "c")
        return net

    free = train(3.0).simulate(1.0, t_eval=3)
    with pytest.warns(sw.NetworkWarning, match="lock"):
        locked = train(2.0).compile()
    assert locked.simulate(1.0, t_eval=3)["J1.omega"].tolist() == [0.0, 0.0, 0.0]
    assert locked.simulate(1.0, t_eval=3, parameters={"upper.ratio": 3.0})["J1.omega"] == pytest.approx(
        free["J1.omega"]
    )
    with pytest.warns(sw.NetworkWarning, match="lock"):
        stuck = train(3.0).compile().simulate(1.0, t_eval=3, parameters={"upper.ratio": 2.0})
    assert stuck["J1.omega"].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy", "scipy-radau"])
def test_an_algebraic_loop_is_solved_on_request(engine: str) -> None:
    net = sw.Network("massless rotor")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
    net.add(sw.Damper("bearing", d=200.0), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    with pytest.raises(sw.NetworkError, match="motor"):
        net.compile()
    sol = net.simulate(3.0, algebraic_loops="solve", engine=engine, t_eval=101)
    small = sw.Network("nearly massless rotor")
    for part, nodes in zip(net.parts, (p.nodes for p in net.netlist().placed), strict=True):
        small.add(part, *nodes)
    small.add(sw.Inertia("J1", J=1e-6), "rotor")
    limit = small.simulate(3.0, t_eval=101)
    late = slice(5, None)  # the rotor's own transient is over
    assert sol["shaft.tau"][late] == pytest.approx(limit["shaft.tau"][late], rel=1e-5)
    assert sol.energy_residual < 1e-6


def test_the_cost_counts_operations_and_leaving_out_saves_them() -> None:
    whole, less = crane().compile().cost(), crane(d=0.0).compile().cost()
    assert whole.form == "scalar"
    assert less.total < whole.total
    chain = sw.scenes.shaft_chain(100).compile().cost()
    assert chain.form == "array"
    # per element: two torques on a speed, two speeds on a torque
    assert chain.entries == 2 * (2 * 99)


def test_a_model_says_whether_it_is_linear() -> None:
    net = sw.Network("pushed")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("push", tau=1.0), "a")
    assert str(net.compile()).splitlines()[0].endswith(", linear")
    net.add(sw.TorqueSource("fan", tau=-(sw.omega**3)), "a")
    assert str(net.compile()).splitlines()[0].endswith(", nonlinear")


def test_a_title_that_just_fits_the_screen_is_not_cut() -> None:
    """100 columns, with what follows the name."""
    for length, end in ((100, "linear"), (101, "...")):
        net = sw.Network("x" * (length - len("Model of '': 1 state, 1 parameter, linear")))
        net.add(sw.Inertia("J", J=1.0), "a")
        title = str(net.compile()).splitlines()[0]
        assert len(title) == 100
        assert title.endswith(end)


def test_the_generated_code_reads_like_the_equations() -> None:
    source = crane().compile().scalar.source
    assert "tanh" in source
    assert source.count("\n") < 20


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy"])
def test_a_law_alone_at_a_massless_node_gives_its_speed(engine: str) -> None:
    net = sw.Network("hydraulic brake")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "brake")
    net.add(sw.TorqueSource("fan", tau=-3.0 * sw.omega - 0.5 * sw.omega**3), "brake")
    sol = net.simulate(0.5, initial={"J.omega": 4.0}, algebraic_loops="solve", engine=engine, t_eval=101, rtol=1e-9)
    # the torque of the shaft is what the fan takes at the speed of its node
    speed = sol["fan.omega"]
    assert sol["shaft.tau"] == pytest.approx(3.0 * speed + 0.5 * speed**3, abs=1e-9)
    assert sol["fan.tau"] == pytest.approx(-sol["shaft.tau"], abs=1e-9)
    assert sol.energy_residual < 1e-6
    jacobian = net.compile(algebraic_loops="solve").jacobian(0.0, np.array([4.0, 2.0])).toarray()
    model = net.compile(algebraic_loops="solve")
    step = 1e-5
    for k, unit in enumerate(np.eye(2)):
        x = np.array([4.0, 2.0])
        slope = (model.rhs(0.0, x + step * unit) - model.rhs(0.0, x - step * unit)) / (2 * step)
        assert jacobian[:, k] == pytest.approx(slope, rel=1e-6, abs=1e-6)  # error of the central difference


def test_a_loop_without_a_solution_is_named() -> None:
    net = sw.Network("no speed carries this torque")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "brake")
    net.add(sw.TorqueSource("fan", tau=-1.0 - sw.omega**2), "brake")
    with pytest.raises(sw.SimulationError, match="fan"):
        net.simulate(0.5, algebraic_loops="solve")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "speed"), [(sympy.sqrt(sw.t), 2 / 3), (sw.t ** sympy.Rational(5, 2), 2 / 7), (3 * sw.t**3, 3 / 4)]
)
def test_auto_solves_laws_that_have_no_taylor_series_at_the_start(law: sympy.Expr, speed: float) -> None:
    net = sw.Network("power law")
    net.add(sw.TorqueSource("motor", tau=law), "rotor")
    net.add(sw.Inertia("J", J=1.0), "rotor")
    sol = net.simulate(1.0, t_eval=11)
    assert sol["J.omega"][-1] == pytest.approx(speed, rel=1e-7)  # a square root costs an explicit method some digits
    assert sol.energy_residual < 1e-6


@pytest.mark.parametrize("law", [sympy.Heaviside(sw.t - 0.5), sympy.sign(sw.t - 0.5), sympy.Heaviside(sw.omega - 0.5)])
def test_signals_of_laws_that_switch_can_be_read(law: sympy.Expr) -> None:
    net = sw.Network("switch")
    net.add(sw.TorqueSource("motor", tau=law + 1.0), "rotor")
    net.add(sw.Inertia("J", J=1.0), "rotor")
    one, two = (net.simulate(1.0, t_eval=[0.2, 0.9], engine=engine) for engine in ("auto", "scipy"))
    for name in ("J.omega", "motor.tau"):
        assert one[name] == pytest.approx(two[name], rel=1e-7, abs=1e-9)


@pytest.mark.slow
def test_a_stiff_train_of_a_hundred_inertias_is_solved_by_the_sparse_implicit_engine() -> None:
    net = sw.Network("stiff")
    for k in range(101):
        net.add(sw.Inertia(f"J{k}", J=1e-6), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=1e4, d=10.0), f"n{k - 1}", f"n{k}")
    net.add(sw.KlossMotor("motor", tau_k=10.0, s_k=0.2, n_sync=1000), "n0")
    sol = net.simulate(0.01, t_eval=11)
    assert sol.engine == "sundials"
    assert sol.energy_residual < 1e-5
    assert sol["J0.omega"][-1] == pytest.approx(1000 * 2 * math.pi / 60, rel=1e-3)


def test_an_angle_that_is_not_recorded_is_refused_with_the_next_step() -> None:
    net = sw.Network("one mass")
    net.add(sw.TorqueSource("motor", tau=2.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    for angles in ("J1", ["J1"]):
        with pytest.raises(sw.ParameterError, match=r"record the angle of 'J1'.*net\.compile\(angles=\['J1'\]\)"):
            net.compile().simulate(1.0, angles=angles)
        sol = net.compile(angles=angles).simulate(1.0, angles=angles)
        assert sol["J1.phi"][-1] == pytest.approx(0.5, rel=1e-7)  # t^2 / 2 to the tolerance of the run


def test_options_of_the_compilation_are_taken_by_simulate_of_a_network() -> None:
    net = sw.scenes.shaft_chain()
    short = sw.Network("shaft")
    short.add(sw.TorqueSource("pull", tau=1.0), "a")
    short.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(2)), "a", "b")
    short.add(sw.Inertia("J", J=1.0), "b")
    assert "line c 1.tau" in short.simulate(0.01, expand=True)
    assert "c1.tau" in net.simulate(0.001, expand=True)


def between_springs() -> sw.Network:
    """A torque on a massless node between two springs."""
    net = sw.Network("series")
    net.add(sw.Inertia("J1", J=0.1), "a")
    net.add(sw.Spring("first", c=100.0), "a", "x")
    net.add(sw.Spring("second", c=50.0), "x", "b")
    net.add(sw.Inertia("J2", J=0.3), "b")
    net.add(sw.TorqueSource("push", tau=2.0 * sw.t), "x")
    return net


@pytest.mark.parametrize("name", ["push", "first", "second"])
def test_an_angle_at_a_massless_node_between_springs_is_refused_with_what_to_read(name: str) -> None:
    with pytest.raises(
        sw.SignalError, match=f"angle of '{name}' is not recorded.*Give that node an inertia"
    ) as refused:
        between_springs().simulate(2.0, angles=name)
    instead = re.search(r"or read (.*?)(, with angles=(.*))?, less what that is at the start", str(refused.value))
    assert instead is not None
    times = np.linspace(0.0, 2.0, 20001)
    sol = between_springs().simulate(2.0, t_eval=times, rtol=1e-10, angles=re.findall(r"'(\w+)'", instead[3] or ""))
    angle = sum(
        (-1.0 if sign == "-" else 1.0) * sol[read] for sign, read in re.findall(r"(-?) ?sol\['([\w.]+)'\]", instead[1])
    )
    speed = sol[f"{name}.omega" if name == "push" else f"{name}.omega_rel"]
    assert angle[-1] - angle[0] == pytest.approx(simpson(speed, x=times), rel=1e-7)


@pytest.mark.parametrize("name", ["J1", "J2"])
def test_an_angle_beside_a_massless_node_is_the_integral_of_its_speed(name: str) -> None:
    times = np.linspace(0.0, 2.0, 20001)
    sol = between_springs().simulate(2.0, angles=name, t_eval=times)
    assert sol[f"{name}.phi"][-1] == pytest.approx(simpson(sol[f"{name}.omega"], x=times), rel=1e-7)
