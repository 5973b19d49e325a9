"""What is stored, given and lost: contacts that spring back, and sources that jump."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

import shaftwork as sw

ENGINES = ("heyoka", "scipy", "sundials")
C, J = 800.0, 2.0
# The tolerance of the runs, over a handful of contacts.
CLOSE = 1e-7


def bouncing(d: float = 0.0, tau: float = 0.0) -> sw.Network:
    """An inertia between two sprung stops at 0.5 and -0.25 rad."""
    net = sw.Network("bouncing")
    net.add(sw.Inertia("J", J=J), "wheel")
    net.add(sw.TorqueSource("pull", tau=tau), "wheel")
    net.add(sw.HardStop("stop", upper=0.5, lower=-0.25, c=C, d=d), "wheel")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_between_undamped_stops_nothing_is_lost_at_any_instant(engine: str) -> None:
    sol = bouncing().simulate(3.0, engine=engine, initial={"J.omega": 4.0}, t_eval=301)
    assert {after for *_, after in sol.events} == {"in contact", "in contact backward", "open"}
    # torque less the slope of the stored energy: the same numbers but for rounding
    assert np.abs(sol.energy.lost).max() < 1e-12
    np.testing.assert_allclose(sol.energy.stored, 16.0, rtol=CLOSE)
    np.testing.assert_allclose(sol["J.energy"] + sol["stop.energy"], 16.0, rtol=CLOSE)
    assert sol["stop.energy"].max() > 15.0
    assert sol.energy_residual < CLOSE


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("d", [2.0, 30.0, 300.0])
def test_a_damped_stop_loses_what_the_wheel_has_less_and_never_gives_any_back(d: float, engine: str) -> None:
    sol = bouncing(d, tau=20.0).simulate(4.0, engine=engine)
    energy = sol.energy
    assert np.diff(energy.lost).min() >= -1e-14 * energy.lost[-1]
    twist = sol.at([4.0])["stop.phi"][0]
    left = C / 2 * max(0.0, twist - 0.5) ** 2 + J / 2 * sol.at([4.0])["J.omega"][0] ** 2
    assert energy.lost_in["stop"] == pytest.approx(20.0 * twist - left, rel=CLOSE)
    assert sol.energy_residual < CLOSE


def test_what_a_stop_has_not_given_back_when_it_parts_is_lost_while_it_relaxes() -> None:
    """It parts where its torque is zero, so where the speed is greatest: d/dt of the damped oscillation's is zero."""
    d = 30.0
    sol = bouncing(d).simulate(0.5 / 4 + 0.25, rtol=1e-10, initial={"J.omega": 4.0})
    meets, parts, *_ = (time for time, *_ in sol.events)
    decay, natural = d / (2 * J), C / J
    frequency = math.sqrt(natural - decay**2)
    lasts = math.atan2(2 * decay * frequency, decay**2 - frequency**2) / frequency
    assert parts - meets == pytest.approx(lasts, rel=1e-9)
    pressed = 4.0 / frequency * math.exp(-decay * lasts) * math.sin(frequency * lasts)
    speed = -C * pressed / d
    held = C / 2 * pressed**2
    relaxed = parts + pressed / -speed
    at = sol.at([np.nextafter(parts, 0.0), parts, (parts + relaxed) / 2, relaxed, sol.t[-1]])
    np.testing.assert_allclose(at["stop.energy"], [held, held, held / 4, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(at["J.omega"][1:], speed, rtol=1e-9)
    assert sol.energy.lost[-1] == pytest.approx(J / 2 * (4.0**2 - speed**2), rel=1e-9)
    before = sol.energy.lost[sol.energy.t == parts][0]
    assert sol.energy.lost[-1] - before == pytest.approx(held, rel=1e-9)


@pytest.mark.parametrize("d", [0.0, 30.0])
@pytest.mark.parametrize("twist", [0.7, -0.4])
def test_a_motion_that_starts_pressed_in_gives_back_what_is_stored(twist: float, d: float) -> None:
    sol = bouncing(d).simulate(0.1, rtol=1e-13, initial={"stop.phi": twist})
    pressed = twist - 0.5 if twist > 0 else twist + 0.25
    assert sol.energy.stored[0] == pytest.approx(C / 2 * pressed**2, rel=1e-12)
    assert sol.energy.lost.min() >= -1e-14
    assert sol.energy.lost_in["stop"] == pytest.approx(sol.energy.stored[0] - sol.energy.stored[-1], abs=1e-12)
    assert (sol.energy.lost_in["stop"] > 0.1) == bool(d)


def test_flanks_that_start_beyond_their_limit_and_part_at_once_lose_all_they_store() -> None:
    sol = bouncing(30.0).simulate(0.02, initial={"stop.phi": 0.6, "J.omega": -20.0})
    assert sol.energy.lost_in["stop"] == pytest.approx(C / 2 * 0.1**2, rel=1e-12)
    assert sol["J.omega"][-1] == -20.0


@pytest.mark.slow
def test_a_gap_beside_a_shaft_of_waves_stores_what_it_is_pressed_in() -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("drive", tau=200.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Shaft("line", length=50.0, diameter=0.08, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=0.5), "b")
    net.add(sw.Backlash("gap", gap=0.2, c=5e3, d=5.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    sol = net.simulate(1.0)
    pressed = np.maximum(np.abs(sol["gap.phi"]) - 0.1, 0.0)
    np.testing.assert_allclose(sol["gap.energy"], 5e3 / 2 * pressed**2, rtol=0, atol=1e-9)
    assert sol["gap.energy"].max() > 1.0
    assert np.diff(sol.energy.lost).min() >= -1e-12
    assert sol.energy_residual < 1e-8


@sw.component
class Stiffening(sw.Component):
    """A spring that stiffens."""

    c: float = sw.parameter("N*m/rad", "stiffness at rest", at_least=0)
    c3: float = sw.parameter("N*m/rad^3", "cubic stiffness", at_least=0, default=0.0)
    d: float = sw.parameter("N*m*s/rad", "damping", at_least=0, default=0.0)

    def branches(self, p: object) -> Iterator[object]:
        torque = p.c * sw.INTEGRAL + p.c3 * sw.INTEGRAL**3 + p.d * sw.ACROSS  # type: ignore[attr-defined]
        yield sw.ThroughLaw(torque, stored=p.c * sw.INTEGRAL**2 / 2 + p.c3 * sw.INTEGRAL**4 / 4)  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("d", [0.0, 0.5])
def test_a_law_stores_what_it_says_and_loses_the_rest(d: float, engine: str) -> None:
    net = sw.Network("stiffening")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(Stiffening("spring", c=10.0, c3=400.0, d=d), "a", "frame")
    net.add(sw.Ground("earth"), "frame")
    sol = net.simulate(3.0, engine=engine, initial={"J.omega": 3.0}, t_eval=31, rtol=1e-10)
    twist = sol["spring.phi"]
    np.testing.assert_allclose(sol["spring.energy"], 5.0 * twist**2 + 100.0 * twist**4, rtol=1e-12)
    lost = sol.energy.lost_in["spring"]
    assert lost == pytest.approx(9.0 - sol["J.energy"][-1] - sol["spring.energy"][-1], abs=CLOSE * 9.0)
    assert lost > 1.0 if d else abs(lost) < 1e-12
    assert np.diff(sol.energy.lost).min() >= -1e-13


def test_small_motions_about_a_contact_change_its_energy_by_its_torque() -> None:
    model = bouncing(30.0).compile()
    near = model.linearize({"stop.phi": 0.6}, inputs="pull.tau", outputs=("stop.energy", "stop.tau"))
    np.testing.assert_allclose(near.C[:, near.states.index("stop.phi")], [-C * -0.1, C], rtol=1e-12)


@pytest.mark.parametrize(
    ("law", "stored"),
    [
        (sw.INTEGRAL, sw.ACROSS**2),
        (sw.ACROSS, sw.INTEGRAL**2),
        (5 + sw.ACROSS**3, sw.INTEGRAL**2),
    ],
    ids=["of a speed", "of an angle that a damper does not read", "nor a drag"],
)
def test_an_energy_that_is_not_that_of_the_angle_in_the_law_is_refused(law: object, stored: object) -> None:
    @sw.component
    class Odd(sw.Component):
        """Stores what it cannot."""

        def branches(self, p: object) -> Iterator[object]:  # noqa: ARG002
            yield sw.ThroughLaw(law, stored=stored)

    net = sw.Network("odd")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(Odd("odd"), "a", "b")
    net.add(sw.Inertia("J2", J=J), "b")
    with pytest.raises(sw.ShaftworkError, match=r"Odd 'odd'.*INTEGRAL, which its law must read"):
        net.compile()


jumping = pytest.mark.filterwarnings("ignore:jumping source")


def differential() -> sw.Network:
    """A carrier that turns by a third of the sun's speed and two thirds of the ring's, both prescribed."""
    net = sw.Network("differential")
    net.add(sw.SpeedSource("first", omega=sw.Step(6.0, start=0.5)), "sun")
    net.add(sw.SpeedSource("second", omega=sw.Step(1.0, start=0.7)), "ring")
    net.add(sw.PlanetaryGear("gear", ratio=2.0), "sun", "carrier", "ring")
    net.add(sw.Inertia("J", J=J), "carrier")
    return net


# The carrier takes 4 J, then an impulse of 4/3 N m s: a third of it at 6 rad/s, two thirds at half a rad/s in the mean.
GIVEN = {"first": 4.0 + 8.0 / 3.0, "second": 4.0 / 9.0}


@jumping
@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_each_source_that_jumps_gives_its_impulse_times_the_mean_of_its_speeds(engine: str) -> None:
    net = differential()
    net.add(sw.Spring("tail", c=10.0), "carrier", "end")
    net.add(sw.Inertia("end", J=0.5), "end")
    with_tail = net.simulate(0.7 + 1e-3, engine=engine)
    alone = differential().simulate(0.7 + 1e-3, engine=engine)
    assert alone.energy.supplied_by == pytest.approx(GIVEN, rel=1e-12)
    assert set(alone.energy.lost_in.values()) == {0.0}
    for sol in (alone, with_tail):
        assert math.fsum(sol.energy.supplied_by.values()) == pytest.approx(sol.energy.supplied[-1], rel=1e-12)
        assert sol.energy_residual < CLOSE


@jumping
def test_a_jump_that_changes_no_mode_is_given_by_its_sources_too() -> None:
    net = differential()
    net.add(sw.Backlash("gap", gap=20.0, c=100.0), "carrier", "loose")
    net.add(sw.Inertia("loose", J=1.0), "loose")
    sol = net.simulate(1.0)
    assert sol.events == ()
    assert sol.energy.supplied_by == pytest.approx(GIVEN, rel=1e-12)
    assert set(sol.energy.lost_in.values()) == {0.0}


@jumping
def test_a_torque_that_jumps_winds_up_what_is_in_series_with_it() -> None:
    """The spring takes tau^2 / 2 c, and then the source turns with its torque."""
    net = sw.Network("wound up")
    net.add(sw.TorqueSource("pull", tau=sw.Step(6.0, start=0.5)), "a")
    net.add(sw.Spring("spring", c=10.0), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    energy = net.simulate(1.0).energy
    assert energy.supplied_by["pull"] == pytest.approx(6.0**2 / 20.0 + (6.0 * 0.5) ** 2 / 2, rel=1e-9)
    assert energy.residual < CLOSE


@jumping
def test_what_changes_its_mode_at_the_instant_of_a_jump_is_not_charged_with_it() -> None:
    net = sw.Network("charging")
    net.add(sw.Ground("earth"), "0")
    net.add(sw.VoltageSource("u", u=sw.Step(5.0, start=0.5)), "p", "0")
    net.add(sw.Capacitor("C", C=1.0), "p", "0")
    net.add(sw.Switch("switch", t_on=0.5), "p", "q")
    net.add(sw.Resistor("R", R=2.0), "q", "0")
    energy = net.simulate(1.0).energy
    assert energy.lost_in["switch"] == 0.0
    assert energy.supplied_by["u"] == pytest.approx(5.0**2 / 2 + 5.0**2 / 2 * 0.5, rel=1e-12)
    assert energy.residual < CLOSE


@pytest.mark.slow
@pytest.mark.no_cover
def test_the_memory_of_a_balance_does_not_grow_with_the_number_of_steps() -> None:
    net = sw.Network("chain")
    net.add(sw.TorqueSource("pull", tau=1.0), "n0")
    net.add(sw.Inertia("J0", J=1.0), "n0")
    for k in range(20):
        net.add(sw.Spring(f"c{k}", c=4e6, d=0.1), f"n{k}", f"n{k + 1}")
        net.add(sw.Inertia(f"J{k + 1}", J=1.0), f"n{k + 1}")
    net.add(Stiffening("anchor", c=10.0, c3=400.0), "n20", "frame")
    net.add(sw.Ground("earth"), "frame")
    model = net.compile()
    steps, peaks = [], []
    for t_end in (1.0, 4.0):
        sol = model.simulate(t_end, engine="heyoka")
        tracemalloc.start()
        assert sol.energy_residual < CLOSE
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        steps.append(len(sol.steps))
    assert steps[1] > 3.5 * steps[0]
    assert peaks[1] < 1.5 * peaks[0]
