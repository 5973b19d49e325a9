"""A motion goes on where another one ended, as if there had been no end: `initial=` takes the motion."""

from __future__ import annotations

import pickle
import warnings
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw

STEEL = {"density": 7900.0, "shear_modulus": 77.5e9}


@cache
def crane() -> sw.Model:
    """A motor that is switched off at 1 s, when a brake comes on, a gap, and a load that sticks."""
    net = sw.Network("crane")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Backlash("gap", gap=0.02, c=1000.0, d=1.0), "a", "b")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-10.0, 1.0, before=10.0)), "a")
    net.add(sw.CoulombLoad("load", tau=2.0), "b")
    net.add(sw.Brake("brake", tau=20.0, t_on=1.0), "a")
    return net.compile()


def wheel() -> sw.Network:
    """A wheel that is driven to 12 rad/s and then held back, with a brake that comes on at 10 rad/s, for good."""
    net = sw.Network("overspeed")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-22.0, start=0.6, before=20.0)), "shaft")
    net.add(sw.Inertia("J", J=1.0), "shaft")
    net.add(sw.Brake("brake", tau=5.0, on=sw.omega - 10), "shaft")
    return net


@cache
def overspeed() -> sw.Model:
    """The wheel, compiled once."""
    return wheel().compile()


@cache
def roll(load: float = 0.0, model: object = None) -> sw.Model:
    """A motor, a long shaft and a roll, with friction where it is given."""
    net = sw.Network("roll")
    net.add(sw.TorqueSource("motor", tau=3000.0), "a")
    net.add(sw.Inertia("J1", J=4.0), "a")
    net.add(sw.Shaft("s", length=8.0, diameter=0.16, **STEEL, model=model or sw.Wave()), "a", "b")
    net.add(sw.Shaft("u", length=3.0, diameter=0.13, **STEEL, model=model or sw.Wave()), "b", "c")
    net.add(sw.Inertia("J2", J=60.0), "c")
    if load:
        net.add(sw.CoulombLoad("load", tau=load, omega_s=0.1), "c")
    return net.compile()


def stored(motion: sw.Solution) -> sw.Solution:
    """The motion as it is read from where it was stored."""
    return pickle.loads(pickle.dumps(motion))  # type: ignore[no-any-return]  # noqa: S301 (its own)


def agree(rest: sw.Solution, whole: sw.Solution, names: tuple[str, ...], accuracy: float) -> None:
    """That the second part is the rest of the whole: values, extremes, energy."""
    cut, end = float(rest.t[0]), float(rest.t[-1])
    times = np.linspace(cut, end, 301)[1:]
    for name in names:
        size = np.abs(whole[name]).max()
        off = np.abs(rest.at(times)[name] - whole.at(times)[name]).max()
        assert off <= accuracy * size, (name, off / size)
    assert rest.energy_residual < 1e-9


def joined(first: sw.Solution, rest: sw.Solution, whole: sw.Solution) -> None:
    """That both parts have the events of the whole, each of them once."""
    both = (*first.events, *rest.events)
    assert [event[1:] for event in both] == [event[1:] for event in whole.events]
    np.testing.assert_allclose([event[0] for event in both], [event[0] for event in whole.events], rtol=1e-7)


CRANE = ("J1.omega", "J2.omega", "gap.phi", "gap.tau", "brake.tau")
WAVES = ("J1.omega", "J2.omega", "s.tau_a", "u.tau_b", "s.tau", "u.omega", "s.energy")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "cut"),
    [
        *(("heyoka", cut) for cut in (0.03, 0.5, 0.7, 1.0, 1.1, 1.7)),
        *(pytest.param(engine, 1.0, marks=pytest.mark.slow) for engine in ("scipy", "sundials", "scipy-radau")),
    ],
)
def test_two_runs_joined_are_one_run(engine: str, cut: float) -> None:
    """In the open gap and stuck, in contact, at the jump of the motor, while the brake slips, and at rest."""
    whole, first = (crane().simulate(t, rtol=1e-10, engine=engine) for t in (3.0, cut))
    rest = crane().simulate(3.0, initial=first, rtol=1e-10, engine=engine)
    assert rest.t[0] == cut
    agree(rest, whole, CRANE, 1e-7)
    joined(first, rest, whole)
    assert rest.phases[0].modes == next(row.modes for row in whole.phases if row.end > cut)


