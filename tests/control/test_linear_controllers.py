"""Linear controllers: loops closed here are those of python-control, continuous and sampled, in every engine."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import compiled, network_of, share_of_examples
from tests.strategies import Network, networks

T = 0.05
INSTANTS = T * np.arange(101)


def plant(*parts: sw.Component, spring: sw.Component | None = None) -> sw.Network:
    """Two inertias with a spring between them, and parts at the first."""
    net = sw.Network("plant")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=100.0, d=1.0) if spring is None else spring, "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.Damper("bearing", d=0.5), "b")
    for part in parts:
        net.add(part, "a")
    return net


def open_loop(*outputs: str) -> Any:
    return plant(sw.TorqueSource("motor", tau=0.0)).compile().linearize(outputs=outputs or None).to_control()


def pi_controller(**values: Any) -> sw.TransferFunctionController:
    choices = {"numerator": [1.0, 0.5], "denominator": [1.0, 0.0], "measured": "J2.omega", "reference": 10.0}
    return sw.TransferFunctionController("pi", **{**choices, **values})


def sampled_pi(**values: Any) -> sw.TransferFunctionController:
    """The same by Tustin's rule."""
    law = control.sample_system(control.tf([1.0, 0.5], [1.0, 0.0]), T, "tustin")
    return pi_controller(numerator=law.num[0][0], denominator=law.den[0][0], sample_time=T, **values)


def sampled_loop() -> np.ndarray:
    """The speed at the instants by python-control: the plant behind a zero-order hold, and the step of 10 rad/s."""
    law = control.sample_system(control.tf([1.0, 0.5], [1.0, 0.0]), T, "tustin")
    held = control.sample_system(open_loop("J2.omega"), T, "zoh")
    return np.asarray(10 * control.step_response(control.feedback(held * control.ss(law)), INSTANTS).outputs)


def sorted_rates(rates: Any) -> np.ndarray:
    return np.sort_complex(np.asarray(rates, dtype=complex))


def test_a_pi_loop_is_the_feedback_of_python_control() -> None:
    model, loop = (
        plant(pi_controller()).compile(),
        control.feedback(open_loop("J2.omega") * control.ss(control.tf([1.0, 0.5], [1.0, 0.0]))),
    )
    np.testing.assert_allclose(
        sorted_rates(np.linalg.eigvals(model.linearize().A)), sorted_rates(loop.poles()), rtol=1e-11
    )
    motion = model.simulate(5.0, engine="exact", t_eval=INSTANTS)
    step = control.step_response(loop, INSTANTS).outputs
    np.testing.assert_allclose(motion["J2.omega"], 10 * step, atol=1e-10)
    assert motion.energy.residual < 1e-11


def test_a_gain_of_lqr_moves_the_poles_where_it_says() -> None:
    system = open_loop()
    gain, _, poles = control.lqr(system, np.eye(3), 0.01)
    measured = [name.replace(":", ".") for name in system.state_labels]
    net = plant(sw.StateSpaceController("lqr", D=gain, measured=measured, setpoints=[1.0, 1.0, 0.5]))
    model = net.compile()
    np.testing.assert_allclose(sorted_rates(np.linalg.eigvals(model.linearize().A)), sorted_rates(poles), rtol=1e-10)
    assert model.states == ("J1.omega", "J2.omega", "shaft.tau_c")
    steady = model.steady_state()
    wanted = gain @ ([1.0, 1.0, 0.5] - np.array([steady[name] for name in measured]))
    assert 0.5 * steady["J2.omega"] == pytest.approx(wanted.item(), rel=1e-12)


def matrices(sizes: Sequence[int]) -> st.SearchStrategy[list[np.ndarray]]:
    """A, B, C, D of so many states, inputs and outputs, with round numbers."""
    n, k, m = sizes
    shapes = ((n, n), (n, k), (m, n), (m, k))
    numbers = st.integers(-20, 20).map(lambda number: number / 8)
    return st.tuples(*(st.lists(numbers, min_size=a * b, max_size=a * b) for a, b in shapes)).map(
        lambda values: [np.array(entries).reshape(shape) for entries, shape in zip(values, shapes, strict=True)]
    )


