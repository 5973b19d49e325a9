"""Guards that are met at one instant: whichever an engine names, the same modes change in the same order."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import shaftwork as sw
from tests.trains import Part, Train

RIGID = {"gap": 0.02, "restitution": 0.0, "omega_rest": 1e-3}
SOFT = {"gap": 0.02, "c": 5000.0, "d": 0.5}
PULSE = sw.Step(-7.0, 0.2) - sw.Step(-7.0, 0.5)


def chain(first: dict[str, float], second: dict[str, float], speeds: tuple[float, ...], *more: Part) -> Train:
    """Three inertias with two gaps between them."""
    inertias = (Part("Inertia", f"J{k}", (f"r{k}",), {"J": J}) for k, J in enumerate((2.0, 0.5, 0.5)))
    gaps = Part("Backlash", "gap1", ("r0", "r1"), first), Part("Backlash", "gap2", ("r1", "r2"), second)
    return Train((*inertias, *gaps, *more), {f"J{k}.omega": w for k, w in enumerate(speeds)}, 1.0)


TRAINS = {
    "a soft flank presses a rigid one": chain(
        RIGID, SOFT, (0.0, 20.0, -3.3), Part("TorqueSource", "tau", ("r0",), {"tau": PULSE})
    ),
    "a rigid flank is pressed by a soft one": chain(
        SOFT, RIGID, (-3.3, 20.0, 0.0), Part("TorqueSource", "tau", ("r2",), {"tau": PULSE})
    ),
    "both are rigid": chain(
        RIGID,
        {**RIGID, "restitution": 0.5},
        (1.0, -1.0, 5.0),
        Part("TorqueSource", "tau", ("r0",), {"tau": 30.0 * sympy.sin(8.0 * sw.t)}),
    ),
    "a motor drives two": chain(
        {**RIGID, "restitution": 0.5, "omega_rest": 1e-6},
        {"gap": 0.02, "c": 100.0, "d": 0.0},
        (-1.0, 0.0, 20.0),
        Part("KlossMotor", "motor", ("r2",), {"tau_k": 30.0, "s_k": 0.25, "n_sync": 300.0, "ratio": 2.0}),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRAINS)
def test_every_engine_names_the_same_events_in_the_same_order(name: str) -> None:
    model, initial = TRAINS[name].compiled(), TRAINS[name].initial
    wanted, *others = (
        model.simulate(1.0, engine=engine, rtol=1e-9, initial=initial).events
        for engine in ("heyoka", "scipy", "sundials")
    )
    assert len(wanted) > 5
    for events in others:
        assert [event[1:] for event in events] == [event[1:] for event in wanted]
        # an engine's error grows with every event
        np.testing.assert_allclose([event[0] for event in events], [event[0] for event in wanted], rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize("driven", ["r0", "r2"])
def test_where_a_torque_turns_round_only_the_flanks_next_to_it_part(engine: str, driven: str) -> None:
    """At pi / 8 s the torque through both gaps is zero; behind it all goes on at one speed."""
    sign = 1.0 if driven == "r0" else -1.0
    source = Part("TorqueSource", "tau", (driven,), {"tau": sign * sympy.sin(8.0 * sw.t)})
    train = chain(RIGID, RIGID, (0.0, 0.0, 0.0), source)
    start = {"gap1.phi": 0.01, "gap2.phi": 0.01}
    sol = train.compiled().simulate(0.4, engine=engine, rtol=1e-9, initial={**train.initial, **start})
    (event,) = (event for event in sol.events if event[0] > 0.1)
    assert event[1:] == ("gap1" if driven == "r0" else "gap2", "in contact", "open")
    assert event[0] == pytest.approx(math.pi / 8, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["FG", "GF"])
def test_a_gear_that_would_jam_where_a_friction_lets_go_drives_on(order: str) -> None:
    """It is locked, and its load had turned it; from where the friction slips, a drives, as no other mode has rates."""
    net = sw.Network("lets go")
    net.add(sw.TorqueSource("motor", tau=20.0 * sw.t), "a")
    net.add(sw.Inertia("A", J=0.1017), "a")
    parts = {
        "F": (sw.DryFriction("friction", tau_c=4.93), "a"),
        "G": (sw.LossyGear("gear", ratio=2.86, efficiency=0.884, efficiency_back=-0.438), "a", "b"),
    }
    for letter in order:
        net.add(*parts[letter])
    net.add(sw.Inertia("B", J=2.52), "b")
    net.add(sw.TorqueSource("load", tau=46.28), "b")
    sol = net.simulate(2.0)
    # tau_a drives: J_A a + tau_a = 20 t - 4.93, and 0.884 tau_a + 46.28 / 2.86 = J_B a / 2.86^2
    inertia, rests = 0.1017 + 2.52 / 2.86**2 / 0.884, 4.93 - 46.28 / 2.86 / 0.884
    begins = 0.6008818181818
    wanted = (10.0 * (4.0 - begins**2) - rests * (2.0 - begins)) / inertia
    assert sol.phases[-1].modes["gear"] == "driving forward"
    assert sol["A.omega"][-1] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize("when", [{"t_on": 0.5}, {"on": sw.t - 0.5}])
def test_a_switch_that_will_open_again_closes_on_a_conducting_diode(engine: str, when: dict[str, object]) -> None:
    """Before the supply comes on, the switch and the freewheel diode short it: the diode blocks, the switch closes.

    From 1 s on L di/dt = 48 - i, so that i(2) = 48 (1 - exp(-20)).
    """
    net = sw.Network("switched")
    net.add(sw.VoltageSource("supply", u=sw.Step(48.0, start=1.0)), "p", "e")
    net.add(sw.Ground("earth"), "e")
    net.add(sw.Switch("switch", t_off=2.5, **when), "p", "q")  # type: ignore[arg-type]
    net.add(sw.Diode("diode"), "e", "q")
    net.add(sw.Resistor("R", R=1.0), "q", "r")
    net.add(sw.Inductor("L", L=0.05), "r", "e")
    sol = net.simulate(3.0, engine=engine, rtol=1e-10)
    now = sol.at([0.7, 1.5, 2.0, 2.7])
    np.testing.assert_array_equal(now["switch.u"][:3], 0.0)
    np.testing.assert_allclose(now["L.i"][2], 48.0 * (1 - math.exp(-20.0)), rtol=1e-8)
    assert now["switch.i"][3] == 0.0
    assert sol.phases[-1].modes == {"switch": "open", "diode": "conducting"}


def test_a_switch_that_will_open_again_does_not_stay_open_in_place_of_a_short_circuit() -> None:
    net = sw.Network("short")
    net.add(sw.VoltageSource("supply", u=10.0), "p", "e")
    net.add(sw.Ground("earth"), "e")
    net.add(sw.Resistor("R", R=1.0), "p", "e")
    net.add(sw.Inductor("L", L=0.1), "p", "e")
    net.add(sw.Switch("switch", t_on=0.5, t_off=1.5), "p", "e")
    with pytest.raises(sw.SimulationError, match=r"'switch' can neither stay open nor become closed at t = 0\.5 s"):
        net.simulate(2.0)


@pytest.mark.parametrize("order", [1, -1])
def test_modes_entered_and_left_at_one_instant_are_no_events_however_the_parts_are_named(order: int) -> None:
    """At 1 s the motor turns round, and the worm brakes: the clutch slips, and how it came to that is nobody's event.

    Before, all turns as one: 20 N m at 30 : 1 with half of it lost. From 1 s on J w' = -500 N m behind the clutch.
    """
    parts = [
        (sw.Inertia("motor", J=0.3), "a"),
        (sw.TorqueSource("torque", tau=sw.Step(-25.0, start=1.0, before=20.0)), "a"),
        (sw.LossyGear("worm", ratio=30.0, efficiency=0.5, efficiency_back=-0.2), "a", "b"),
        (sw.Inertia("wheel", J=1.0), "b"),
        (sw.Clutch("clutch", tau=500.0), "b", "c"),
        (sw.Inertia("drum", J=2000.0), "c"),
    ]
    net = sw.Network("jams")
    for part in parts[::order]:
        net.add(*part)
    sol = net.simulate(1.1)
    at_once = [event[1:] for event in sol.events if event[0] == 1.0]
    assert sorted(at_once) == [
        ("clutch", "engaged", "slipping backward"),
        ("worm", "driving forward", "driven forward"),
    ]
    reached = 20.0 * 30.0 * 0.5 / (2001.0 + 0.3 * 30.0**2 * 0.5)
    assert sol["drum.omega"][-1] == pytest.approx(reached - 500.0 / 2000.0 * 0.1, rel=1e-9)


@pytest.mark.parametrize("ratio", [1.5, 1.7, 2.0, 3.0])
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "scipy-radau"])
def test_two_clutches_that_lock_a_planetary_gear_share_a_torque_whatever_its_ratio(engine: str, ratio: float) -> None:
    """The weak one gives way at its 1 N m, and the other holds on: all turn as one, 0.9 w' = -35 t."""
    net = sw.Network("locked")
    for name, J, node in (("carrier", 0.5, "c"), ("sun", 0.2, "s"), ("ring", 0.2, "r")):
        net.add(sw.Inertia(name, J=J), node)
    net.add(sw.PlanetaryGear("gear", ratio=ratio), "s", "c", "r")
    net.add(sw.Clutch("weak", tau=1.0), "s", "c")
    net.add(sw.Clutch("strong", tau=30.0), "s", "c")
    net.add(sw.TorqueSource("torque", tau=-35.0 * sw.t), "r")
    sol = net.simulate(0.2, engine=engine, rtol=1e-10)
    assert sol["carrier.omega"][-1] == pytest.approx(-35.0 * 0.02 / 0.9, rel=1e-9)
    assert sol["sun.omega"][-1] == pytest.approx(sol["carrier.omega"][-1], rel=1e-12)


