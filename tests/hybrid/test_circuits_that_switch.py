"""Diodes and switches: what they short at the instant at which they close, and currents with which a motion starts."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest
import sympy

import shaftwork as sw

# The motions are exponentials, which engines follow at their tolerance.
CLOSE = 1e-8
U, R, L = 24.0, 0.5, 0.01


def fed(*between: sw.Component, u: float = U) -> sw.Network:
    """A supply, parts in a row, and a coil with a resistor to earth."""
    net = sw.Network("circuit")
    net.add(sw.VoltageSource("supply", u=u), "n0", "ground")
    for k, part in enumerate(between):
        net.add(part, f"n{k}", f"n{k + 1}")
    last = f"n{len(between)}"
    net.add(sw.Inductor("L", L=L), last, "r")
    net.add(sw.Resistor("R", R=R), "r", "ground")
    return net


def test_a_chopper_closes_on_its_freewheeling_diode() -> None:
    """The diode carries nothing and blocks when the switch would put it across the supply."""
    net = fed(sw.Switch("switch", t_on=0.01))
    net.add(sw.Diode("diode"), "ground", "n1")
    sol = net.simulate(0.02)
    assert sol["L.i"][-1] == pytest.approx(U / R * (1 - math.exp(-0.01 * R / L)), rel=CLOSE)
    assert sol.events == ((0.01, "switch", "open", "closed"), (0.01, "diode", "conducting", "blocking"))


def test_a_capacitor_that_a_switch_puts_on_a_supply_loses_half_of_what_that_gives() -> None:
    net = sw.Network("charged")
    net.add(sw.VoltageSource("supply", u=10.0), "p", "ground")
    net.add(sw.Switch("switch", t_on=0.5), "p", "q")
    net.add(sw.Capacitor("C", C=0.02), "q", "ground")
    sol = net.simulate(1.0)
    assert sol["C.u"][-1] == pytest.approx(10.0, rel=1e-14)
    assert sol.energy.supplied_by["supply"] == pytest.approx(0.02 * 10.0**2, rel=CLOSE)
    assert sum(sol.energy.lost_in.values()) == pytest.approx(0.01 * 10.0**2, rel=CLOSE)


@pytest.mark.parametrize("current", [3.0, 1.0])
@pytest.mark.parametrize("u", [1.0, -1.0])
def test_a_motion_starts_with_a_current_that_a_diode_carries(current: float, u: float) -> None:
    sol = fed(sw.Diode("diode"), u=u).simulate(0.002, initial={"L.i": current})
    final = u / R
    assert sol["L.i"][-1] == pytest.approx(final + (current - final) * math.exp(-0.002 * R / L), rel=CLOSE)


def test_a_current_against_a_diode_is_no_start() -> None:
    with pytest.raises(sw.ParameterError, match=r"start value L\.i = -3 contradicts its sources.* would be 0\. Leave"):
        fed(sw.Diode("diode")).simulate(0.002, initial={"L.i": -3.0})


def test_a_coil_behind_an_open_switch_starts_without_a_current() -> None:
    sol = fed(sw.Switch("switch", t_on=0.01)).simulate(0.02, initial={"L.i": 0.0})
    assert sol["L.i"][-1] == pytest.approx(U / R * (1 - math.exp(-0.01 * R / L)), rel=CLOSE)


def test_a_speed_that_the_frame_holds_is_no_start() -> None:
    net = sw.Network("held")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Ground("frame"), "a")
    with pytest.raises(sw.ParameterError, match=r"J\.omega = 3 contradicts its sources.*it would be 0\. Leave it out"):
        net.simulate(1.0, initial={"J.omega": 3.0})


def buck(order: Iterable[str], **switch: float) -> sw.Network:
    """A switch that feeds a coil, and the diode through which its current goes on; what is added first, and later."""
    parts = {
        "supply": (sw.VoltageSource("supply", u=U), "p", "ground"),
        "switch": (sw.Switch("switch", **switch), "p", "x"),
        "diode": (sw.Diode("diode"), "ground", "x"),
        "L": (sw.Inductor("L", L=L), "x", "r"),
        "R": (sw.Resistor("R", R=R), "r", "ground"),
    }
    net = sw.Network("buck")
    for name in order:
        net.add(*parts[name])
    return net


def rising(current: float, t: float, final: float = U / R) -> float:
    """The current of the coil after some time, s."""
    return final + (current - final) * math.exp(-t * R / L)


@pytest.mark.parametrize("current", [0.0, 5.0, -5.0])
@pytest.mark.parametrize("diode_first", [True, False])
def test_a_switch_is_closed_from_the_start_wherever_its_diode_stands(
    diode_first: bool,  # noqa: FBT001
    current: float,
) -> None:
    order = ("diode", "supply", "switch", "L", "R") if diode_first else ("R", "L", "switch", "diode", "supply")
    sol = buck(order, t_off=0.02).simulate(0.03, initial={"L.i": current} if current else None)
    carried = rising(current, 0.02)
    assert sol.at([0.02 - 1e-9])["L.i"][0] == pytest.approx(carried, rel=1e-6)  # it falls by 1e-7 of it in 1 ns
    assert sol["L.i"][-1] == pytest.approx(rising(carried, 0.01, 0.0), rel=CLOSE)


def test_a_switch_that_closes_takes_the_current_over_from_a_diode() -> None:
    sol = buck(("supply", "switch", "diode", "L", "R"), t_on=0.01).simulate(0.03, initial={"L.i": 10.0})
    assert sol["L.i"][-1] == pytest.approx(rising(rising(10.0, 0.01, 0.0), 0.02), rel=CLOSE)
    # but for rounding of what the coil stores, 0.2 J
    assert [sol.energy.lost_in[name] for name in ("switch", "diode")] == pytest.approx([0.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("diodes", [(), ("high", "low")])
@pytest.mark.parametrize("order", ["upper lower", "lower upper"])
def test_switches_of_one_instant_change_together(order: str, diodes: tuple[str, ...]) -> None:
    """A half bridge without a dead time: in no order is the supply shorted, or the current cut off."""
    parts = {
        "upper": (sw.Switch("upper", t_off=0.02), "p", "x"),
        "lower": (sw.Switch("lower", t_on=0.02), "x", "ground"),
        "high": (sw.Diode("high"), "x", "p"),
        "low": (sw.Diode("low"), "ground", "x"),
    }
    net = sw.Network("half bridge")
    net.add(sw.VoltageSource("supply", u=U), "p", "ground")
    for name in (*order.split(), *diodes):
        net.add(*parts[name])
    net.add(sw.Inductor("L", L=L), "x", "r")
    net.add(sw.Resistor("R", R=R), "r", "ground")
    sol = net.simulate(0.03)
    assert sol["L.i"][-1] == pytest.approx(rising(rising(0.0, 0.02), 0.01, 0.0), rel=CLOSE)


@pytest.mark.parametrize("coils", [1, 3, 5])
def test_each_of_several_coils_goes_on_through_its_own_diode(coils: int) -> None:
    net = sw.Network("coils")
    net.add(sw.VoltageSource("supply", u=U), "p", "ground")
    net.add(sw.Switch("switch", t_off=0.02), "p", "x")
    for k in range(coils):
        net.add(sw.Resistor(f"fuse{k}", R=0.1), "x", f"x{k}")
        net.add(sw.Diode(f"diode{k}"), "ground", f"x{k}")
        net.add(sw.Inductor(f"L{k}", L=L * (k + 1)), f"x{k}", f"r{k}")
        net.add(sw.Resistor(f"R{k}", R=R), f"r{k}", "ground")
    sol = net.simulate(0.03)
    for k in range(coils):
        rate, total = 1.0 / (L * (k + 1)), R + 0.1
        carried = U / total * (1.0 - math.exp(-0.02 * total * rate))
        assert sol[f"L{k}.i"][-1] == pytest.approx(carried * math.exp(-0.01 * R * rate), rel=CLOSE)
    assert sol.energy.lost_in["switch"] == pytest.approx(0.0, abs=1e-12)


def test_a_coil_that_a_switch_shorts_starts_without_the_current_of_the_other_one() -> None:
    net = fed(sw.Inductor("L1", L=L), u=0.0)
    net.add(sw.Switch("switch"), "n1", "r")
    assert net.simulate(0.01, initial={"L1.i": 10.0})["L.i"][0] == 0.0
    assert net.simulate(0.01, initial={"L1.i": 10.0, "L.i": 4.0})["L.i"][-1] == pytest.approx(4.0, rel=CLOSE)


def test_two_diodes_in_a_row_charge_a_capacitor_and_do_not_empty_it() -> None:
    """At 50 ms a switch shorts the first capacitor, which two diodes part from the second one."""
    net = sw.Network("rectifier")
    net.add(sw.VoltageSource("supply", u=10.0), "s", "ground")
    net.add(sw.Resistor("R", R=1.0), "s", "a")
    net.add(sw.Capacitor("C1", C=0.001), "a", "ground")
    net.add(sw.Switch("switch", t_on=0.05), "a", "ground")
    net.add(sw.Diode("first"), "a", "b")
    net.add(sw.Resistor("bleeder", R=1000.0), "b", "ground")
    net.add(sw.Diode("second"), "b", "c")
    net.add(sw.Capacitor("C2", C=0.001), "c", "ground")
    sol = net.simulate(0.06)
    charged = 10.0 / 1.001 * (1.0 - math.exp(-0.05 * (1.0 + 1e-3) / 0.002))
    assert sol.at([0.06])["C2.u"][0] == pytest.approx(charged, rel=1e-7)
    assert sol["C1.u"][-1] == pytest.approx(0.0, abs=1e-12)


def test_an_empty_capacitor_behind_two_diodes_takes_half_of_what_a_supply_gives_at_once() -> None:
    net = sw.Network("rectifier")
    net.add(sw.VoltageSource("supply", u=10.0), "a", "ground")
    net.add(sw.Diode("first"), "a", "b")
    net.add(sw.Resistor("bleeder", R=1000.0), "b", "ground")
    net.add(sw.Diode("second"), "b", "c")
    net.add(sw.Capacitor("C", C=0.001), "c", "ground")
    sol = net.simulate(0.1)
    assert sol["C.u"][-1] == pytest.approx(10.0, rel=CLOSE)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("order", ["upper lower", "lower upper"])
def test_a_capacitor_at_a_leg_is_emptied_by_the_switch_that_closes_as_the_other_one_opens(order: str) -> None:
    parts = {
        "upper": (sw.Switch("upper", t_off=0.02), "p", "x"),
        "lower": (sw.Switch("lower", t_on=0.02), "x", "ground"),
    }
    net = sw.Network("leg")
    net.add(sw.VoltageSource("supply", u=U), "p", "ground")
    for name in order.split():
        net.add(*parts[name])
    net.add(sw.Capacitor("C", C=0.001), "x", "ground")
    net.add(sw.Resistor("R", R=100.0), "x", "ground")
    sol = net.simulate(0.03)
    assert sol["C.u"][-1] == pytest.approx(0.0, abs=1e-12)
    assert sol.energy.lost_in["lower"] == pytest.approx(0.001 * U**2 / 2, rel=CLOSE)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("t_off", [0.01, 0.02])
@pytest.mark.parametrize("first", ["opens", "closes"])
def test_a_coil_goes_on_through_its_diode_while_a_capacitor_is_charged_at_once(first: str, t_off: float) -> None:
    """One switch opens in series with the coil, then or before another one puts a capacitor on the supply."""
    net = sw.Network("two at once")
    net.add(sw.VoltageSource("supply", u=U), "p", "ground")
    parts = [(sw.Switch("opens", t_off=t_off), "p", "x"), (sw.Switch("closes", t_on=0.02), "p", "q")]
    for part in parts if first == "opens" else reversed(parts):
        net.add(*part)
    net.add(sw.Inductor("L", L=L), "x", "r")
    net.add(sw.Resistor("R", R=R), "r", "ground")
    net.add(sw.Diode("diode"), "ground", "x")
    net.add(sw.Capacitor("C", C=0.001), "q", "ground")
    sol = net.simulate(0.03)
    current = U / R * (1 - math.exp(-t_off * R / L)) * math.exp(-(0.03 - t_off) * R / L)
    assert sol["L.i"][-1] == pytest.approx(current, rel=CLOSE)
    assert sol["C.u"][-1] == pytest.approx(U, rel=1e-14)
    assert sol.energy.lost_in["closes"] == pytest.approx(0.001 * U**2 / 2, rel=CLOSE)
    assert sol.energy.lost_in["opens"] == pytest.approx(0.0, abs=1e-12)
    assert sol.energy_residual < 1e-9


@pytest.mark.filterwarnings("ignore:jumping source")
def test_a_coil_goes_on_through_its_diode_while_a_supply_jumps_that_has_a_capacitor() -> None:
    net = sw.Network("jump")
    net.add(sw.VoltageSource("supply", u=sympy.Piecewise((U, sw.t < 0.02), (2 * U, True))), "p", "ground")
    net.add(sw.Switch("opens", t_off=0.01), "p", "x")
    net.add(sw.Inductor("L", L=L), "x", "r")
    net.add(sw.Resistor("R", R=R), "r", "ground")
    net.add(sw.Diode("diode"), "ground", "x")
    net.add(sw.Capacitor("C", C=0.001), "p", "ground")
    sol = net.simulate(0.03)
    current = U / R * (1 - math.exp(-0.01 * R / L)) * math.exp(-0.02 * R / L)
    assert sol["L.i"][-1] == pytest.approx(current, rel=CLOSE)
    assert sol["C.u"][-1] == pytest.approx(2 * U, rel=1e-14)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize(
    "on",
    [
        0.3 - (10 * sw.t - sympy.floor(10 * sw.t)),
        sympy.Piecewise((1, 10 * sw.t - sympy.floor(10 * sw.t) < 0.3), (0, True)),
    ],
    ids=["a line against a saw tooth", "one and zero"],
)
def test_a_switch_follows_a_law_of_time_as_a_chopper_with_a_freewheeling_diode_does(
    on: sympy.Expr, engine: str
) -> None:
    """3 of 10 parts of each period i goes to 24 V / 2 ohm, else to zero, with L / R = 0.02 s."""
    net = sw.Network("chopper")
    net.add(sw.VoltageSource("supply", u=24.0), "p", "ground")
    net.add(sw.Switch("switch", on=on), "p", "x")
    net.add(sw.Diode("diode"), "ground", "x")
    net.add(sw.Resistor("R", R=2.0), "x", "y")
    net.add(sw.Inductor("L", L=0.04), "y", "ground")
    sol = net.simulate(0.5, engine=engine, rtol=1e-10)
    current = 0.0
    for _ in range(5):
        current = 12.0 + (current - 12.0) * math.exp(-0.03 / 0.02)
        current *= math.exp(-0.07 / 0.02)
    # at 0.5 s it closes again
    assert sol["L.i"][-1] == pytest.approx(current, rel=1e-8)
    times = [time for time, part, *_ in sol.events if part == "switch"]
    np.testing.assert_allclose(times[:9], [0.03, 0.1, 0.13, 0.2, 0.23, 0.3, 0.33, 0.4, 0.43], rtol=1e-12)
    assert sol.energy_residual < 1e-8
