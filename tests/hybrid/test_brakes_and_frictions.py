"""Brakes on times and conditions, and frictions that share, wait for or hold each other, beside closed forms."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import quad

import shaftwork as sw

ENGINES = ("heyoka", "numba", "scipy", "sundials")
# Every motion here is a polynomial of time or nearly one, and events are located far below the tolerance of the run.
EXACT = 1e-9


def wheel(*parts: sw.Component, J: float = 2.0) -> sw.Network:
    """Parts on the node of one inertia."""
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=J), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


def driven(omega: Any, *parts: sw.Component) -> sw.Network:
    """A prescribed speed, and parts between it and an inertia."""
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=omega), "belt")
    net.add(sw.Inertia("J", J=1.0), "block")
    for part in parts:
        net.add(part, "belt", "block")
    return net


def words(sol: sw.Solution) -> list[tuple[str, str, str]]:
    """The events without their times."""
    return [event[1:] for event in sol.events]


def times(sol: sw.Solution) -> list[float]:
    """The times of the events."""
    return [event[0] for event in sol.events]


def test_a_brake_whose_torque_rises_straight_stops_when_its_integral_says() -> None:
    net = wheel(sw.Brake("brake", tau=6.0, t_on=0.5, t_rise=1.0))
    sol = net.simulate(6.0, initial={"J.omega": 10.0}, engine="scipy")
    # the momentum of 20 N m s less 3 while the torque rises, less 6 a second after that
    assert times(sol) == pytest.approx([0.5, 1.5 + 17.0 / 6.0], abs=EXACT)
    assert words(sol) == [("brake", "released", "slipping forward"), ("brake", "slipping forward", "locked")]
    assert sol.at([1.0])["J.omega"] == pytest.approx([10.0 - 0.5**2 * 6.0 / 4.0], abs=EXACT)
    assert sol.at([1.0])["brake.tau"] == pytest.approx([3.0], abs=EXACT)


def test_a_brake_whose_torque_rises_with_a_lag_takes_the_momentum_of_its_exponential() -> None:
    sol = wheel(sw.Brake("brake", tau=6.0, t_on=0.5, t_lag=0.4)).simulate(3.0, initial={"J.omega": 10.0})
    since = sol.t[sol.t > 0.5] - 0.5
    wanted = 10.0 - 3.0 * (since - 0.4 * (1.0 - np.exp(-since / 0.4)))
    np.testing.assert_allclose(sol["J.omega"][sol.t > 0.5], wanted, atol=1e-7)  # some tens of steps at rtol = 1e-8


def test_a_brake_holds_until_it_is_released_and_the_wheel_goes_on_from_rest() -> None:
    sol = wheel(sw.TorqueSource("pull", tau=4.0), sw.Brake("brake", tau=10.0, t_on=1.0, t_off=3.0)).simulate(4.0)
    # 2 rad/s after one second, -3 rad/s^2 from there
    assert times(sol) == pytest.approx([1.0, 1.0 + 2.0 / 3.0, 3.0], abs=EXACT)
    assert [event[2] for event in words(sol)] == ["slipping forward", "locked", "released"]
    held = (sol.t > 5.0 / 3.0 + EXACT) & (sol.t < 3.0)
    assert not sol["J.omega"][held].any()
    assert sol["J.omega"][-1] == pytest.approx(2.0, abs=EXACT)


@pytest.mark.parametrize(
    ("condition", "t_on", "begins"),
    [(sw.omega - 5, 0.0, 2.5), (sw.phi - 3, 0.0, math.sqrt(3.0)), (sw.omega - 5, 3.0, 3.0)],
)
@pytest.mark.parametrize("engine", ENGINES[:2])
def test_a_brake_acts_from_when_its_condition_holds(condition: Any, t_on: float, begins: float, engine: str) -> None:
    """And goes on when the condition no longer holds, as the speed falls below it at once."""
    net = wheel(sw.TorqueSource("pull", tau=4.0), sw.Brake("brake", tau=10.0, on=condition, t_on=t_on))
    sol = net.simulate(8.0, engine=engine)
    assert times(sol) == pytest.approx([begins, begins + 2.0 * begins / 3.0], abs=EXACT)
    assert words(sol) == [("brake", "released", "slipping forward"), ("brake", "slipping forward", "locked")]
    assert sol["J.omega"][-1] == 0.0


def test_a_torque_of_zero_brakes_nothing() -> None:
    model = wheel(sw.Brake("brake", tau=1.0), sw.TorqueSource("pull", tau=sw.Step(2.0, 1.0))).compile()
    assert (model.simulate(1.0, initial={"J.omega": 3.0}, parameters={"brake.tau": 0.0})["J.omega"] == 3.0).all()
    sol = model.simulate(2.0, parameters={"brake.tau": 0.0})
    assert sol["J.omega"][-1] == pytest.approx(1.0, abs=EXACT)
    assert times(sol) == pytest.approx([1.0])


FALLING = {
    "formula": 5.0 - 5.0 * sw.t,
    "ramp": sw.Ramp(-10.0, 2.0, before=5.0),
    "table": sw.Table([0.0, 2.0], [5.0, -5.0]),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("law", FALLING)
def test_a_brake_whose_torque_falls_below_zero_runs_free_and_never_drives(law: str, engine: str) -> None:
    """2.5 N m s of the momentum are taken up to 1 s, when the torque passes zero, and nothing is given back."""
    sol = wheel(sw.Brake("brake", tau=FALLING[law])).simulate(6.0, initial={"J.omega": 10.0}, engine=engine, rtol=1e-10)
    assert sol["J.omega"][-1] == pytest.approx(10.0 - 2.5 / 2.0, abs=EXACT)
    assert sol.energy.lost_in["brake"] == pytest.approx(10.0**2 - 8.75**2, abs=100 * EXACT)  # errors of speed times 20
    assert np.diff(sol.energy.lost).min() >= 0.0
    assert not sol["brake.tau"][sol.t > 1.0].any()
    assert sol.events == ()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_brake_whose_torque_comes_and_goes_holds_a_load_lets_it_run_free_and_brakes_it_again(engine: str) -> None:
    """2 w' = 3 - max(0, 6 cos t) from where the brake gives way, at cos t = 1/2."""
    net = wheel(sw.TorqueSource("pull", tau=3.0), sw.Brake("brake", tau=6.0 * sympy.cos(sw.t)))
    sol = net.simulate(7.0, engine=engine, rtol=1e-10)
    given_way, half = math.pi / 3, math.pi / 2
    assert times(sol) == pytest.approx([given_way], abs=EXACT)
    free = (3.0 * (half - given_way) - 6.0 * (1.0 - math.sin(given_way))) / 2.0
    again = free + 3.0 * math.pi / 2.0
    assert sol.at([half, 3 * half])["J.omega"] == pytest.approx([free, again], abs=EXACT)
    wanted = again + (3.0 * (7.0 - 3 * half) - 6.0 * (math.sin(7.0) + 1.0)) / 2.0
    assert sol["J.omega"][-1] == pytest.approx(wanted, abs=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_brake_of_no_torque_lets_a_load_swing_through_rest(engine: str) -> None:
    """2 w' = sin(2 t), as if it were not there, though it locks for an instant at each rest."""
    net = wheel(sw.TorqueSource("pull", tau=sympy.sin(2.0 * sw.t)), sw.Brake("brake", tau=-1.0 - sw.t))
    sol = net.simulate(12.0, engine=engine, rtol=1e-10, initial={"J.omega": -0.25})
    np.testing.assert_allclose(sol["J.omega"], -np.cos(2.0 * sol.t) / 4.0, atol=EXACT)
    assert sol.energy.lost_in["brake"] == pytest.approx(0.0, abs=EXACT)


def test_a_clutch_that_is_engaged_slips_again_when_it_is_asked_for_more() -> None:
    net = sw.Network("pair")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Clutch("clutch", tau=3.0), "a", "b")
    net.add(sw.TorqueSource("engine", tau=2.0 * sw.t), "a")
    sol = net.simulate(5.0, rtol=1e-10)
    # half of the torque goes through the clutch, so it gives way at 6 N m
    assert times(sol) == pytest.approx([3.0], abs=EXACT)
    assert sol.at([2.0])["clutch.tau"] == pytest.approx([2.0], abs=EXACT)
    assert sol["clutch.tau"][-1] == pytest.approx(3.0, abs=EXACT)
    assert sol["J2.omega"][-1] == pytest.approx(4.5 + 3.0 * 2.0, abs=1e-8)