@st.composite
def loops(draw: st.DrawFn) -> tuple[Network, list[np.ndarray], list[int]]:
    """A random network, a random controller, and the places of the states that it measures."""
    pieces = draw(networks(max_inertias=8, dependent=False))
    places = draw(st.lists(st.integers(0, 10**6), min_size=1, max_size=4))
    return pieces, draw(matrices((draw(st.integers(0, 3)), len(places), 1))), places


@share_of_examples()
@given(loops())
def test_a_random_loop_has_the_matrix_of_plant_and_controller(
    loop: tuple[Network, list[np.ndarray], list[int]],
) -> None:
    """[A - B D C, B C_c; -B_c C, A_c], entry by entry, with the states in the order of their names."""
    pieces, (A, B, C, D), places = loop
    motor = next(piece for piece in pieces if piece.type == "TorqueSource")
    linear = compiled(pieces).linearize(inputs=(f"{motor.name}.tau",))
    if linear.B1.any():
        return  # the torque winds up springs in series
    measured = [linear.states[place % len(linear.states)] for place in places]
    net = network_of(pieces)
    net.add(sw.StateSpaceController("law", A=A, B=B, C=C, D=D, measured=measured), motor.nodes[0])
    closed = compiled(net).linearize(inputs=())
    read = np.array([[float(name == state) for state in linear.states] for name in measured])
    wanted = np.block([[linear.A - linear.B @ D @ read, linear.B @ C], [-B @ read, A]])
    names = [*linear.states, *(f"law.x_{k}" for k in range(1, len(A) + 1))]
    order = [closed.states.index(name) for name in names]
    np.testing.assert_allclose(closed.A[np.ix_(order, order)], wanted, atol=1e-13 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("engine", "tolerance"), [("exact", 1e-11), ("heyoka", 1e-8), ("scipy", 1e-8), ("sundials", 1e-4)]
)
def test_a_sampled_loop_is_that_of_python_control_at_its_instants(engine: Any, tolerance: float) -> None:
    """Exact but for the engine's own error, a hundred times its tolerance of 1e-8; SUNDIALS warns of more."""
    net = plant(sampled_pi())
    if engine == "sundials":
        with pytest.warns(sw.AccuracyWarning, match="is off by"):
            motion = net.simulate(5.0, engine=engine, t_eval=INSTANTS)
    else:
        motion = net.simulate(5.0, engine=engine, t_eval=INSTANTS)
    np.testing.assert_allclose(motion["J2.omega"], sampled_loop(), atol=tolerance)
    assert motion.energy.residual < 1e-7


def test_what_a_sampled_controller_gives_rests_between_its_instants() -> None:
    motion = plant(sampled_pi()).simulate(1.0, t_eval=np.linspace(0.0, 1.0, 401))
    steps = motion["pi.tau"][:-1].reshape(20, 20)  # 20 output times in each of 20 periods, the first at the instant
    np.testing.assert_allclose(steps, steps[:, :1] * np.ones(20), rtol=1e-14)
    assert np.unique(steps.round(12)).size == 20


def test_a_motion_goes_on_where_another_one_ended_at_an_instant_or_between_two() -> None:
    model = plant(sampled_pi()).compile()
    whole = model.simulate(5.0)["J2.omega"][-1]
    for stop in (2.0, 2.013):
        first = model.simulate(stop)
        assert model.simulate(5.0, initial=first)["J2.omega"][-1] == pytest.approx(whole, rel=1e-12)


def gapped(part: sw.Component) -> sw.Network:
    net = plant(part, spring=sw.Backlash("gap", gap=0.02, c=100.0, d=1.0))
    net.add(sw.CoulombLoad("load", tau=2.0), "b")
    return net


