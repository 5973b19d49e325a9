"""The engine that numba compiles makes the steps of scipy's DOP853, and ends at the same events."""

from __future__ import annotations

import numba
import numpy as np
import pytest
import sympy
from hypothesis import given

import shaftwork as sw
from tests.properties.examples import network_of, share_of_examples
from tests.strategies import Network, networks

SCENES = {"crane_start": 10.0, "crane": 10.0, "excavator": 3.0, "shaft_step": 0.02}


def largest_difference(one: sw.Solution, other: sw.Solution) -> float:
    """Over the largest value of each state."""
    differences = np.abs(one.x - other.x).max(axis=0)
    return float((differences / np.maximum(np.abs(other.x).max(axis=0), 1e-9)).max(initial=0.0))


@share_of_examples(0.2)
@given(networks(max_inertias=6))
def test_random_networks_move_as_with_scipy(pieces: Network) -> None:
    model = network_of(pieces).compile()
    try:
        one, other = (model.simulate(0.2, t_eval=11, rtol=1e-9, engine=engine) for engine in ("numba", "scipy"))
    except sw.ParameterError:  # too closely coupled for rows
        assert model.machine_program is None
        return
    # ten tolerances: the error of some dozen steps, in which both are off
    assert np.abs(one.x - other.x).max(initial=0.0) <= 1e-8 * np.abs(other.x).max(initial=1.0)


@pytest.mark.parametrize("scene", SCENES)
def test_scenes_move_as_with_scipy_through_all_their_events(scene: str) -> None:
    model = getattr(sw.scenes, scene)().compile()
    runs = [model.simulate(SCENES[scene], t_eval=51, rtol=1e-9, engine=engine) for engine in ("numba", "scipy")]
    # 1e-6: two runs at 1e-9, each off by some hundred tolerances after dozens of events
    assert largest_difference(*runs) < 1e-6
    assert [event[1:] for event in runs[0].events] == [event[1:] for event in runs[1].events]


def test_tables_and_noise_have_machine_code() -> None:
    net = sw.Network("mill")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    table = sw.Table([-5.0, 0.0, 4.0, 20.0], [0.0, -1.0, 3.0, 9.0])
    law = table(sw.omega) + 0.3 * sw.HeldNoise(sw.t / 0.05, 3)
    net.add(sw.TorqueSource("mill", tau=-law), "rotor")
    net.add(sw.TorqueSource("motor", tau=5.0), "rotor")
    one, other = (net.simulate(4.0, rtol=1e-10, engine=engine) for engine in ("numba", "scipy"))
    assert np.abs(one["J.omega"] - other["J.omega"]).max() < 1e-8 * other["J.omega"].max()


@pytest.mark.parametrize("scene", ["crane", "excavator"])
def test_machine_code_watches_every_switch_of_the_laws(scene: str) -> None:
    model, random = getattr(sw.scenes, scene)().compile(), np.random.default_rng(0)
    _, watched, guards, count, _, p = model.machine_program.bind(model.defaults)
    times, states = random.uniform(0.0, 5.0, 40), random.normal(0.0, 50.0, (40, len(model.states)))
    values, call = np.empty((40, guards + count)), numba.njit(lambda f, t, x, p, y: f(t, x, p, y))
    for time, x, row in zip(times, states, values, strict=True):
        call(watched, time, x, p, row)
    for switch in model.bind().switches(times, states).T:
        # either sign will do, and rounding is of another order
        differences = [np.abs(np.abs(column) - np.abs(switch)).max() for column in values.T]
        assert min(differences) <= 1e-10 * np.abs(switch).max()


def test_between_its_steps_the_motion_is_as_exact_as_at_their_ends() -> None:
    net = sw.Network("oscillator")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("c", c=400.0), "a", "ground")
    net.add(sw.TorqueSource("weak", tau=-1e-30 * sw.omega**3), "a")  # no linear engine
    run = net.simulate(3.0, t_eval="steps", rtol=1e-9, engine="numba", initial={"J.omega": 1.0})
    times = np.linspace(0.0, 3.0, 5001)
    inside = run.dense(times)[:, 0]
    # dense output is of order 7, and the errors of some hundred steps add up
    assert np.abs(inside - np.cos(20 * times)).max() < 1e-6