@pytest.mark.parametrize(("pull", "shares"), [(2.0, (2.0, 0.0)), (5.0, (3.0, 2.0)), (-5.0, (-3.0, -2.0))])
def test_of_two_frictions_on_a_shaft_the_first_carries_what_it_can(pull: float, shares: tuple[float, float]) -> None:
    net = wheel(sw.TorqueSource("pull", tau=pull), sw.DryFriction("one", tau_c=3.0), sw.DryFriction("other", tau_c=4.0))
    sol = net.simulate(1.0)
    assert not sol["J.omega"].any()
    # it gives way at its limit by one part in 1e12 and slips there
    np.testing.assert_allclose(sol["one.tau"][1:], shares[0], atol=1e-11)
    np.testing.assert_allclose(sol["other.tau"][1:], shares[1], atol=1e-11)


@pytest.mark.parametrize(("first", "second"), [(4.0, 3.0), (3.0, 4.0)])
def test_frictions_in_line_with_a_damper_between_slip_at_the_weakest(first: float, second: float) -> None:
    net = wheel(sw.TorqueSource("pull", tau=5.0))
    net.add(sw.DryFriction("inner", tau_c=first), "wheel", "middle")
    net.add(sw.DryFriction("outer", tau_c=second), "middle")
    net.add(sw.Damper("oil", d=1e-6), "middle")
    sol = net.simulate(1.0)
    slips = {name: sol.phases[-1].modes[name].startswith("slipping") for name in ("inner", "outer")}
    assert slips == {"inner": first < second, "outer": second < first}
    assert sol["J.omega"][-1] == pytest.approx(1.0, abs=1e-6)  # the damper's 1e-6 N m beside 2 kg m^2


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_behind_a_gear_holds_the_whole_group_up_to_its_torque_over_the_ratio(engine: str) -> None:
    net = wheel(sw.TorqueSource("pull", tau=sw.t))
    net.add(sw.Gear("gear", ratio=3.0), "wheel", "slow")
    net.add(sw.Inertia("J2", J=9.0), "slow")
    net.add(sw.DryFriction("shoe", tau_c=6.0), "slow")
    sol = net.simulate(4.0, engine=engine, rtol=1e-10)
    assert times(sol) == pytest.approx([2.0], abs=EXACT)
    assert not sol["J.omega"][sol.t < 2.0].any()
    # 3 kg m^2 in all on the fast side
    assert sol["J.omega"][-1] == pytest.approx((16.0 / 2.0 - 2.0 - 2.0 * 2.0) / 3.0, abs=1e-8)
    assert sol["J2.omega"][-1] == pytest.approx(sol["J.omega"][-1] / 3.0, rel=1e-12)