@pytest.mark.slow
@given(st.floats(0.001, 2.999))
def test_a_run_may_be_cut_at_any_instant(cut: float) -> None:
    whole, first = crane().simulate(3.0), crane().simulate(cut)
    for before in (first, whole.at([cut])):
        rest = crane().simulate(3.0, initial=before)
        agree(rest, whole, CRANE, 1e-8)
        assert len(rest.events) + len(first.events) - len(whole.events) in (0, 1)  # one of the very cut
    late = whole.at(whole.t[whole.t >= cut])
    for name in ("J1.omega", "gap.tau"):
        assert rest.max(name) >= late[name].max() - 1e-8 * np.abs(whole[name]).max()


@pytest.mark.slow
@given(st.floats(1e-4, 0.0499))
def test_waves_may_be_cut_at_any_instant(cut: float) -> None:
    """Beside constant torques, on the lattice and marched, and beside a load that is not linear."""
    for load in (0.0, 500.0):
        whole, first = roll(load).simulate(0.05), roll(load).simulate(cut)
        for before in (first, whole.at([cut])):
            agree(roll(load).simulate(0.05, initial=before), whole, WAVES, 3e-8)


@pytest.mark.slow
def test_the_extremes_of_the_second_part_are_those_of_the_whole() -> None:
    """The largest torques come after the cuts, in waves that were on their way there."""
    whole = roll().simulate(0.05)
    for name in ("s.tau_a", "u.tau_b", "s.tau"):
        peak = whole.max(name)
        rest = roll().simulate(0.05, initial=roll().simulate(peak.t - 1e-3))
        assert rest.max(name) == pytest.approx(peak, rel=1e-8)
        assert rest.max(name).t == pytest.approx(peak.t, abs=1e-6)


def test_a_motion_in_many_short_parts_is_the_whole() -> None:
    """Each is shorter than a wave takes to cross a shaft, 1 and 2.6 ms."""
    part, whole = roll().simulate(1e-3), roll().simulate(0.02)
    for end in np.arange(3, 41) * 5e-4:
        part = roll().simulate(float(end), initial=part)
    for name in ("J1.omega", "J2.omega", "s.tau_a", "u.tau_b"):
        assert part[name][-1] == pytest.approx(whole[name][-1], rel=1e-7)


