"""What the loads ask of their shaft, at steady speeds; random loads from their seed.

Statistical bounds are set for a false alarm of one in a million, were the seeds drawn anew; the seeds here are fixed.
"""

from __future__ import annotations

import math
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components import noise

FALSE_ALARM = 1e-6
FAST = 10.0
"""A speed in rad/s at which tanh(omega / 0.01) is 1 to the last bit."""


def torque_at(load: sw.Component, omega: float) -> float:
    """Torque on the node at a steady speed."""
    net = sw.Network("steady")
    net.add(sw.SpeedSource("drive", omega=omega), "shaft")
    net.add(load, "shaft")
    return float(net.simulate(1.0)[f"{load.name}.tau"][-1])


def test_crane_travel_is_the_weight_times_the_specific_resistance_at_the_wheel() -> None:
    """Marinkovic 2012 prints 4.0 t, 0.25 m and 22.4 N m, which are w + kappa = 22.4 / (4000 * 9.81 * 0.125)."""
    load = sw.CraneTravel("load", m=4000.0, diameter=0.25, w=0.0042, kappa=22.4 / 4905.0 - 0.0042)
    assert torque_at(load, FAST) == pytest.approx(-22.4, rel=1e-14)
    assert torque_at(load, -FAST) == pytest.approx(22.4, rel=1e-14)
    rounded = sw.CraneTravel("load", m=4000.0, diameter=0.25, w=0.0042, omega_s=0.02)
    assert torque_at(rounded, 0.0) == 0.0
    assert torque_at(rounded, 0.01) == pytest.approx(-4905.0 * 0.0042 * math.tanh(0.5))


def test_wheel_friction_is_of_rolling_and_of_the_bearings() -> None:
    assert sw.CraneTravel.wheel_friction(0.25, 0.0005, 0.002, 0.05) == pytest.approx((0.001 + 0.0001) / 0.25)
    with pytest.raises(sw.ParameterError, match="above 0"):
        sw.CraneTravel.wheel_friction(0.0, 0.0005, 0.002, 0.05)


def test_a_hoist_pulls_downwards_both_ways_and_its_gear_loses_both_ways() -> None:
    load = sw.Hoist("load", m=1000.0, radius=0.2, ratio=40.0, efficiency=0.8)
    weight = 1000.0 * 9.81 * 0.2 / 40.0
    assert torque_at(load, FAST) == pytest.approx(-weight / 0.8)
    assert torque_at(load, -FAST) == pytest.approx(-weight * 0.8)
    ideal = sw.Hoist("load", m=1000.0, radius=0.2, ratio=40.0)
    assert torque_at(ideal, FAST) == torque_at(ideal, -FAST) == pytest.approx(-weight)


@pytest.mark.parametrize("kind", [sw.FanLoad, sw.PumpLoad])
def test_fans_and_pumps_pass_their_nominal_point_along_a_square(kind) -> None:
    load, nominal = kind("load", tau_n=50.0, n_n=1450.0, static=0.2), 2 * math.pi * 1450.0 / 60
    for share in (1.0, 0.5, -0.5):
        wanted = -math.copysign(50.0 * (0.8 * share**2 + 0.2), share)
        assert torque_at(load, share * nominal) == pytest.approx(wanted)


def test_a_conveyor_lifts_rubs_and_drags() -> None:
    load = sw.Conveyor("load", m=800.0, radius=0.25, friction=0.02, incline=0.1, d=30.0)
    weight, drag = 800.0 * 9.81 * 0.25, 30.0 * 0.25**2 * FAST
    up, along = weight * math.sin(0.1), 0.02 * weight * math.cos(0.1)
    assert torque_at(load, FAST) == pytest.approx(-up - along - drag)
    assert torque_at(load, -FAST) == pytest.approx(-up + along + drag)


def test_a_hoist_holds_between_what_it_takes_to_lift_and_to_lower() -> None:
    """Its losses alone: at rest to the last bit inside, and with the surplus torque on the inertia outside."""
    weight, J = 1000.0 * 9.81 * 0.2 / 40.0, 0.5
    for torque, surplus in ((1.2 * weight, 0.0), (0.85 * weight, 0.0), (1.3 * weight, 0.05), (0.7 * weight, -0.1)):
        net = sw.Network("hoist")
        net.add(sw.TorqueSource("motor", tau=torque), "drum")
        net.add(sw.Inertia("J", J=J), "drum")
        net.add(sw.Hoist("load", m=1000.0, radius=0.2, ratio=40.0, efficiency=0.8), "drum")
        speed = net.simulate(1.0)["J.omega"]
        assert speed[-1] == pytest.approx(surplus * weight / J, rel=1e-9, abs=0.0)