@pytest.mark.parametrize(("start", "events"), [(-1.0, 1), (0.0, 0)])
def test_friction_that_a_prescribed_speed_turns_never_rests(start: float, events: int) -> None:
    """At zero speed it passes from one side to the other, or starts on the side to which the speed goes."""
    net = driven(start + sw.t, sw.Spring("spring", c=10.0))
    net.add(sw.DryFriction("shoe", tau_c=2.0), "belt")
    sol = net.simulate(2.0)
    assert words(sol) == [("shoe", "slipping backward", "slipping forward")][:events]
    assert times(sol) == pytest.approx([1.0][:events], abs=EXACT)
    clear = sol.t != -start
    np.testing.assert_allclose(sol["shoe.tau"][clear], 2.0 * np.sign(sol.t + start)[clear])


def test_a_gear_that_rubs_follows_a_prescribed_speed_through_zero() -> None:
    """At rest it holds, which a prescribed speed does not let it: power turns round at once."""
    net = sw.Network("hoist")
    net.add(sw.SpeedSource("drive", omega=4.0 * sympy.sin(sw.t)), "rotor")
    net.add(sw.LossyGear("gear", ratio=10.0, efficiency=0.5, efficiency_back=0.3), "rotor", "drum")
    net.add(sw.Inertia("J", J=5.0), "drum")
    net.add(sw.TorqueSource("load", tau=-20.0), "drum")
    sol = net.simulate(4.0)
    assert [phase.modes["gear"] for phase in sol.phases] == ["driving forward", "driven backward"]
    assert times(sol) == pytest.approx([math.pi], abs=EXACT)
    at_drum = 20.0 + 5.0 * 0.4 * np.cos(sol.t)
    wanted = np.where(sol.t < math.pi, at_drum / 5.0, at_drum * 0.03)
    np.testing.assert_allclose(sol["drive.tau"], wanted, rtol=1e-9)


