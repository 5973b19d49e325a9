"""Diodes and switches: what they short at the instant at which they close, and currents with which a motion starts."""

from __future__ import annotations

import math

import pytest

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
