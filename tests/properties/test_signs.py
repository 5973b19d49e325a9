"""The signs of the sign page, one claim each, and the power balance of every registered component.

All motions are exact or integrated to 1e-10, so 1e-7 of the largest value is a wide tolerance for a sign.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components import REGISTRY, Component
from shaftwork.core.domains import ELECTRICAL
from tests.beds import bed_of, registered

TIMES = np.linspace(0.0, 0.4, 9)


def _motion(*placed: tuple[Component, tuple[str, ...]], **options: Any) -> sw.Solution:
    net = sw.Network("signs")
    for part, nodes in placed:
        net.add(part, *nodes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)
        return net.simulate(TIMES[-1], t_eval=TIMES, rtol=1e-10, **options)


def _close(first: Any, second: Any) -> None:
    np.testing.assert_allclose(first, second, rtol=1e-7, atol=1e-7 * np.abs(second).max())


def test_a_positive_source_torque_raises_the_speed_of_its_node() -> None:
    sol = _motion((sw.TorqueSource("motor", tau=3.0), ("r",)), (sw.Inertia("J", J=2.0), ("r",)))
    _close(sol["J.omega"], 1.5 * TIMES)
    _close(sol["motor.tau"], np.full(9, 3.0))


def test_a_source_between_two_nodes_gives_to_a_what_it_takes_from_b() -> None:
    sol = _motion(
        (sw.TorqueSource("motor", tau=3.0), ("a", "b")),
        (sw.Inertia("J1", J=2.0), ("a",)),
        (sw.Inertia("J2", J=1.0), ("b",)),
    )
    _close(sol["J1.omega"], 1.5 * TIMES)
    _close(sol["J2.omega"], -3.0 * TIMES)
    _close(sol["motor.omega_rel"], 4.5 * TIMES)


def test_a_positive_source_force_raises_the_speed_of_its_node() -> None:
    sol = _motion((sw.ForceSource("pull", f=3.0), ("x",)), (sw.Mass("m", m=2.0), ("x",)))
    _close(sol["m.v"], 1.5 * TIMES)
    _close(sol["pull.f"], np.full(9, 3.0))


def test_the_torque_of_an_inertia_is_what_its_node_gives_to_it() -> None:
    sol = _motion((sw.TorqueSource("motor", tau=-3.0), ("r",)), (sw.Inertia("J", J=2.0), ("r",)))
    _close(sol["J.tau"], np.full(9, -3.0))


def test_the_torque_of_a_spring_is_what_node_a_gives_to_node_b() -> None:
    """Node a runs ahead, so the spring drives node b and brakes node a."""
    sol = _motion(
        (sw.SpeedSource("drive", omega=2.0), ("a",)),
        (sw.Spring("shaft", c=5.0, d=0.5), ("a", "b")),
        (sw.Ground("wall"), ("b",)),
        (sw.Inertia("J", J=1.0), ("a",)),
    )
    _close(sol["shaft.tau"], 5.0 * 2.0 * TIMES + 0.5 * 2.0)
    _close(sol["shaft.tau_c"], 5.0 * 2.0 * TIMES)
    _close(sol["shaft.phi_rel"], 2.0 * TIMES)
    _close(sol["shaft.omega_rel"], np.full(9, 2.0))
    _close(sol["wall.reaction"], sol["shaft.tau"])
    _close(sol["drive.tau"], sol["shaft.tau"])


def test_the_torque_of_a_damper_is_what_node_a_gives_to_node_b() -> None:
    sol = _motion(
        (sw.SpeedSource("drive", omega=2.0), ("a",)),
        (sw.Damper("bearing", d=0.5), ("a", "b")),
        (sw.Inertia("J", J=1.0), ("b",)),
    )
    _close(sol["bearing.tau"], 0.5 * sol["bearing.omega_rel"])
    _close(sol["J.tau"], sol["bearing.tau"])
    assert (sol["J.omega"][1:] > 0).all()


@pytest.mark.parametrize("load", [sw.CoulombLoad("load", tau=1.0), sw.ViscousLoad("load", d=1.0)], ids=["dry", "wet"])
def test_the_torque_of_a_load_is_what_it_gives_to_its_node_against_the_motion(load: Component) -> None:
    """A one-port that is no store shows the torque on its node: a load of a node that turns forward is negative."""
    sol = _motion((sw.SpeedSource("drive", omega=2.0), ("r",)), (load, ("r",)), (sw.Inertia("J", J=1.0), ("x",)))
    assert (sol["load.tau"] < 0).all()
    _close(sol["drive.tau"], -sol["load.tau"])


@pytest.mark.parametrize(
    "part",
    [
        sw.Brake("part", tau=2.0),
        sw.DryFriction("part", tau_c=2.0),
        sw.Clutch("part", tau=2.0),
        sw.Freewheel("part"),
        sw.Backlash("part", gap=0.02, c=10.0),
        sw.HardStop("part", upper=0.01, c=10.0),
    ],
    ids=lambda part: type(part).__name__,
)
def test_the_torque_of_what_rubs_or_touches_is_what_node_a_gives_away(part: Component) -> None:
    """A drive turns node a forward: the part takes from it and gives to an inertia what it takes."""
    sol = _motion(
        (sw.Inertia("J1", J=2.0), ("a",)),
        (sw.TorqueSource("drive", tau=5.0), ("a",)),
        (part, ("a", "b")),
        (sw.Inertia("J2", J=1.0), ("b",)),
    )
    assert sol["part.tau"][-1] > 0
    _close(sol["part.tau"], 5.0 - sol["J1.tau"])
    _close(sol["part.tau"], sol["J2.tau"])


def test_the_torque_of_a_motor_is_what_it_gives_to_its_node() -> None:
    """Kloss' starting torque: ratio efficiency 2 tau_k s_k / (1 + s_k^2) at slip 1."""
    motor = sw.KlossMotor("motor", tau_k=10.0, s_k=0.25, n_sync=3000.0, ratio=4.0, efficiency=0.9)
    sol = _motion((motor, ("r",)), (sw.Inertia("J", J=100.0), ("r",)))
    assert sol["motor.tau"][0] == pytest.approx(4.0 * 0.9 * 2 * 10.0 * 0.25 / (1 + 0.25**2), rel=1e-12)
    assert (np.diff(sol["J.omega"]) > 0).all()
    _close(sol["J.tau"], sol["motor.tau"])