@pytest.mark.parametrize("begins", [0.0, 1.0])
def test_friction_takes_no_speed_along_at_once_where_a_prescribed_speed_jumps(begins: float) -> None:
    """Whether it slips before, at 0.5 rad/s, or is stuck."""
    net = driven(sw.Step(-2.0, 1.0, before=1.0), sw.DryFriction("shoe", tau_c=0.5))
    sol = net.simulate(1.5, initial={"J.omega": begins})
    ((time, *change),) = sol.events
    assert time == 1.0
    assert change == ["shoe", "stuck" if begins else "slipping forward", "slipping backward"]
    before = 1.0 if begins else 0.5
    assert sol.at([1.0])["J.omega"] == pytest.approx([before], abs=EXACT)
    assert sol["J.omega"][-1] == pytest.approx(before - 0.25, abs=EXACT)
    assert sol.energy_residual < 1e-9


def test_a_brake_gives_way_to_a_freewheel_that_a_prescribed_speed_locks() -> None:
    """Locked both, they would contradict the speed from its zero on."""
    net = driven(sw.t - 1.0, sw.Freewheel("clutch"))
    net.add(sw.Brake("brake", tau=1.0), "block")
    sol = net.simulate(2.0)
    assert words(sol) == [("clutch", "free", "locked"), ("brake", "locked", "slipping forward")]
    assert times(sol) == pytest.approx([1.0, 1.0], abs=EXACT)
    assert sol["drive.tau"][-1] == pytest.approx(2.0, abs=EXACT)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_breakaway_ends_in_slipping_though_nothing_tells_it_from_sticking_at_first(engine: str) -> None:
    """On a belt that gathers speed: at breakaway the block's acceleration is the belt's but for less than rounding."""
    net = driven(sw.t - 1.0, sw.DryFriction("shoe", tau_c=3.0))
    net.add(sw.TorqueSource("pull", tau=4.0 * sw.t), "block")
    sol = net.simulate(2.0, engine=engine, initial={"J.omega": -1.0}, rtol=1e-10)
    assert words(sol) == [("shoe", "stuck", "slipping backward")]
    assert times(sol) == pytest.approx([1.0], abs=EXACT)
    assert sol["J.omega"][-1] == pytest.approx(3.0, abs=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("omega_s", [0.5, 0.1, 1e-3])
@pytest.mark.parametrize("engine", [*ENGINES, "scipy-radau"])
def test_no_engine_steps_over_the_rise_of_friction_before_a_stop(engine: str, omega_s: float) -> None:
    """Up to there the torque is constant, and steps are as long as they may be; the time is that of an integral."""
    net = wheel(sw.DryFriction("shoe", tau_c=3.0, tau_s=15.0, omega_s=omega_s), J=1.0)
    (event,) = net.simulate(5.0, engine=engine, rtol=1e-9, initial={"J.omega": 10.0}).events
    speeds = [0.0, *(omega_s * k for k in (0.5, 1.0, 2.0, 4.0, 8.0)), 10.0]

    def slowness(omega: float) -> float:
        return 1.0 / (3.0 + 12.0 * math.exp(-((omega / omega_s) ** 2)))

    wanted = sum(quad(slowness, *ends, epsabs=1e-14)[0] for ends in pairwise(speeds))
    assert event[0] == pytest.approx(wanted, abs=1e-8)
    assert event[3] == "stuck"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("names", "carried"),
    [(("load", "brake"), (-3.0, 0.0)), (("brake", "load"), (3.0, 0.0)), (("weak", "brake"), (2.0, 1.0))],
)
def test_after_a_stop_the_first_part_carries_as_much_as_it_can(
    names: tuple[str, str], carried: tuple[float, float], engine: str
) -> None:
    """As if they had always been at rest: what slipped last, and which way, tells nothing about who holds."""
    parts = {
        "load": sw.CoulombLoad("load", tau=5.0),
        "brake": sw.Brake("brake", tau=40.0, t_on=0.5),
        "weak": sw.DryFriction("weak", tau_c=2.0),
    }
    net = wheel(sw.TorqueSource("pull", tau=3.0), *(parts[name] for name in names))
    sol = net.simulate(3.0, initial={"J.omega": 10.0}, engine=engine)
    assert sol["J.omega"][-1] == 0.0
    assert [sol[f"{name}.tau"][-1] for name in names] == pytest.approx(carried, abs=EXACT)  # torques of numbers alone
    # each of them stops once, and the weak one gives way in the same instant
    stops = [event[1] for event in sol.events if event[0] > 0.6]
    assert sorted(stops) == sorted(name for name in names if name != "weak")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_condition_that_rounding_leaves_at_its_limit_has_come_true(engine: str) -> None:
    net = wheel(sw.TorqueSource("pull", tau=6.0), sw.Brake("brake", tau=40.0, on=sw.phi - 30), J=3.0)
    sol = net.simulate(8.0, engine=engine)
    # 2 rad/s^2 over 30 rad, and back with (40 - 6) / 3 rad/s^2
    begins = math.sqrt(30.0)
    assert times(sol) == pytest.approx([begins, begins * (1 + 2.0 * 3.0 / 34.0)], abs=EXACT)
    assert words(sol) == [("brake", "released", "slipping forward"), ("brake", "slipping forward", "locked")]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_given_time_is_that_of_its_event_to_the_last_digit(engine: str) -> None:
    """Times that binary numbers do not hold, two parts at one time, and a time beside which nothing moves."""
    brake, second = sw.Brake("brake", tau=4.0, t_on=0.1, t_off=0.7), sw.Brake("second", tau=4.0, t_on=0.7)
    sol = wheel(sw.TorqueSource("pull", tau=3.0), brake, second).simulate(
        1.3, engine=engine, t_eval=[0.05, 0.1, 0.7, 1.2]
    )
    switched = [(time, part) for time, part, before, after in sol.events if "released" in (before, after)]
    assert switched == [(0.1, "brake"), (0.7, "brake"), (0.7, "second")]
    # at the time itself the torque is the one after it
    assert sol["brake.tau"].tolist() == [0.0, 4.0, 0.0, 0.0]
    assert sol["second.tau"][2] == 3.0


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("t_on", [3.0, 2.7, 0.1 + 0.2 * 9])
def test_a_given_time_at_which_the_condition_holds_already_is_met_to_the_last_digit(t_on: float, engine: str) -> None:
    brake = sw.Brake("brake", tau=30.0, t_on=t_on, on=sw.omega - 10)
    sol = wheel(sw.TorqueSource("pull", tau=20.0), brake).simulate(4.0, engine=engine)
    assert times(sol)[0] == t_on