@pytest.mark.parametrize(("clutch", "brake", "reached"), [(1.0, 2.0, 0.0), (2.0, 1.0, 0.25), (1.0, 1.0, 0.0)])
@pytest.mark.parametrize("first", ["clutch", "brake"])
def test_a_source_at_rest_lets_a_clutch_and_a_brake_hold_together(
    first: str, clutch: float, brake: float, reached: float
) -> None:
    parts = {"clutch": (sw.Clutch("clutch", tau=clutch), "s", "a"), "brake": (sw.Brake("brake", tau=brake), "a")}
    net = sw.Network("beside a source")
    net.add(sw.SpeedSource("drive", omega=sw.Step(2.0, start=0.25)), "s")
    net.add(sw.Inertia("J", J=1.0), "a")
    for name in sorted(parts, key=lambda name: name != first):
        net.add(*parts[name])
    assert net.simulate(0.5)["J.omega"][-1] == pytest.approx(reached, abs=1e-12)


@pytest.mark.parametrize("kind", [sw.Brake, sw.Clutch])
def test_a_torque_that_is_infinite_where_it_holds_is_refused(kind: type[sw.Brake]) -> None:
    net = sw.Network("infinite")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Inertia("K", J=1.0), "b")
    net.add(kind("grip", tau=1 / sw.omega), "a", "b")
    with pytest.raises(sw.CompileError, match=r"law of 'grip' has no finite value at zero speed, where it is"):
        net.simulate(1.0)