@pytest.mark.slow
def test_a_sampled_loop_with_a_gap_is_that_of_pieces_joined_by_hand() -> None:
    """A torque source whose value is computed here and set for each period; both to 1e-11."""
    gains = sampled_pi()
    (b0, b1), model = gains.numerator.array.ravel(), gapped(sw.TorqueSource("motor", tau=1.0)).compile()
    state, speed, motion = 0.0, 0.0, None
    for k in range(60):
        error = 10.0 - speed
        values = {"motor.tau": (b0 + b1) * state + b0 * error}
        motion = model.simulate((k + 1) * T, initial=motion, parameters=values, rtol=1e-11)
        state, speed = state + error, motion["J2.omega"][-1]
    for engine in ("heyoka", "scipy"):
        sampled = gapped(gains).simulate(60 * T, engine=engine, rtol=1e-11)
        assert sampled["J2.omega"][-1] == pytest.approx(speed, rel=1e-9)
        assert len(sampled.phases) == len(gapped(gains).simulate(60 * T).phases)


def test_a_reference_that_jumps_at_an_instant_is_seen_at_that_instant() -> None:
    """0.3 is 6 * 0.05 but for rounding: the torque of a proportional controller jumps there, and not a period later."""
    gain = {"numerator": 2.0, "denominator": 1.0, "sample_time": T, "measured": "J2.omega"}
    net = plant(sw.TransferFunctionController("p", reference=sw.Step(10.0, start=0.3), **gain))
    motion = net.simulate(1.0, t_eval=[0.29, 0.31, 0.36])
    np.testing.assert_allclose(motion["p.tau"][:2], [0.0, 20.0], atol=1e-12)
    assert 0.0 < motion["p.tau"][2] < 20.0


def test_controllers_of_two_rates_act_each_at_its_own_instants() -> None:
    """A slow one gives the speed of a fast one: 0.1 s and 0.025 s, as loops in python-control would be lifted."""
    slow = sw.StateSpaceController("slow", D=1.0, measured="J2.omega", reference=1.0, sample_time=0.1)
    fast = sw.StateSpaceController("fast", D=1.0, measured="J1.omega", reference=1.0, sample_time=0.025)
    motion = plant(slow, fast).simulate(1.0, t_eval=np.linspace(0.0, 1.0, 1001))
    assert np.unique(motion["slow.tau"][:-1].round(12)).size == 10
    assert np.unique(motion["fast.tau"][:-1].round(12)).size == 40
    instants = np.arange(0, 1000, 25)
    np.testing.assert_allclose(motion["fast.tau"][instants], 1.0 - motion["J1.omega"][instants], atol=1e-12)


@pytest.mark.parametrize("part", [pi_controller(), sampled_pi()], ids=["continuous", "sampled"])
def test_a_sweep_is_the_motions_of_its_variants(part: sw.Component) -> None:
    net = plant(part)
    table = sw.studies.sweep(net, {"shaft.c": [90.0, 110.0]}, t_end=1.0, measures=["end J2.omega"])
    single = [net.simulate(1.0, parameters={"shaft.c": c})["J2.omega"][-1] for c in (90.0, 110.0)]
    np.testing.assert_allclose(table.measures["end J2.omega"], single, rtol=1e-9)


def test_a_reference_and_a_sample_time_are_parameters_of_a_motion() -> None:
    model = plant(sampled_pi()).compile()
    half = model.simulate(1.0, parameters={"pi.reference": 5.0})
    np.testing.assert_allclose(2 * half["J2.omega"], model.simulate(1.0)["J2.omega"], atol=1e-11)
    longer = model.simulate(1.0, parameters={"pi.sample_time": 0.5}, t_eval=101)
    assert np.unique(longer["pi.tau"][:-1].round(12)).size == 2