@pytest.mark.parametrize("first", ["load", "brake"])
def test_a_hoist_and_a_brake_that_both_hold_carry_in_the_order_of_the_network(first: str) -> None:
    """The friction of the hoist takes all that it can before the brake takes the rest, or nothing behind the brake.

    Then the brake holds the weight alone, and the hoist shows no more than that.
    """
    parts = {"load": sw.Hoist("load", m=20.0, radius=0.1, efficiency=0.81), "brake": sw.Brake("brake", tau=50.0)}
    sol = wheel(parts[first], *(part for name, part in parts.items() if name != first)).simulate(1.0)
    weight = 20.0 * 9.81 * 0.1
    held = {"load": 0.81 * weight, "brake": weight}[first]
    assert not sol["J.omega"].any()
    assert sol["brake.tau"][-1] == pytest.approx(-held, rel=1e-12)
    assert sol["load.tau"][-1] == pytest.approx(-held, rel=1e-12)


@pytest.mark.parametrize(("start", "ends"), [(5.0, 2.0), (1.0, 2.0)])
def test_a_torque_of_constant_power_has_a_pole_at_rest_where_a_brake_beside_it_never_holds(
    start: float, ends: float
) -> None:
    """2 w' = 100 / w - 50 goes to 2 rad/s, as 100 W over 50 N m."""
    net = wheel(sw.TorqueSource("drive", tau=100.0 / sw.omega), sw.Brake("brake", tau=50.0))
    sol = net.simulate(10.0, initial={"J.omega": start})
    assert sol["J.omega"][-1] == pytest.approx(ends, rel=1e-9)
    assert sol.events == ()


@pytest.mark.parametrize("t_off", [-1.0, 1.0, 3.0])
@pytest.mark.parametrize(
    ("part", "never"), [(sw.Brake, "gives torque"), (sw.Clutch, "gives torque"), (sw.Switch, "closes")]
)
def test_a_time_off_that_is_not_later_than_the_time_on_is_refused(part: Any, never: str, t_off: float) -> None:
    given = {} if part is sw.Switch else {"tau": 1.0}
    with pytest.raises(sw.ParameterError, match=f"never {never}") as caught:
        part("part", t_on=3.0, t_off=t_off, **given)
    two = "up to 1 s and again from 3 s, give two parts: one with t_off = 1 alone, one with t_on = 3 alone."
    assert str(caught.value).endswith(two) == (t_off == 1.0)