@pytest.mark.parametrize("ratio", [2.0, -3.0])
def test_a_gear_divides_the_speed_and_multiplies_the_torque(ratio: float) -> None:
    """omega_a = ratio omega_b and tau_b = -ratio tau_a, both torques counted into the gear."""
    sol = _motion(
        (sw.TorqueSource("motor", tau=3.0), ("a",)),
        (sw.Gear("gear", ratio=ratio), ("a", "b")),
        (sw.Inertia("J", J=2.0), ("b",)),
    )
    _close(sol["gear.omega_a"], ratio * sol["gear.omega_b"])
    _close(sol["gear.tau_a"], np.full(9, 3.0))
    _close(sol["gear.tau_b"], -ratio * sol["gear.tau_a"])
    _close(sol["J.omega"], ratio * 3.0 / 2.0 * TIMES)


def test_the_ring_of_a_planetary_gear_turns_against_the_sun_when_the_carrier_stands() -> None:
    sol = _motion(
        (sw.TorqueSource("motor", tau=3.0), ("sun",)),
        (sw.PlanetaryGear("set", ratio=2.5), ("sun", "carrier", "ring")),
        (sw.Ground("frame"), ("carrier",)),
        (sw.Inertia("J", J=2.0), ("ring",)),
    )
    _close(sol["set.omega_sun"], -2.5 * sol["set.omega_ring"])
    _close(sol["set.tau_sun"], np.full(9, 3.0))
    _close(sol["set.tau_ring"], 2.5 * sol["set.tau_sun"])
    _close(sol["set.tau_carrier"], -3.5 * sol["set.tau_sun"])


@pytest.mark.parametrize("kind", [sw.Drum, sw.Wheel])
def test_a_drum_pulls_forward_when_its_shaft_turns_forward(kind: Any) -> None:
    sol = _motion(
        (sw.TorqueSource("motor", tau=3.0), ("a",)),
        (kind("drum", radius=0.5), ("a", "x")),
        (sw.Mass("m", m=4.0), ("x",)),
    )
    _close(sol["drum.v_b"], 0.5 * sol["drum.omega_a"])
    _close(sol["drum.tau_a"], -0.5 * sol["drum.f_b"])
    _close(sol["m.v"], 3.0 / 0.5 / 4.0 * TIMES)


def test_a_voltage_source_lifts_its_first_node_and_shows_the_current_that_it_delivers() -> None:
    sol = _motion(
        (sw.VoltageSource("supply", u=6.0), ("p", "ground")),
        (sw.Resistor("R", R=3.0), ("p", "q")),
        (sw.Capacitor("C", C=0.1), ("q", "ground")),
    )
    charge = 6.0 * (1 - np.exp(-TIMES / 0.3))
    _close(sol["supply.u"], np.full(9, 6.0))
    _close(sol["C.u"], charge)
    _close(sol["R.i"], (6.0 - charge) / 3.0)
    _close(sol["supply.i"], sol["R.i"])
    _close(sol["C.i"], sol["R.i"])