def test_waves_without_inertias_go_on() -> None:
    """Nothing is stored but what is on its way."""
    net = sw.Network("lines")
    net.add(sw.TorqueSource("motor", tau=1.0 - sw.Step(1.0, start=1e-4)), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "l")
    model = net.compile()
    whole = model.simulate(2e-3)
    for cut in (1e-4, 2e-4, 1.1e-3):
        agree(model.simulate(2e-3, initial=model.simulate(cut)), whole, ("line.tau", "line.omega", "line.energy"), 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("cut", [0.45, 0.55, 0.9, 1.6, 3.0])
def test_a_brake_that_has_come_on_stays_on(cut: float) -> None:
    """From 0.5 s; from 0.9 s on the speed is below the one at which it comes on, and at 3 s it is locked."""
    whole, first = overspeed().simulate(4.0), overspeed().simulate(cut)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rest = overspeed().simulate(4.0, initial=first)
    agree(rest, whole, ("J.omega", "brake.tau"), 1e-9)
    joined(first, rest, whole)
    assert whole.phases[-1].modes == {"brake": "locked"}
    assert sum(event[2:] == ("released", "slipping forward") for event in whole.events) == 1


@pytest.mark.slow
def test_a_stored_motion_goes_on_and_so_does_one_that_went_on_before_it_was_stored() -> None:
    whole, first = overspeed().simulate(4.0), stored(overspeed().simulate(0.9))
    second = stored(overspeed().simulate(1.6, initial=first))
    agree(overspeed().simulate(4.0, initial=second), whole, ("J.omega", "brake.tau"), 1e-9)
    assert second.initial == {"J.omega": pytest.approx(whole.at([0.9])["J.omega"][0])}
    waves = stored(roll().simulate(0.02, initial=roll().simulate(0.01)))
    agree(roll().simulate(0.05, initial=waves), roll().simulate(0.05), WAVES, 1e-8)
    np.testing.assert_allclose(waves["s.tau"][0], roll().simulate(0.02).at([0.01])["s.tau"][0], rtol=1e-7)


SLOW = (pytest.param(engine, marks=pytest.mark.slow) for engine in ("scipy-radau", "sundials", "banded"))


@pytest.mark.parametrize("engine", ["exact", "scipy", "heyoka", *SLOW])
def test_a_motion_without_modes_goes_on_with_each_engine(engine: str) -> None:
    """With an inertia that is no state behind the gear, and an angle that counts from the first start."""
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=sw.Step(0.0, start=0.5, before=5.0)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=3.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Spring("shaft", c=500.0, d=2.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    model = net.compile(angles=["J3"])
    whole = model.simulate(1.0, engine=engine, rtol=1e-10)
    for cut in (0.2, 0.5, 0.77):
        rest = model.simulate(1.0, initial=model.simulate(cut, engine=engine, rtol=1e-10), engine=engine, rtol=1e-10)
        agree(rest, whole, ("J1.omega", "J2.omega", "J3.omega", "shaft.tau", "J3.phi"), 1e-7)


def rigid(*parts: sw.Component) -> sw.Model:
    """A prescribed speed that jumps at 0.5 s, with two inertias behind a planetary gear, and more at the ring."""
    net = sw.Network("planetary")
    net.add(sw.SpeedSource("drive", omega=sw.Step(5.0, start=0.5, before=1.0)), "sun")
    net.add(sw.PlanetaryGear("gear", ratio=2.0), "sun", "ring", "carrier")
    net.add(sw.Inertia("Jr", J=3.0), "ring")
    net.add(sw.Inertia("Jc", J=1.0), "carrier")
    net.add(sw.ViscousLoad("load", d=0.3), "carrier")
    for part in parts:
        net.add(part, "ring")
    return net.compile()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:jumping source")
@pytest.mark.parametrize("friction", [(), (sw.DryFriction("f", tau_c=0.1),)], ids=["free", "with friction"])
def test_what_jumps_at_the_cut_jumps_once(friction: tuple[sw.Component, ...]) -> None:
    """The first run ends before the jump, and what is read of a motion at that instant is after it."""
    model = rigid(*friction)
    whole, first = model.simulate(1.0), model.simulate(0.5)
    before = whole.at([0.5 - 1e-9])
    for name in ("Jr.omega", "Jc.omega"):
        assert first[name][-1] == pytest.approx(before[name][0], abs=1e-8)
    for motion in (first, whole.at([0.5]), model.simulate(0.3)):
        agree(model.simulate(1.0, initial=motion), whole, ("Jr.omega", "Jc.omega"), 1e-10)


def test_the_torque_of_a_spring_and_the_speeds_are_kept_where_parameters_change() -> None:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=100.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    model = net.compile()
    first = model.simulate(0.3)
    rest = model.simulate(1.0, initial=first, parameters={"shaft.c": 300.0, "J2.J": 9.0, "motor.tau": 0.0})
    for name in ("J1.omega", "J2.omega", "shaft.tau"):
        assert rest[name][0] == first[name][-1]
    damped = model.simulate(1.0, initial=first, parameters={"shaft.d": 1.0})  # other equations, compiled anew
    assert damped["J1.omega"][0] == first["J1.omega"][-1]


@pytest.mark.parametrize("brake", [(), (sw.Brake("brake", tau=1.0, t_on=9.0),)], ids=["smooth", "through phases"])
def test_another_ratio_keeps_the_momentum_that_the_gear_passes_on(brake: tuple[sw.Component, ...]) -> None:
    """J1 and J2 are pulled to speeds that go together: J1 w1 + J2 w2 / i is what it was with the speeds before."""
    net = sw.Network("gear")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=6.0), "b")
    for part in brake:
        net.add(part, "b")
    model = net.compile()
    first = model.simulate(1.0, initial={"J1.omega": 4.0})
    rest = model.simulate(2.0, initial=first, parameters={"gear.ratio": 3.0})
    after = (1.0 * 4.0 + 6.0 * 2.0 / 3.0) / (1.0 + 6.0 / 9.0)
    np.testing.assert_allclose(rest["J1.omega"], after, rtol=1e-12)
    np.testing.assert_allclose(rest["J2.omega"], after / 3.0, rtol=1e-12)