ASKED: dict[str, tuple[Any, str]] = {
    "linearize": (lambda net: net.compile().linearize(), "no matrices A, B, C, D"),
    "steady state": (lambda net: net.compile().steady_state(), "no steady state"),
    "modes": (sw.Network.modes, "no matrices"),
    "response": (lambda net: net.frequency_response("pi.tau", "J2.omega", [1.0]), "no matrices"),
    "transfer function": (lambda net: net.equations().transfer_function("pi.tau", "J2.omega"), "no transfer functions"),
    "state space": (lambda net: net.equations().state_space(), "no transfer functions"),
    "derivatives": (lambda net: sw.studies.motion_sensitivities(net, ["end J2.omega"], t_end=1.0), "derivatives"),
    "derivatives of frequencies": (sw.studies.frequency_sensitivities, "no frequencies"),
}


@pytest.mark.parametrize(("ask", "why"), ASKED.values(), ids=ASKED)
def test_what_differential_equations_alone_have_is_refused_beside_a_sampled_controller(ask: Any, why: str) -> None:
    with pytest.raises(sw.SimulationError, match=f"'pi' acts every 0.05 s .*{why}"):
        ask(plant(sampled_pi()))


@pytest.mark.parametrize(
    "ask",
    [sw.Network.circuit, sw.Network.dual, lambda net: sw.reduce.refer(net, "a")],
    ids=["circuit", "dual", "referred"],
)
@pytest.mark.parametrize("part", [pi_controller(), sampled_pi()], ids=["continuous", "sampled"])
def test_what_becomes_another_network_refuses_what_measures_by_name(ask: Any, part: sw.Component) -> None:
    with pytest.raises(sw.NetworkError, match=r"'pi' measures 'J2.omega' by name"):
        ask(plant(part))


def test_derivatives_by_parameters_go_through_a_continuous_loop() -> None:
    """Against central differences of motions with steps of 1e-4, whose own error is 1e-8."""
    net = plant(pi_controller())
    derivative = sw.studies.motion_sensitivities(net, ["end J2.omega"], t_end=2.0, parameters=["J2.J"])
    ends = [net.simulate(2.0, parameters={"J2.J": 3.0 + h}, rtol=1e-12)["J2.omega"][-1] for h in (1e-4, -1e-4)]
    assert derivative.slopes["end J2.omega"].item() == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-6)


def test_a_symbolic_transfer_function_is_that_of_the_closed_loop() -> None:
    net = plant(pi_controller())
    symbolic = net.equations().transfer_function("pi.tau", "J2.omega")
    model = net.compile().linearize(inputs=("pi.tau",), outputs=("J2.omega",))
    np.testing.assert_allclose(sorted_rates(symbolic.poles()), sorted_rates(np.linalg.eigvals(model.A)), rtol=1e-9)


def test_lagranges_equations_of_a_loop_are_kirchhoffs() -> None:
    assert plant(pi_controller()).lagrangian().proof


def test_equations_print_the_law_of_the_controller() -> None:
    text = plant(pi_controller()).equations().latex("state")
    assert r"\frac{d x_{\mathrm{pi},1}}{d t} &= w_{\mathrm{pi},1}" in text
    assert r"w_{\mathrm{pi},1} &= r_{\mathrm{pi}} - \omega_{2}" in text
    assert r"\tau_{u,\mathrm{pi}} &= r_{\mathrm{pi}} + 0.5 \, x_{\mathrm{pi},1} - \omega_{2}" in text


def machine(controller: sw.Component) -> sw.Network:
    net = sw.Network("machine")
    net.add(controller, "p")
    net.add(sw.DCMachine("dc", k=0.5, R=1.0, L=0.01), "p", "ground", "shaft")
    net.add(sw.Inertia("J", J=0.1), "shaft")
    net.add(sw.Damper("bearing", d=0.02), "shaft")
    return net