WEIGHT = 1000.0 * 9.81 * 0.2 / 40.0
"""At the shaft of the hoist below, N m."""


def hoist(**rounded: float) -> sw.Hoist:
    return sw.Hoist("load", m=1000.0, radius=0.2, ratio=40.0, efficiency=0.8, **rounded)


@pytest.mark.parametrize(("pull", "takes", "friction"), [(1.6, 1.25, 0.25), (0.6, 0.8, 0.2)])
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_the_weight_of_a_hoist_is_lifted_and_only_its_friction_lost(
    pull: float, takes: float, friction: float, engine: str
) -> None:
    """From rest under a constant torque it turns by a t^2 / 2, up or down; friction is a share of the weight."""
    net, J = sw.Network("hoist"), 0.5
    net.add(sw.TorqueSource("motor", tau=pull * WEIGHT), "drum")
    net.add(sw.Inertia("J", J=J), "drum")
    net.add(hoist(), "drum")
    energy = net.simulate(2.0, engine=engine, rtol=1e-10).energy
    turned = (pull - takes) * WEIGHT / J * 2.0**2 / 2
    assert energy.supplied_by["motor"] == pytest.approx(pull * WEIGHT * turned, rel=1e-8)  # 100 rtol
    assert energy.supplied_by["load"] == pytest.approx(-WEIGHT * turned, rel=1e-8)
    assert energy.lost_in["load"] == pytest.approx(friction * WEIGHT * abs(turned), rel=1e-8)
    assert np.diff(energy.lost).min() >= 0.0
    assert energy.residual < 1e-9


@pytest.mark.parametrize("load", [hoist(), sw.Conveyor("load", m=800.0, radius=0.25, friction=0.02, incline=0.1)])
def test_what_is_lifted_and_lowered_again_has_taken_nothing_but_friction(load: sw.Component) -> None:
    """A whole swing of the speed, 2 rad up and 2 rad down."""
    net = sw.Network("swing")
    net.add(sw.SpeedSource("drive", omega=sympy.sin(sw.t)), "shaft")
    net.add(load, "shaft")
    energy = net.simulate(2 * math.pi, rtol=1e-10).energy
    along = 0.02 * 800.0 * 9.81 * 0.25 * math.cos(0.1)
    both_ways = (1 / 0.8 - 0.8) * WEIGHT if isinstance(load, sw.Hoist) else 2 * along
    assert energy.lost_in["load"] == pytest.approx(2.0 * both_ways, rel=1e-10)
    assert energy.supplied_by["drive"] == pytest.approx(energy.lost_in["load"], rel=1e-10)
    assert energy.supplied_by["load"] == pytest.approx(0.0, abs=1e-8 * WEIGHT)


def test_a_rounded_hoist_carries_its_weight_at_rest_and_loses_at_every_speed() -> None:
    load = hoist(omega_s=0.1)
    assert torque_at(load, 0.0) == pytest.approx(-WEIGHT, rel=1e-14)
    assert torque_at(load, FAST) == pytest.approx(-WEIGHT / 0.8)
    assert torque_at(load, -FAST) == pytest.approx(-WEIGHT * 0.8)
    for omega in (-0.2, -0.01, 0.01, 0.2):
        assert (-torque_at(load, omega) - WEIGHT) * omega > 0


def random_load(kind: str, *, intervals: int, seed: float = 1.0, std: float = 10.0) -> np.ndarray:
    """The resistance at the middle of each interval."""
    net = sw.Network("travel")
    net.add(sw.SpeedSource("drive", omega=FAST), "shaft")
    net.add(sw.RandomLoad("w", mean=22.4, std=std, interval=0.05, seed=seed, kind=kind), "shaft")
    times = 0.05 * (np.arange(intervals) + 0.5)
    return -net.simulate(0.05 * intervals, t_eval=times)["w.tau"]