def test_a_current_source_delivers_at_its_first_node() -> None:
    sol = _motion(
        (sw.CurrentSource("supply", i=2.0), ("p", "ground")),
        (sw.Capacitor("C", C=0.1), ("p", "ground")),
        (sw.Inductor("L", L=0.5), ("p", "q")),
        (sw.Resistor("R", R=3.0), ("q", "ground")),
    )
    assert (sol["C.u"][1:] > 0).all()
    assert (sol["L.i"][1:] > 0).all()
    _close(sol["supply.i"], np.full(9, 2.0))
    _close(sol["C.i"] + sol["L.i"], sol["supply.i"])


def test_a_dc_machine_on_a_positive_voltage_drives_its_rotor_forward() -> None:
    """u = k omega + R i + L di/dt and tau = k i, the torque that the machine gives to the rotor."""
    sol = _motion(
        (sw.VoltageSource("supply", u=6.0), ("p", "ground")),
        (sw.DCMachine("motor", k=0.5, R=2.0, L=0.1), ("p", "ground", "r")),
        (sw.Inertia("J", J=0.05), ("r",)),
    )
    assert (sol["J.omega"][1:] > 0).all()
    _close(sol["motor.tau"], 0.5 * sol["motor.i"])
    _close(sol["J.tau"], sol["motor.tau"])
    _close(sol["supply.i"], sol["motor.i"])
    _close(sol["motor.u"], np.full(9, 6.0))


def _in_a_test_bed(name: str) -> sw.Solution:
    return bed_of(name).simulate(0.4, t_eval=401, rtol=1e-11)


@pytest.mark.parametrize("name", registered())
def test_a_component_absorbs_what_it_stores_and_loses(name: str) -> None:
    """Power at the ports = d(energy)/dt + heat, for every component; of a source less what it supplies.

    The derivative is a central difference with h = 1 ms, whose error h^2/6 E''' stays below 1e-5 of the power; where a
    mode changes within it, it is none.
    """
    sol = _in_a_test_bed(name)
    lost, supplied = sol.observer.powers(sol.t, sol.x)
    heat = lost.get("subject", 0.0) - supplied.get("subject", np.zeros(len(sol.t)))
    energy = sol["subject.energy"]
    rate = (energy[2:] - energy[:-2]) / (sol.t[2:] - sol.t[:-2])
    power = sol["subject.power"]
    size = max(np.abs(heat).max(), np.abs(rate).max(), np.abs(sol["push0.power"]).max())
    changes = np.array([row[0] for row in sol.events])
    kept = np.searchsorted(changes, sol.t[:-2], "right") == np.searchsorted(changes, sol.t[2:], "left")
    assert kept.mean() > 0.5
    np.testing.assert_allclose(power[1:-1][kept], (rate + heat[1:-1])[kept], atol=1e-5 * size)
    if REGISTRY[name].role == "coupling" and name not in ("DCMachine", "LossyGear"):
        np.testing.assert_allclose(power, 0.0, atol=1e-12 * size)
    if REGISTRY[name].role == "store":
        assert np.abs(energy).max() > 0
        assert "subject" in sol.observer.stored(sol.t, sol.x, sol.dense)


@pytest.mark.slow
@pytest.mark.parametrize("name", registered())
def test_the_signals_of_a_component_multiply_to_its_power(name: str) -> None:
    """Across times through, summed over the ports with the signs of the sign page, is what the part absorbs."""
    sol, kind = _in_a_test_bed(name), REGISTRY[name]
    wanted = sol["subject.power"]
    if name == "Ground":
        found = np.zeros_like(wanted)
    elif name == "DCMachine":
        found = sol["subject.u"] * sol["subject.i"] - sol["subject.omega"] * sol["subject.tau"]
    elif name == "Shaft":
        found = sol["subject.omega_a"] * sol["subject.tau_a"] - sol["subject.omega_b"] * sol["subject.tau_b"]
    elif name == "Transformer":
        found = sol["subject.u_1"] * sol["subject.i_1"] + sol["subject.u_2"] * sol["subject.i_2"]
    elif name == "TransmissionLine":
        found = sol["subject.u_a"] * sol["subject.i_a"] + sol["subject.u_b"] * sol["subject.i_b"]
    elif kind.role == "coupling":
        found = np.zeros_like(wanted)
        for port in kind.ports:
            names = (f"subject.{quantity.name}_{port.name}" for quantity in (port.domain.across, port.domain.through))
            found += np.prod([sol[name] for name in names], axis=0)
    else:
        domain = kind.ports[0].domain
        suffix = "_rel" if len(kind.ports) == 2 and domain is not ELECTRICAL else ""
        against = kind.role == "source" or (kind.role == "loss" and len(kind.ports) == 1)
        product = sol[f"subject.{domain.across.name}{suffix}"] * sol[f"subject.{domain.through.name}"]
        found = -product if against else product
    np.testing.assert_allclose(found, wanted, atol=1e-10 * max(np.abs(sol["push0.power"]).max(), 1.0))
