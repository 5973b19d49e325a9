"""Shafts that start wound up, and drives that come to rest under load, in every model of the shaft."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from tests.properties.examples import share_of_examples

GEOMETRY = {"length": 1.7, "diameter": 0.031}
MESHES = (
    sw.OneSpring(),
    sw.Lumped(1),
    sw.Lumped(7),
    sw.Lumped(5, ends="full"),
    sw.Spectral(2),
    sw.Spectral(9),
    sw.Auto(500.0, 1e-3),
    sw.CentralDifference(6),
    sw.CentralDifference(9, order=4),
    sw.CentralDifference(8, closure="printed"),
    sw.CentralDifference(8, form="paper"),
)
TORQUES = st.floats(-1e3, 1e3).filter(lambda torque: abs(torque) > 1e-3)


def pair(model: ShaftModel, **shaft: float) -> sw.Network:
    """Two discs and a shaft between them."""
    net = sw.Network("pair")
    net.add(sw.Inertia("J1", J=0.05), "a")
    net.add(sw.Shaft("line", **GEOMETRY, **shaft, model=model), "a", "b")
    net.add(sw.Inertia("J2", J=0.2), "b")
    return net


def held(model: ShaftModel, torque: float, stiffness: float | None) -> sw.Network:
    """A torque on a shaft whose other end is held, by itself or by a spring."""
    net = sw.Network("held")
    net.add(sw.TorqueSource("motor", tau=torque), "a")
    net.add(sw.Inertia("J", J=0.05), "a")
    net.add(sw.Shaft("line", **GEOMETRY, model=model), "a", "b")
    if stiffness is not None:
        net.add(sw.Spring("holder", c=stiffness), "b", "wall")
    net.add(sw.Ground("wall"), "b" if stiffness is None else "wall")
    return net


def start(net: sw.Network, initial: dict[str, float]) -> sw.Solution:
    model = net.compile()
    engine = "wave" if model.form.waves else "scipy"
    return model.simulate(1e-6, initial=initial, t_eval=[0.0, 1e-6], engine=engine)


@pytest.mark.slow
@share_of_examples(0.05)
@given(st.sampled_from(MESHES), TORQUES, st.sampled_from([0.0, 4.0]), st.sampled_from([-5.0, 0.0, 0.3]))
def test_a_torque_stands_all_along_the_shaft(model: ShaftModel, torque: float, damping: float, speed: float) -> None:
    """Inside, with the dampers' part; at the ends less the share of the mesh's inertia; to rounding."""
    sol = start(pair(model, damping=damping), {"line.tau": torque, "J1.omega": speed, "J2.omega": 0.0})
    size = abs(torque) + damping * abs(speed) / GEOMETRY["length"]
    np.testing.assert_allclose(sol["line.tau"][0, 1:-1], torque, rtol=0, atol=1e-10 * size)
    assert sol["J1.omega"][0] == speed
    if isinstance(model, sw.OneSpring):
        assert sol["line.tau_a"][0] == pytest.approx(torque, abs=1e-10 * size)


@share_of_examples(0.05)
@given(TORQUES, st.sampled_from([("tau",), ("tau_a",), ("tau_b",), ("tau_a", "tau_b")]), st.sampled_from([0.0, 0.05]))
def test_a_wave_reads_the_torque_that_was_asked(torque: float, names: tuple[str, ...], friction: float) -> None:
    """Nothing moves at the start, and no inertia of the shaft is at its ends."""
    sol = start(pair(sw.Wave(), friction=friction), {f"line.{name}": torque for name in names})
    for name in ("line.tau_a", "line.tau_b"):
        assert sol[name][0] == pytest.approx(torque, rel=1e-12)
    if not friction:  # a bearing in the middle takes its share as soon as it turns
        np.testing.assert_allclose(sol["line.tau"][0], torque, rtol=1e-12)
    assert abs(sol["J1.omega"][0]) < 1e-12 * abs(torque)


@pytest.mark.slow
def test_a_wave_reads_its_start_before_the_first_wave_has_crossed() -> None:
    """Against a fine mesh, up to a third of the delay: 2e-3 is its polynomial at kinks, read between stations."""
    given = {"line.tau": 5.0, "J1.omega": 1.0, "J2.omega": -2.0}
    wave, mesh = (pair(m).simulate(2e-4, initial=given, t_eval=4) for m in (sw.Wave(9), sw.Spectral(32)))
    for name, size in (("line.tau", 5.0), ("line.omega", 2.0)):
        for row, fine in zip(wave[name], mesh[name], strict=True):
            read = np.interp(wave.places[name], mesh.places[name], fine)
            assert np.abs(row - read)[1:-1].max() < 2e-3 * size


@pytest.mark.slow
def test_a_wound_up_shaft_lets_go_alike_in_all_models() -> None:
    """Against the wave, after a while of many delays: what meshes differ by is the sharp front, not the swing."""
    times = np.linspace(0, 0.02, 41)
    exact = pair(sw.Wave()).simulate(0.02, initial={"line.tau": 5.0}, t_eval=times)["J1.omega"]
    for model, accuracy in ((sw.OneSpring(), 2e-2), (sw.Lumped(30), 1e-4), (sw.Spectral(12), 1e-4)):
        speeds = pair(model).simulate(0.02, initial={"line.tau": 5.0}, t_eval=times)["J1.omega"]
        assert np.abs(speeds - exact).max() < accuracy * np.abs(exact).max(), model


@pytest.mark.parametrize("model", MESHES[1:])
def test_the_torque_of_one_end_of_a_mesh_is_refused_for_that_along_the_shaft(model: ShaftModel) -> None:
    """What is read at an end counts the inertia that the mesh has there, so it would not be what was asked."""
    for name in ("line.tau_a", "line.tau_b"):
        with pytest.raises(sw.ParameterError, match=r"initial=\{'line.tau': ...\}"):
            start(pair(model), {name: 5.0})


@pytest.mark.parametrize(("model", "reason"), [(sw.Wave(), "one torque all along"), (sw.OneSpring(), "contradicts")])
def test_two_torques_are_refused_where_there_is_one(model: ShaftModel, reason: str) -> None:
    for one, other in (("tau_a", "tau_b"), ("tau", "tau_b")):
        with pytest.raises(sw.ParameterError, match=reason):
            start(pair(model), {f"line.{one}": 5.0, f"line.{other}": 2.0})


def test_a_torque_beside_all_states_of_another_motion_contradicts_them() -> None:
    model = held(sw.Lumped(4), 20.0, None).compile()
    with pytest.raises(sw.ParameterError, match="contradicts"):
        model.simulate(1e-4, initial=model.steady_state() | {"line.tau": 5.0})


@pytest.mark.slow
@share_of_examples(0.05)
@given(st.sampled_from((*MESHES[1:], sw.Wave())), TORQUES, st.sampled_from([0.5, 3.0, 7.1]))
def test_a_wound_up_shaft_behind_a_gear_contradicts_nothing(model: ShaftModel, torque: float, ratio: float) -> None:
    net = pair(model, friction=0.01)
    net.add(sw.Gear("gear", ratio=ratio), "b", "c")
    net.add(sw.Shaft("second", **GEOMETRY, model=model), "c", "d")
    net.add(sw.Inertia("J3", J=0.1), "d")
    sol = start(net, {"line.tau": torque, "second.tau": 2 * torque, "J3.omega": 0.0})
    for shaft, asked in (("line", torque), ("second", 2 * torque)):
        read = sol[f"{shaft}.tau"][0, 1:-1]
        np.testing.assert_allclose(read[:1], asked, rtol=1e-9)


HOLDING = (*MESHES, *(sw.Spectral(n) for n in range(3, 25, 3)), sw.Lumped(40), sw.CentralDifference(30), sw.Wave())


@pytest.mark.slow
@share_of_examples(0.05)
@given(st.sampled_from(HOLDING), st.sampled_from([1e-3, 20.0, 1000.0]), st.sampled_from([None, 300.0, 1e5]))
def test_a_drive_comes_to_rest_under_load(model: ShaftModel, torque: float, stiffness: float | None) -> None:
    """The torque is that of the motor all along, and the speeds are rounding of the energy that it has wound up."""
    found = held(model, torque, stiffness).compile().steady_state()
    torques = np.array([value for name, value in found.items() if ".tau" in name])
    speeds = np.array([value for name, value in found.items() if name.endswith("omega") or ".omega_" in name])
    np.testing.assert_allclose(torques, torque, rtol=1e-9)
    assert np.abs(speeds).max() < 1e-12 * torque


@pytest.mark.parametrize("model", [sw.Lumped(9), sw.Spectral(8)])
def test_a_drive_without_load_coasts_to_standstill(model: ShaftModel) -> None:
    net = pair(model)
    net.add(sw.ViscousLoad("load", d=0.5), "b")
    found = net.compile().steady_state(initial={"J1.omega": 10.0, "J2.omega": 10.0, "line.tau": 3.0})
    assert max(map(abs, found.values())) < 1e-12


@pytest.mark.parametrize("jolt", [0.0, 10.0])
def test_what_a_source_jolts_at_the_start_has_not_yet_run_along_a_shaft(jolt: float) -> None:
    """The sun takes ring and carrier along at once; inside the shaft behind the carrier speeds are as without it."""
    net = sw.Network("planets")
    net.add(sw.SpeedSource("drive", omega=jolt), "sun")
    net.add(sw.PlanetaryGear("planets", ratio=2.0), "sun", "ring", "carrier")
    net.add(sw.Inertia("J1", J=1.0), "ring")
    net.add(sw.Inertia("J2", J=2.0), "carrier")
    net.add(sw.Shaft("line", **GEOMETRY, model=sw.Lumped(4)), "carrier", "end")
    net.add(sw.Inertia("J3", J=0.2), "end")
    sol = start(net, {"J3.omega": 3.0})
    assert [sol[f"line.omega_{k}"][0] for k in (1, 2, 3)] == pytest.approx([0.75, 1.5, 2.25], rel=1e-12)
    assert (sol["J2.omega"][0] != 0.0) == (jolt != 0.0)


@pytest.mark.parametrize("speed", [3 * sympy.sin(12 * sw.t), sympy.Max(0, sympy.sin(12 * sw.t))])
def test_a_start_value_may_be_the_one_that_a_moving_source_has(speed: sympy.Expr) -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=speed), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=10.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    assert net.simulate(0.1, initial={"J1.omega": 0.0, "J2.omega": 0.0})["J1.omega"][0] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(sw.ParameterError, match=r"J1\.omega = 1e-06 contradicts"):
        net.simulate(0.1, initial={"J1.omega": 1e-6})