def test_a_voltage_holds_the_speed_of_a_machine() -> None:
    """In the end i = d omega / k = 2 A and u = k omega + R i = 27 V."""
    controller = {"A": 0.0, "B": [[1.0, 0.0]], "C": 20.0, "D": [[2.0, 0.1]], "measured": ["J.omega", "dc.i"]}
    net = machine(sw.StateSpaceController("speed", acts="voltage", reference=50.0, **controller))
    steady = net.compile().steady_state()
    assert (steady["J.omega"], steady["dc.i"]) == pytest.approx((50.0, 2.0), rel=1e-12)
    motion = net.simulate(5.0)
    assert motion["speed.u"][-1] == pytest.approx(27.0, rel=1e-6)
    assert motion["speed.i"][-1] == pytest.approx(2.0, rel=1e-6)
    units = motion.observer.units
    assert (units["speed.x_1"], units["speed.u"]) == ("1", "V")


def test_two_outputs_act_at_two_nodes() -> None:
    gains = np.array([[1.0, 0.2, 0.1], [0.3, 1.0, -0.1]])
    measured = ["J1.omega", "b.omega", "shaft.tau"]
    net = plant(spring=sw.Spring("shaft", c=50.0))
    net.add(
        sw.StateSpaceController("K", D=gains, measured=measured, acts=["torque"] * 2, setpoints=[3, 3, 0]), "a", "b"
    )
    motion = net.simulate(1.0)
    errors = np.array([3.0 - motion["J1.omega"], 3.0 - motion["J2.omega"], -motion["shaft.tau"]])
    np.testing.assert_allclose([motion["K.tau_1"], motion["K.tau_2"]], gains @ errors, atol=1e-12)


@pytest.mark.parametrize("part", [pi_controller(), sampled_pi(setpoints=[2.0])], ids=["continuous", "sampled"])
def test_a_controller_is_read_back_from_a_file_and_a_pickle(part: sw.Component, tmp_path: Path) -> None:
    net = plant(part)
    net.save(tmp_path / "net.toml")
    assert sw.Network.load(tmp_path / "net.toml") == net
    assert pickle.loads(pickle.dumps(part)) == copy.deepcopy(part) == part  # noqa: S301
    assert "pi" in net.draw().svg


def test_a_controller_within_a_network_measures_what_stands_beside_it() -> None:
    drive = sw.Network("drive", ports=("out",))
    drive.add(sw.Inertia("J1", J=1.0), "rotor")
    drive.add(sw.Spring("s", c=100.0, d=1.0), "rotor", "out")
    gains = {"D": [[2.0, 1.0, 0.5]], "measured": ["J1.omega", "rotor.omega", "out.omega"]}
    drive.add(sw.StateSpaceController("p", **gains), "rotor")
    net = sw.Network("two drives")
    for name in ("first", "second"):
        net.add(drive, "shaft", name=name)
    net.add(sw.Inertia("load", J=2.0), "shaft")
    motion = net.simulate(1.0, initial={"first.J1.omega": 3.0})
    for name in ("first", "second"):
        wanted = -3.0 * motion[f"{name}.J1.omega"] - 0.5 * motion["load.omega"]
        np.testing.assert_allclose(motion[f"{name}.p.tau"], wanted, atol=1e-12)


def test_from_control_takes_matrices_names_and_sample_time() -> None:
    law = control.ss([[0.9]], [[1.0]], [[2.0]], [[3.0]], 0.1, inputs=["J2:omega"], outputs=["motor:tau"])
    part = sw.StateSpaceController.from_control("law", law, reference=4.0)
    given = {"A": 0.9, "B": 1.0, "C": 2.0, "D": 3.0, "sample_time": 0.1, "measured": "J2.omega"}
    assert part == sw.StateSpaceController("law", reference=4.0, **given)


MEASURABLE = [
    ("J3.omega", "there is no part or node 'J3'. There are: 'J1', 'shaft', 'J2'"),
    ("J2.tau", "follows from others at the same instant. Of 'J2' it can measure: J2.omega"),
    ("shaft.tau", "it can measure: shaft.tau_c, shaft.omega_rel"),
    ("J2.phi", "does not exist"),
    ("omega", "there is no part or node ''"),
]


@pytest.mark.parametrize(("name", "why"), MEASURABLE)
def test_what_cannot_be_measured_is_named_with_what_can(name: str, why: str) -> None:
    with pytest.raises(sw.NetworkError) as raised:
        plant(pi_controller(measured=name)).compile()
    assert why in str(raised.value)