def test_a_law_without_a_value_is_named_with_its_time() -> None:
    net = sw.Network("run down")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("pull", tau=sympy.sqrt(1 - sw.t)), "a")
    net.add(sw.TorqueSource("drag", tau=-0.1 * sw.omega**3), "a")
    with pytest.raises(sw.SimulationError, match=r"At t = 1(\.0+\d*)? s .*pull.* has no real value"):
        net.simulate(2.0, engine="numba")


def test_its_steps_are_limited() -> None:
    with pytest.raises(sw.SimulationError, match="20 steps were not enough"):
        sw.scenes.crane_start().simulate(10.0, engine="numba", max_steps=20)


def test_waves_and_smooth_noise_are_refused_with_the_next_step() -> None:
    net = sw.Network("rough")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    net.add(sw.TorqueSource("mill", tau=-(sw.omega**3) + sw.SmoothNoise(sw.t / 0.05, 3)), "rotor")
    with pytest.raises(sw.ParameterError, match=r"engine 'numba' needs.*engine='auto'"):
        net.simulate(1.0, engine="numba")


def test_without_heyoka_auto_takes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    find = __import__("importlib.util").util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "heyoka" else find(name))
    monkeypatch.setattr(
        "shaftwork.codegen.compiled_model.find_spec", lambda name: None if name == "heyoka" else find(name)
    )
    run = sw.scenes.crane().simulate(10.0)
    assert run.engine == "numba"
    assert "heyoka is not installed" in run.why


@pytest.mark.parametrize("scene", ["crane", "excavator"])
def test_jacobians_of_many_states_are_those_of_each(scene: str) -> None:
    model, random = getattr(sw.scenes, scene)().compile(), np.random.default_rng(1)
    bound, times, states = model.bind(), random.uniform(0.0, 5.0, 5), random.normal(0.0, 50.0, (5, len(model.states)))
    for many, time, x in zip(bound.jacobians(times, states), times.tolist(), states, strict=True):
        one = bound.jacobian(time, x).toarray()
        np.testing.assert_allclose(many, one, atol=1e-12 * np.abs(one).max())  # sums in another order


def test_a_motion_that_laws_drive_back_to_their_jump_is_refused_as_by_scipy() -> None:
    net = sw.Network("driven back")
    net.add(sw.TorqueSource("motor", tau=1 - 3 * sympy.sign(sw.omega - 1)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    with pytest.raises(sw.SimulationError, match="drive the motion back"):
        net.simulate(1.0, engine="numba")


def hidden_in_turning() -> sw.Network:
    """A stiff coupling, at whose ends all turns 1e5 times as fast as it twists, and a load that swings."""
    net = sw.Network("hidden")
    net.add(sw.TorqueSource("motor", tau=200 - sw.omega), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("coupling", c=3e6, d=1500.0), "a", "b")
    net.add(sw.Inertia("J2", J=0.05), "b")
    net.add(sw.Spring("shaft", c=2e4, d=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    net.add(sw.TorqueSource("fan", tau=-0.01 * sw.omega**2 * (1 + 0.5 * sympy.sin(7 * sw.t))), "c")
    return net


READ = {
    "excavator_train": ("gear 7.tau", "mesh 4.omega_rel", "motor.tau"),
    "crane_train": ("gear 5.tau", "mesh 1.omega_rel"),
    "hidden": ("J2.tau", "coupling.omega_rel", "coupling.tau", "shaft.omega_rel"),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka"])
@pytest.mark.parametrize("scene", READ)
def test_what_is_a_small_difference_of_large_states_is_as_right_as_they_are(scene: str, engine: str) -> None:
    """Net torques on gears and the twist of meshes, in the midst of a motion as at its ends; against Taylor series."""
    net = hidden_in_turning() if scene == "hidden" else getattr(sw.scenes, scene)()
    model, times = net.compile(), np.linspace(0.0, 1.0, 1002)[1:]
    run = model.simulate(1.0, rtol=1e-8, engine="numba")
    right = model.simulate(1.0, rtol=1e-12, engine=engine)  # type: ignore[arg-type]
    values, expected = run.at(times), right.at(times)
    for name in READ[scene]:
        # 100 rtol at the ends of steps. Some end beyond the edge of stability, and inside these dense output of a fast
        # motion is off by another factor of ten.
        error = np.abs(values[name] - expected[name]).max() / np.abs(expected[name]).max()
        assert error < 1e-5, name
        error_at_most = np.quantile(np.abs(values[name] - expected[name]), 0.95) / np.abs(expected[name]).max()
        assert error_at_most < 1e-6, name