@pytest.mark.slow
def test_a_held_random_load_has_the_asked_distribution_with_nothing_below_zero() -> None:
    """Kolmogorov's test against the normal distribution above zero; below it is what the normal one has there."""
    n = 4000
    sample, normal = np.sort(random_load("held", intervals=n)), NormalDist(22.4, 10.0)
    bound = math.sqrt(math.log(2 / FALSE_ALARM) / 2 / n)
    assert sample[0] == 0.0
    assert abs((sample == 0).mean() - normal.cdf(0.0)) < bound
    wanted = np.array([normal.cdf(value) for value in sample])
    assert np.abs(wanted - (np.arange(n) + 0.5) / n)[sample > 0].max() < bound
    np.testing.assert_array_equal(random_load("held", intervals=5, std=0.0), 22.4)


@pytest.mark.slow
def test_a_random_load_is_a_function_of_time_and_seed_alone() -> None:
    """Not of the length of the run; the sample numbers are those of the noise itself, bit for bit."""
    for kind, function in (("held", noise.held), ("band-limited", noise.smooth)):
        load = random_load(kind, intervals=40, seed=3.0)
        np.testing.assert_array_equal(load, random_load(kind, intervals=60, seed=3.0)[:40])
        places = 0.05 * (np.arange(40) + 0.5) / 0.05
        np.testing.assert_array_equal(load, np.maximum(0.0, 22.4 + 10.0 * function(places, 3.0)))
        assert (load != random_load(kind, intervals=40, seed=4.0)).all()


def test_another_seed_needs_no_new_model() -> None:
    net = sw.Network("travel")
    net.add(sw.SpeedSource("drive", omega=FAST), "shaft")
    net.add(sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05), "shaft")
    model = net.compile()
    for seed in (2.0, 5.0):
        found = model.simulate(1.0, t_eval=[0.01], parameters={"w.seed": seed})["w.tau"]
        assert found == pytest.approx(-22.4 - 10.0 * noise.normal(0, seed))


@pytest.mark.slow
def test_a_random_load_is_saved_by_its_numbers(tmp_path: Path) -> None:
    net = sw.Network("travel")
    net.add(sw.SpeedSource("drive", omega=FAST), "shaft")
    net.add(sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, seed=4.0, kind="band-limited"), "shaft")
    net.add(sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, soil=sw.Soil(5e4, 1e4), buckets=9), "shaft")
    net.save(tmp_path / "travel.toml")
    text = (tmp_path / "travel.toml").read_text()
    assert 'kind = "band-limited"' in text
    assert 'soil = "Soil(mean=50000.0, std=10000.0)"' in text
    first, again = net.simulate(1.0), sw.Network.load(tmp_path / "travel.toml").simulate(1.0)
    for signal in ("w.tau", "dig.tau"):
        np.testing.assert_array_equal(first[signal], again[signal])


def test_a_wrong_kind_is_answered_with_the_kinds() -> None:
    net = sw.Network("travel")
    net.add(sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, kind="white"), "shaft")
    assert any("held, band-limited" in str(problem) for problem in net.check())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["held", "band-limited"])
def test_under_a_random_load_there_is_no_steady_operation_but_at_a_named_time(kind: str) -> None:
    """Held noise has no slope in time, and yet never stops changing."""
    net = sw.Network("random")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.RandomLoad("load", mean=3.0, std=1.0, interval=0.05, kind=kind), "a")
    model = net.compile()
    with pytest.raises(sw.SimulationError, match=r"RandomLoad 'load' changes with time.*take the noise out \(std = 0"):
        model.steady_state()
    assert 290 < model.steady_state(t=1.0)["J.omega"] < 314
    assert 290 < model.steady_state(parameters={"load.std": 0.0})["J.omega"] < 314


def test_a_coulomb_load_of_no_size_has_no_modes_until_it_is_given_one() -> None:
    """Without it 10 N m on 1 kg m^2 are 10 rad/s after a second, and a load of 4 N m takes 4 rad/s of that."""

    def pushed(tau: float) -> sw.Model:
        net = sw.Network("pushed")
        net.add(sw.TorqueSource("push", tau=10.0), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        net.add(sw.CoulombLoad("load", tau=tau), "a")
        return net.compile()

    free, loaded = pushed(0.0), pushed(4.0)
    assert free.cost().operations == {"div": 1}
    for model in (free, loaded):
        for tau in (0.0, 4.0):
            sol = model.simulate(1.0, parameters={"load.tau": tau})
            assert sol["J.omega"][-1] == pytest.approx(10.0 - tau, rel=1e-9)
            assert -sol["load.tau"][-1] == tau
            assert len(sol.phases) == (tau > 0)
