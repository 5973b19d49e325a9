"""Shafts that start beside prescribed speeds: as one with them where their speeds say so, in every model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from tests.pipeline.test_starts_of_shafts import GEOMETRY, MESHES

MODELS = (*MESHES, sw.Wave())
SPEED = 10.0
SPAN = 0.01
"""s; 18 times what a wave takes along the shaft."""
ROUNDING = 1e-9
"""rad/s, and parts of the torque with which the shaft would start from standstill, 870 N m."""
JOLT = 870.0

each_model = pytest.mark.parametrize("model", MODELS, ids=str)
some_models = pytest.mark.parametrize("model", [sw.Lumped(3), sw.CentralDifference(4), sw.Wave()], ids=str)


def driven(model: ShaftModel, speed: Any = SPEED, **shaft: float) -> sw.Network:
    """A prescribed speed, a shaft and an inertia."""
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=speed), "a")
    net.add(sw.Shaft("line", **GEOMETRY, **shaft, model=model), "a", "b")
    net.add(sw.Inertia("J", J=0.2), "b")
    return net


def assert_turns_as_one(sol: sw.Solution, *shafts: str, speed: float = SPEED) -> None:
    for shaft in shafts or ("line",):
        assert np.abs(sol[f"{shaft}.omega"] - speed).max() < ROUNDING
        assert np.abs(sol[f"{shaft}.tau"]).max() < ROUNDING * JOLT


@pytest.mark.slow
@each_model
def test_a_shaft_starts_as_one_with_a_prescribed_speed_and_an_inertia(model: ShaftModel) -> None:
    sol = driven(model).simulate(SPAN, initial={"J.omega": SPEED})
    assert np.abs(sol["J.omega"] - SPEED).max() < ROUNDING
    assert_turns_as_one(sol)


@pytest.mark.slow
@each_model
def test_a_loaded_shaft_starts_as_it_stays(model: ShaftModel) -> None:
    """A damper takes 40 N m at the end, with which the shaft is wound up all along."""
    net = driven(model)
    net.add(sw.ViscousLoad("load", d=4.0), "b")
    for initial in ({"J.omega": SPEED, "line.tau": 40.0}, net.compile().steady_state()):
        sol = net.simulate(SPAN, initial=initial)
        assert np.abs(sol["J.omega"] - SPEED).max() < ROUNDING
        assert np.abs(sol["line.tau"] - 40.0).max() < ROUNDING * JOLT


@each_model
def test_a_source_that_moves_on_does_so_as_from_rest(model: ShaftModel) -> None:
    """No speed is distinguished: what turns with 10 rad/s and is then sped up has the torques of a start from rest."""
    rise, times = sw.Ramp(5.0, duration=SPAN), np.linspace(0, SPAN, 41)
    at_rest = driven(model, rise).simulate(SPAN, t_eval=times)
    turning = driven(model, SPEED + rise).simulate(SPAN, t_eval=times, initial={"J.omega": SPEED})
    assert np.abs(turning["J.omega"] - SPEED - at_rest["J.omega"]).max() < 1e-7
    assert np.abs(turning["line.tau"] - at_rest["line.tau"]).max() < 1e-7 * JOLT
    assert np.abs(at_rest["line.tau"]).max() > 0.1 * JOLT


@each_model
def test_speeds_run_straight_from_a_source_to_another_speed(model: ShaftModel) -> None:
    sol = driven(model).simulate(1e-6, initial={"J.omega": 4.0}, t_eval=[0.0, 1e-6])
    expected = SPEED - 6.0 * sol.places["line.omega"] / GEOMETRY["length"]
    np.testing.assert_allclose(sol["line.omega"][0], expected, rtol=ROUNDING)
    assert np.abs(sol["line.tau"][0, 1:-1]).max(initial=0.0) < ROUNDING * JOLT


@some_models
@pytest.mark.parametrize("named", ["a.omega", "drive.omega", "b.omega", "brake.omega"])
def test_a_shaft_between_two_sources_starts_as_one_with_the_one_that_is_named(model: ShaftModel, named: str) -> None:
    net = sw.Network("two sources")
    net.add(sw.SpeedSource("drive", omega=SPEED), "a")
    net.add(sw.Shaft("line", **GEOMETRY, model=model), "a", "b")
    net.add(sw.SpeedSource("brake", omega=SPEED), "b")
    assert_turns_as_one(net.simulate(SPAN, initial={named: SPEED}))


@some_models
def test_a_source_behind_a_gear_counts_by_the_speed_of_the_shaft(model: ShaftModel) -> None:
    net = sw.Network("geared")
    net.add(sw.SpeedSource("drive", omega=3 * SPEED), "fast")
    net.add(sw.Gear("gear", ratio=3.0), "fast", "a")
    net.add(sw.Inertia("wheel", J=0.1), "a")
    net.add(sw.Shaft("line", **GEOMETRY, model=model), "a", "b")
    net.add(sw.Inertia("J", J=0.2), "b")
    assert_turns_as_one(net.simulate(SPAN, initial={"J.omega": SPEED}))


@some_models
def test_shafts_in_a_row_start_as_one_where_the_node_between_is_given(model: ShaftModel) -> None:
    net = driven(model)
    net.add(sw.Shaft("second", **GEOMETRY, model=model), "b", "c")
    net.add(sw.Inertia("J2", J=0.1), "c")
    assert_turns_as_one(net.simulate(SPAN, initial={"J.omega": SPEED, "J2.omega": SPEED}), "line", "second")


@some_models
def test_a_source_relative_to_a_given_speed_counts_by_both(model: ShaftModel) -> None:
    net = sw.Network("relative")
    net.add(sw.Inertia("J1", J=0.3), "frame")
    net.add(sw.SpeedSource("drive", omega=4.0), "a", "frame")
    net.add(sw.Shaft("line", **GEOMETRY, model=model), "a", "b")
    net.add(sw.Inertia("J", J=0.2), "b")
    assert_turns_as_one(net.simulate(SPAN, initial={"J1.omega": 6.0, "J.omega": SPEED}))


def planets(model: ShaftModel | None, sun: Any) -> sw.Network:
    """The sun takes ring and carrier along at once; a shaft is behind the carrier."""
    net = sw.Network("planets")
    net.add(sw.SpeedSource("drive", omega=sun), "sun")
    net.add(sw.PlanetaryGear("planets", ratio=2.0), "sun", "ring", "carrier")
    net.add(sw.Inertia("J1", J=0.01), "ring")
    net.add(sw.Inertia("J2", J=0.01), "carrier")
    if model is not None:
        net.add(sw.Shaft("line", **GEOMETRY, model=model), "carrier", "end")
        net.add(sw.Inertia("J3", J=0.2), "end")
    return net


@some_models
def test_a_given_speed_counts_as_it_is_beside_a_source(model: ShaftModel) -> None:
    """All three members of the planetary gear turn alike, and the shaft with them."""
    initial = {"J2.omega": SPEED, "J3.omega": SPEED}
    assert_turns_as_one(planets(model, SPEED).simulate(SPAN, initial=initial))


@pytest.mark.parametrize("initial", [None, {"J3.omega": 0.0}])
def test_a_wave_is_no_inertia_where_a_source_jolts_at_the_start(initial: dict[str, float] | None) -> None:
    """Ring and carrier start as without the shaft, which has not moved by then."""
    alone = planets(None, SPEED).simulate(1e-6, t_eval=[0.0, 1e-6])
    sol = planets(sw.Wave(), SPEED).simulate(1e-6, t_eval=[0.0, 1e-6], initial=initial)
    for name in ("J1.omega", "J2.omega"):
        assert sol[name][0] == pytest.approx(alone[name][0], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("model", MESHES, ids=str)
def test_beside_a_wave_a_mesh_starts_as_without_it(model: ShaftModel) -> None:
    """The two shafts turn apart: what is stored in the one is not touched by the other."""
    initial = {"J1.omega": 4.0, "J2.omega": -2.0, "line.tau": 5.0}
    net = sw.Network("mixed")
    net.add(sw.Inertia("J1", J=0.05), "a")
    net.add(sw.Shaft("line", **GEOMETRY, damping=2.0, model=model), "a", "b")
    net.add(sw.Inertia("J2", J=0.2), "b")
    alone = net.simulate(1e-4, initial=initial, t_eval=[0.0, 1e-4])
    net.add(sw.Shaft("wave", **GEOMETRY, model=sw.Wave()), "b", "c")
    beside = net.simulate(1e-4, initial=initial, t_eval=[0.0, 1e-4])
    for name in alone.states:
        assert beside.x[0, beside.states.index(name)] == pytest.approx(alone.x[0, alone.states.index(name)], abs=1e-9)