GAIN = {"measured": "J2.omega", "D": 1.0}
WRONG: list[tuple[dict[str, Any], str]] = [
    ({"D": [[1.0, 2.0]]}, r"D has the shape \(1, 2\) and must have \(1, 1\)"),
    ({"A": [[1.0, 2.0]], "B": 1.0, "C": 1.0}, r"A has the shape \(1, 2\)"),
    ({"A": [[1.0], [2.0, 3.0]]}, "no matrix of up to 64 by 64 finite numbers"),
    ({"D": float("nan")}, "no matrix"),
    ({"D": "[[1"}, "no matrix"),
    ({"D": "a"}, "D cannot be read: 'a' is no matrix"),
    ({"D": None}, "A, B and C, or D must be given"),
    ({"D": None, "A": -1.0, "B": 1.0}, "C must be given"),
    ({"D": [[1.0 + 2.0j]]}, "no matrix"),
    ({"D": True}, "no matrix"),
    ({"D": np.ones((1, 1, 1))}, "no matrix"),
    ({"C": np.ones((2, 0)), "D": np.ones((2, 1))}, r"Name what each output is: acts=\['torque', 'torque'\]"),
    ({"D": np.zeros((65, 1))}, "no matrix"),
    ({"acts": "heat"}, "acts = 'heat' is none of: torque, force, current, voltage"),
    ({"sample_time": 0.0}, "sample_time must be above 0"),
    ({"sample_time": "fast"}, "sample_time must be a number"),
    ({"setpoints": [1.0, 2.0]}, "must be 1 number"),
    ({"measured": []}, "must be 1 to 64 names"),
    ({"measured": 3}, "must be 1 to 64 names"),
    ({"reference": sw.omega}, "reference depends on omega, but may depend on the time t alone"),
    ({"reference": sympy.Symbol("r")}, "reference depends on r"),
]


@pytest.mark.parametrize(("values", "why"), WRONG, ids=[str(number) for number in range(len(WRONG))])
def test_what_does_not_fit_together_is_refused_with_the_shape_that_would(values: dict[str, Any], why: str) -> None:
    with pytest.raises(sw.ParameterError, match=f"(?s)StateSpaceController 'K': .*{why}"):
        sw.StateSpaceController("K", **{**GAIN, **values})


@pytest.mark.parametrize(
    ("above", "below", "why"),
    [
        ([1, 0], [1], "of degree 0, below the numerator's 1"),
        ([1], [0, 0], "denominator = .* not zeros alone"),
        ([1], [], "denominator = .* not zeros alone"),
        ([], [1], r"numerator = \[\] must be one row"),
        ([[1, 2], [3, 4]], [1, 1, 1, 1, 1], "numerator = .* must be one row"),
        ([1, 1], [1e-300, 1], "next to zero beside the others"),
        ([float("nan")], [1], r"numerator cannot be read: \[nan\]"),
    ],
)
def test_a_transfer_function_without_states_for_it_is_refused(above: Any, below: Any, why: str) -> None:
    with pytest.raises(sw.ParameterError, match=why):
        pi_controller(numerator=above, denominator=below)


@pytest.mark.parametrize("system", [5, control.tf([1], [1, 2])])
def test_what_has_no_matrices_is_no_controller(system: Any) -> None:
    with pytest.raises(sw.ParameterError, match="has no matrices A, B, C, D"):
        sw.StateSpaceController.from_control("K", system, measured="J2.omega")


def test_a_discrete_system_without_a_sample_time_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match="has no sample time"):
        sw.StateSpaceController.from_control("K", control.ss([], [], [], [[1.0]], dt=True), measured="J2.omega")


def test_more_samples_than_a_run_can_end_steps_at_are_refused() -> None:
    with pytest.raises(sw.ParameterError, match="would sample 1000001 times"):
        plant(sampled_pi()).simulate(1.0, parameters={"pi.sample_time": 1e-6})