def test_two_brakes_are_one_that_opens_and_closes_again_and_say_so() -> None:
    """J w' = 300 N m while both are open; the second stops it with 600 N m."""
    net = wheel(sw.TorqueSource("load", tau=300.0), sw.Brake("holding", tau=900.0, t_off=0.5))
    net.add(sw.Brake("closing", tau=900.0, t_on=2.0), "wheel")
    sol = net.simulate(5.0)
    assert [row.name for row in sol.phases] == [
        "holding locked, closing released",
        "holding released, closing released",
        "holding released, closing slipping forward",
        "holding released, closing locked",
    ]
    assert [row.start for row in sol.phases] == pytest.approx([0.0, 0.5, 2.0, 2.75], abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("tau", "span"), [(1e7, 1.0), (1e9, 1.0), (1e5, 100.0)])
def test_what_a_strong_brake_stops_stays_although_rounding_of_the_time_is_a_speed(
    tau: float, span: float, engine: str
) -> None:
    """What loses 1e9 rad/s in a second passes rest by 1e-5 rad/s in a rounding of the time: that is no impact."""
    sol = wheel(sw.Brake("brake", tau=tau), J=1.0).simulate(span, engine=engine, initial={"J.omega": 1e3}, t_eval=3)
    assert words(sol) == [("brake", "slipping forward", "locked")]
    assert times(sol) == pytest.approx([1e3 / tau], rel=1e-4)
    assert sol["J.omega"].tolist()[1:] == [0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_brake_whose_torque_falls_with_the_angle_stops_where_it_should_and_lets_go_again(engine: str) -> None:
    """J phi'' = -(8 - 2 phi) from 5 rad/s; then what it holds is what it had left, which a rising torque exceeds."""
    pull = sw.TorqueSource("pull", tau=sw.Ramp(10.0, duration=10.0, start=2.0))
    net = wheel(pull, sw.Brake("brake", tau=8.0 - 2.0 * sw.phi), J=1.0)
    sol = net.simulate(8.0, initial={"J.omega": 5.0}, engine=engine, rtol=1e-10)
    root = math.sqrt(2.0)
    stops = math.atanh(5.0 / (4.0 * root)) / root
    twist = 4.0 - 4.0 * math.cosh(root * stops) + 5.0 / root * math.sinh(root * stops)
    assert words(sol) == [("brake", "slipping forward", "locked"), ("brake", "locked", "slipping forward")]
    assert times(sol) == pytest.approx([stops, 2.0 + 8.0 - 2.0 * twist], abs=1e-8)


@pytest.mark.parametrize(
    "friction", [sw.Clutch("k", tau=0.1), sw.DryFriction("k", tau_c=0.1)], ids=lambda part: type(part).__name__
)
def test_a_friction_in_series_with_a_spring_needs_an_inertia_between(friction: sw.Component) -> None:
    """Without one the spring would be wound up the moment that the friction slips, even from rest. Hooke and Coulomb in
    series: 0.1 N m wind it up by 0.01 rad, then it slips.
    """
    net = sw.Network("in series")
    net.add(sw.SpeedSource("drive", omega=0.5), "a")
    net.add(friction, "a", "m")
    net.add(sw.Spring("s", c=10.0), "m", "ground")
    with pytest.raises(sw.NetworkError, match=r"massless node: node 'm' has no inertia: the torque of Spring 's'"):
        net.compile()
    net.add(sw.Inertia("M", J=1e-9), "m")
    sol = net.simulate(0.04, t_eval=[0.0, 0.01, 0.04])
    # the small inertia swings on by 0.5 rad/s sqrt(1e-9 / 10) s
    assert sol["s.tau"] == pytest.approx([0.0, 0.05, 0.1], abs=6e-5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_clutch_to_a_swinging_speed_gives_way_though_that_speed_bends_the_other_way(engine: str) -> None:
    """The spring behind it asks for more and more torque, while the prescribed speed falls behind its own tangent."""
    a, omega, J1, J2, c, most = 3.0, 8.238327648331623, 0.08771229348112548, 0.37, 1000.0, 2.3018689460797077
    net = sw.Network("clutch to a swinging speed")
    net.add(sw.SpeedSource("line", omega=a * sympy.sin(omega * sw.t)), "driven")
    net.add(sw.Clutch("clutch", tau=most), "driven", "b")
    net.add(sw.Inertia("J1", J=J1), "b")
    net.add(sw.Spring("shaft", c=c), "a", "b")
    net.add(sw.Inertia("J2", J=J2), "a")
    sol = net.simulate(0.01, engine=engine, rtol=1e-9)
    (gives_way,) = (event for event in sol.events if event[2:] == ("engaged", "slipping forward"))
    # while it holds, the spring is driven by the prescribed speed: c times its twist and J1 at that speed's rate
    k, t = math.sqrt(c / J2), gives_way[0]
    twist = a * omega / (k**2 - omega**2) * (math.cos(omega * t) - math.cos(k * t))
    assert c * twist + J1 * a * omega * math.cos(omega * t) == pytest.approx(most, rel=1e-8)
    assert sol["clutch.tau"][-1] == pytest.approx(most, rel=1e-12)


@pytest.mark.parametrize(
    "engine", ["scipy", *(pytest.param(name, marks=pytest.mark.slow) for name in ("scipy-radau", "sundials", "heyoka"))]
)
def test_a_stribeck_friction_between_two_wheels_breaks_away_with_every_engine(engine: str) -> None:
    """It breaks away without acceleration: DOP853 and Radau cut each step where its torque is largest."""
    net = sw.Network("stick and slip")
    net.add(sw.TorqueSource("T", tau=20 * sympy.sin(30 * sw.t) + 15 * sympy.sin(7 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.DryFriction("friction", tau_c=8.0, tau_s=12.0, omega_s=0.2, d=0.1), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Spring("spring", c=300.0, d=0.4), "b", "ground")
    sol = net.simulate(0.4, engine=engine, t_eval=2)
    # stuck until the torque on J1 less what J2 takes of it is 12 N m; the times are of four engines
    assert [time for time, *_ in sol.events] == pytest.approx([0.028085166, 0.167445, 0.202162], rel=3e-6)


@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials", "scipy-radau"])
@pytest.mark.parametrize("tau", [1.0 - sw.Step(1.0, 0.2), sw.Table([0.0, 0.2, 0.4], [0.0, 1.0, 0.0])])
def test_an_engine_does_not_follow_the_rounding_of_a_torque_that_is_zero(engine: str, tau: Any) -> None:
    """Both sides of the clutch turn alike, so it carries nothing, and from then on it holds nothing."""
    net = sw.Network("alike")
    net.add(sw.Inertia("A", J=0.7), "a")
    net.add(sw.Inertia("B", J=2.1), "b")
    net.add(sw.TorqueSource("T", tau=sympy.sin(8 * sw.t)), "a")
    net.add(sw.TorqueSource("U", tau=3 * sympy.sin(8 * sw.t)), "b")
    net.add(sw.Clutch("clutch", tau=tau), "a", "b")
    sol = net.simulate(0.6, engine=engine)
    assert sol["A.omega"][-1] == pytest.approx((1 - math.cos(4.8)) / 8 / 0.7, rel=1e-6)
    assert sol.statistics["steps"] < 1000


@pytest.mark.parametrize("engine", ["heyoka", "scipy"])
def test_a_brake_whose_torque_grows_with_the_angle_stops_and_holds(engine: str) -> None:
    """J omega' = 1 up to t = 1, then 1 - (5 + phi) with phi from the first motion, until rest."""
    net = sw.Network("brake")
    net.add(sw.Inertia("wheel", J=2.0), "s")
    net.add(sw.Brake("brake", tau=5 + sw.phi, t_on=1.0), "s")
    net.add(sw.TorqueSource("drive", tau=1.0), "s")
    made = net.simulate(3.0, rtol=1e-10, engine=engine)
    assert made.phases[-1].modes["brake"] == "locked"
    assert made["wheel.omega"][-1] == 0
    # from there on phi'' = -(4 + phi) / 2: a quarter of a cosine about phi = -4
    rate, start, speed = 2**-0.5, 0.25, 0.5
    stop = 1 + sympy.atan(speed / rate / (4 + start)).evalf() / rate
    assert made.phases[-1].start == pytest.approx(float(stop), rel=1e-7)