def test_a_brake_keeps_its_mode_with_another_torque_and_begins_anew_with_another_time() -> None:
    first = overspeed().simulate(0.9)
    weak = overspeed().simulate(1.0, initial=first, parameters={"brake.tau": 2.5})
    assert weak.phases[0].modes == {"brake": "slipping forward"}
    np.testing.assert_allclose(weak["brake.tau"], 2.5, rtol=1e-12)
    late = overspeed().simulate(1.0, initial=first, parameters={"brake.t_on": 0.95})
    assert late.phases[0].modes == {"brake": "released"}


def test_a_rigid_contact_opens_in_a_wider_gap_and_a_narrower_one_is_refused() -> None:
    net = sw.Network("pushed")
    net.add(sw.TorqueSource("motor", tau=3.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=0.1), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    model = net.compile()
    whole, first = model.simulate(2.0), model.simulate(1.0)
    assert first.phases[-1].modes == {"gap": "in contact"}
    same = model.simulate(2.0, initial=first)
    agree(same, whole, ("J1.omega", "J2.omega", "gap.phi"), 1e-10)
    assert same.events == ()
    wide = model.simulate(2.0, initial=first, parameters={"gap.gap": 0.2})
    assert [row.modes["gap"] for row in wide.phases] == ["open", "in contact"]
    assert wide["gap.phi"][[0, -1]] == pytest.approx([0.05, 0.1])
    with pytest.raises(sw.ParameterError, match=r"'gap' would start at a twist of 0\.05 rad.*0\.02 rad"):
        model.simulate(2.0, initial=first, parameters={"gap.gap": 0.04})


def test_a_sweep_goes_on_from_a_motion() -> None:
    first, options = overspeed().simulate(0.9), {"measures": ["end J.omega"], "processes": 1}
    found = sw.studies.sweep(wheel(), {"brake.tau": [5.0, 4.0]}, t_end=1.0, initial=first, **options)
    strong, weak = found.measures["end J.omega"]
    assert strong == pytest.approx(overspeed().simulate(1.0)["J.omega"][-1], rel=1e-9)
    assert weak - strong == pytest.approx(0.1, rel=1e-6)
    with pytest.raises(sw.ParameterError, match=r"t_end = 0\.5 must be a finite time after t_start = 0\.9"):
        sw.studies.sweep(wheel(), {"brake.tau": [5.0]}, t_end=0.5, initial=first, **options)
    with pytest.raises(sw.ParameterError, match=r"sweep\(steady=True\) takes start values by name, not a motion"):
        sw.studies.sweep(wheel(), {"brake.tau": [5.0]}, t_end=1.0, initial=first, steady=True, **options)


def test_a_motion_goes_on_at_its_end_alone() -> None:
    first = crane().simulate(0.5)
    assert crane().simulate(0.6, t_start=0.5, initial=first).t[0] == 0.5
    with pytest.raises(sw.ParameterError, match=r"t_start = 0\.4 .*ended that goes on, 0\.5 s.*sol\.at\(\[t\]\)"):
        crane().simulate(0.6, t_start=0.4, initial=first)
    with pytest.raises(sw.ParameterError, match=r"t_end = 0\.5 must be a finite time after"):
        crane().simulate(0.5, initial=first)


def test_a_motion_of_another_network_is_refused_with_what_differs() -> None:
    text = r"'overspeed', which is another network than 'crane': 'J1' is not there instead of Inertia \(a a\)"
    with pytest.raises(sw.ParameterError, match=text):
        crane().simulate(2.0, initial=overspeed().simulate(1.0))
    with pytest.raises(sw.ParameterError, match=r"'s' is Shaft .*Lumped.* instead of Shaft .*Wave"):
        roll().simulate(0.02, initial=roll(model=sw.Lumped(4)).simulate(0.01))


def test_an_angle_that_was_not_recorded_is_refused() -> None:
    net = sw.Network("wheel")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    first, angles = net.simulate(1.0), net.simulate(1.0, angles=["J"])
    assert net.simulate(2.0, initial=angles)["J.omega"][-1] == pytest.approx(2.0)
    with pytest.raises(sw.ParameterError, match=r"does not tell 'J\.phi', stored here.*angles="):
        net.simulate(2.0, initial=first, angles=["J"])


@pytest.mark.parametrize("other", [{"s.diameter": 0.2}, {"s.length": 9.0}, {"s.friction": 0.1}])
def test_waves_do_not_go_on_in_another_shaft(other: dict[str, float]) -> None:
    first = roll().simulate(0.01)
    with pytest.raises(sw.ParameterError, match="Shaft 's' has another impedance, delay or friction than in the mot"):
        roll().simulate(0.02, initial=first, parameters=other)
    heavy = roll().simulate(0.02, initial=first, parameters={"J2.J": 90.0})
    assert heavy["s.tau_a"][0] == pytest.approx(first["s.tau_a"][-1], rel=1e-9)


def test_a_motion_in_leaps_does_not_know_its_waves_and_says_so() -> None:
    net = sw.Network("long run")
    net.add(sw.TorqueSource("motor", tau=1.0), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "l")
    net.add(sw.Inertia("Jm", J=0.11), "l")
    model = net.compile()
    first = model.simulate(40.0, t_eval=3)
    with pytest.warns(sw.AccuracyWarning, match=r"without the waves.*a long run leaps.*t_eval='steps'"):
        rest = model.simulate(40.001, initial=first)
    assert rest["Je.omega"][0] == pytest.approx(first["Je.omega"][-1], rel=1e-12)


def test_a_motion_is_no_start_value_of_a_steady_state_or_a_derivative() -> None:
    first = overspeed().simulate(0.5)
    with pytest.raises(sw.ParameterError, match="steady_state takes start values by name, not a motion"):
        overspeed().steady_state(initial=first)
    with pytest.raises(sw.ParameterError, match="motion_sensitivities takes start values by name, not a motion"):
        sw.studies.motion_sensitivities(wheel(), ["end J.omega"], t_end=1.0, initial=first)


@pytest.mark.parametrize(
    ("t_off", "modes"), [(20.0, ["locked"]), (2.5, ["locked", "released"]), (1.5, ["released"]), (2.0, ["released"])]
)
def test_another_time_to_switch_off_releases_a_brake_when_it_comes(t_off: float, modes: list[str]) -> None:
    """The brake came on at 1 s by a speed that it has long ended: at 2 s only the motion knows that it is on."""
    net = sw.Network("held")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=5.0, on=sw.omega - 1.0, t_off=10.0), "a")
    held = net.simulate(2.0)
    sol = net.simulate(3.0, initial=held, parameters={"brake.t_off": t_off})
    assert [row.modes["brake"] for row in sol.phases] == modes
    assert sol["J.omega"][-1] == pytest.approx(max(0.0, 3.0 - max(2.0, t_off)), abs=1e-9)
