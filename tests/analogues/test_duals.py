"""Duals of drive trains: series and parallel change places, and a graph that is not planar has none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.friction import rubbing, rubs
from shaftwork.scenes import SCENES
from tests.analogues.test_circuits import LONG, TIMES, same_motion, two_masses
from tests.beds import bed_of, registered


def rotors_all_joined(count: int, *, without: tuple[tuple[int, int], ...] = ()) -> sw.Network:
    """Rotors with a spring between any two of them: with the frame a complete graph of one node more."""
    net = sw.Network("all joined")
    net.add(sw.TorqueSource("motor", tau=1.0), "n0")
    for k in range(count):
        net.add(sw.Inertia(f"J{k}", J=1.0 + k), f"n{k}")
        for other in range(k):
            if (other, k) not in without:
                net.add(sw.Spring(f"c{other}{k}", c=100.0 + k + other, d=0.1), f"n{other}", f"n{k}")
    return net


def test_the_elements_are_those_of_popenda() -> None:
    dual = two_masses().dual()
    values = {part.name: (type(part).__name__, *part.values.values()) for part in dual.parts}
    assert values == {
        "motor": ("VoltageSource", 10.0 * sw.t),
        "J1": ("Inductor", 2.0),
        "shaft": ("Capacitor", 0.01),
        "shaft d": ("Resistor", 1.0),
        "J2": ("Inductor", 3.0),
        "gear": ("Transformer", 0.4),
        "load": ("Resistor", 0.4),
    }
    assert dual.check() == ()


def test_what_is_parallel_is_in_series() -> None:
    dual = two_masses().dual()
    nodes = {placed.part.name: placed.nodes for placed in dual.netlist().placed}
    between = {*nodes["shaft"]} & {*nodes["shaft d"]}
    assert len(between) == 1
    assert all(between.isdisjoint(ends) for name, ends in nodes.items() if not name.startswith("shaft"))
    assert "ground" in nodes["shaft"]


def test_speeds_are_currents_and_torques_voltages() -> None:
    net = two_masses()
    dual = net.dual()
    assert dual.analogy is not None
    assert dual.analogy.quantities["J1.omega"] == {"J1.i": 1.0}
    assert dual.analogy.quantities["J1.tau"] == {"J1.u": 1.0}
    wanted, found = net.simulate(0.3, t_eval=TIMES), dual.simulate(0.3, t_eval=TIMES)
    np.testing.assert_allclose(found["J2.i"], wanted["J2.omega"], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found["shaft.u"] + found["shaft d.u"], wanted["shaft.tau"], rtol=1e-12, atol=1e-15)


def test_the_dual_of_a_dual_is_the_circuit_up_to_names_of_nodes() -> None:
    net = two_masses()
    circuit, twice = net.circuit(), net.dual().dual()
    names: dict[str, str] = {}
    for first, second in zip(circuit.netlist().placed, twice.netlist().placed, strict=True):
        assert type(first.part) is type(second.part)
        assert first.part.name == second.part.name
        assert first.part.values == pytest.approx(second.part.values)
        for node, other in zip(first.nodes, second.nodes, strict=True):
            assert names.setdefault(node, other) == other
    assert names["ground"] == "ground"


def test_a_rotor_alone_is_a_coil_that_is_short_circuited() -> None:
    net = sw.Network("free")
    net.add(sw.Inertia("J", J=2.0), "a")
    dual = net.dual()
    assert dual.simulate(1.0, initial={"J.i": 3.0})["J.i"][-1] == pytest.approx(3.0)


def test_four_rotors_that_are_all_joined_have_no_dual() -> None:
    with pytest.raises(sw.NetworkError) as caught:
        rotors_all_joined(4).dual()
    (problem,) = caught.value.problems
    assert problem.kind == "not planar"
    assert "as the graph K5" in problem.message
    assert {"c01", "c02", "c03", "c12", "c13", "c23"} <= {*problem.parts}
    assert {*problem.nodes} == {"n0", "n1", "n2", "n3", "ground"}
    assert "net.circuit()" in problem.hint


def test_a_spring_less_they_have_one() -> None:
    net = rotors_all_joined(4, without=((0, 3),))
    dual = net.dual()
    wanted, found = net.simulate(0.3, t_eval=TIMES), dual.simulate(0.3, t_eval=TIMES)
    np.testing.assert_allclose(found["J3.i"], wanted["J3.omega"], rtol=1e-9)


def test_two_rows_of_three_have_no_dual() -> None:
    """A frame and two rotors, each joined with three rotors: with the inertias of the three K3,3."""
    net = sw.Network("two rows")
    net.add(sw.TorqueSource("motor", tau=1.0), "a0")
    for k in range(2):
        net.add(sw.Inertia(f"A{k}", J=1.0), f"a{k}")
    for k in range(3):
        net.add(sw.Inertia(f"B{k}", J=1.0), f"b{k}")
        for other in range(2):
            net.add(sw.Spring(f"c{other}{k}", c=100.0), f"a{other}", f"b{k}")
    with pytest.raises(sw.NetworkError, match=r"join nodes .* as the graph K3,3"):
        net.dual()


WHY_NOT = (
    (
        sw.InductionMachine("part", U=400, f=50, L_m=0.1, L_s_sigma=4e-3, L_r_sigma=4e-3, R_r=0.3),
        "its laws read other nodes and branches, and those of a dual their own current alone",
    ),
    (sw.Inertia("part", J=2.0 + 0.5 * sympy.sin(sw.phi)), "what it stores changes, and inductances are constant"),
    (
        sw.LossyGear("part", ratio=2.0, efficiency=0.9),
        "it does not hand on all power that it takes: teeth lose some, and controlled sources add theirs",
    ),
    (
        sw.Shaft("part", length=3.0, diameter=0.05, model=sw.Wave()),
        "waves travel along it; Lumped(20) instead of Wave() has one",
    ),
    (
        sw.Backlash("part", gap=0.1),
        "it changes its mode by other rules than frictions, freewheels and gaps with springs do",
    ),
    (sw.Brake("part", tau=3.0, on=sw.omega - 5.0), "it comes on by a law, and not at a time that is known before"),
    (sw.Brake("part", tau=3.0 + sw.phi**2), "it rubs by its angle"),
    (sw.DryFriction("part", tau_c=1.0, tau_s=2.0, omega_s=0.0), "it holds more than it rubs with at any speed"),
)


@pytest.mark.parametrize(("part", "why"), WHY_NOT, ids=lambda item: item if isinstance(item, str) else "")
def test_a_part_without_a_dual_is_named_with_the_reason(part: sw.Component, why: str) -> None:
    net = sw.Network("one part")
    ends = ("a", "b")[: len(part.ports)]
    for node in ends:
        net.add(sw.Inertia(f"J{node}", J=1.0), node)
    net.add(part, *ends)
    with pytest.raises(sw.NetworkError) as caught:
        net.dual()
    (problem,) = caught.value.problems
    assert problem.message == f"{type(part).__name__} 'part': {why}."
    assert "net.circuit()" in problem.hint


def test_all_parts_without_a_dual_are_named() -> None:
    net = two_masses()
    net.add(sw.LossyGear("second gear", ratio=2.0, efficiency=0.9), "output", "drum")
    net.add(sw.Backlash("claws", gap=0.1), "drum", "last")
    net.add(sw.Inertia("J3", J=1.0), "last")
    with pytest.raises(sw.NetworkError) as caught:
        net.dual()
    assert [problem.parts for problem in caught.value.problems] == [("second gear",), ("claws",)]


def test_a_torque_that_rises_with_the_speed_is_a_voltage_that_rises_with_the_current() -> None:
    net = sw.Network("unstable")
    net.add(sw.TorqueSource("motor", tau=1.0 + 0.5 * sw.omega), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    same_motion(net, of=net.dual())


def train_with_laws() -> sw.Network:
    net = sw.Network("laws")
    net.add(sw.TorqueSource("motor", tau=60 - 2 * sw.omega - 0.01 * sw.omega * sympy.Abs(sw.omega)), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.TorqueSource("weight", tau=-3 * sympy.sin(sw.phi)), "a")
    net.add(sw.Spring("shaft", c=300.0 * (1 + sw.phi**2), d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Backlash("claws", gap=0.1, c=100.0, d=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    net.add(sw.Freewheel("freewheel"), "c", "d")
    net.add(sw.Inertia("J4", J=1.0), "d")
    net.add(sw.TorqueSource("pump", tau=sw.Table([0, 5, 10], [0, -4, -20])(sw.omega)), "d")
    return net


def train_that_rubs() -> sw.Network:
    net = train_with_laws()
    net.add(sw.DryFriction("friction", tau_c=3.0, tau_s=5.0), "a")
    net.add(sw.Brake("brake", tau=sw.Table([0, 3], [0, 4]), t_on=0.5, t_off=2.5), "c")
    return net


@sw.component
class Jamming(sw.Component):
    """Holds twice as much as it rubs with."""

    tau: float = sw.parameter("N*m", "torque while it slips")

    role: ClassVar[Any] = "loss"
    ports: ClassVar = (sw.Port("a"),)

    def modes(self, p: Any) -> Iterator[sw.Modes]:
        yield rubbing(2 * p.tau)

    def branches(self, p: Any) -> Iterator[Any]:
        yield rubs(p.mode * p.tau, p, None)


def test_a_part_that_holds_otherwise_than_diodes_do_has_no_dual() -> None:
    net = two_masses()
    net.add(Jamming("jam", tau=2.0), "output")
    with pytest.raises(sw.NetworkError, match="holds up to another torque than it rubs with as it begins to slip"):
        net.dual()


@pytest.mark.parametrize(
    "start",
    [
        {"J1.omega": 5.0, "J2.omega": -3.0, "J3.omega": -3.0, "J4.omega": 2.0},
        {"J1.omega": 2.0, "J2.omega": 2.0, "J3.omega": 2.0, "J4.omega": 2.0, "claws.phi": 0.2, "shaft.phi": -0.1},
    ],
    ids=["apart", "together"],
)
@pytest.mark.slow
def test_a_dual_starts_in_the_modes_of_its_network(start: dict[str, float]) -> None:
    net = train_that_rubs()
    same_motion(net, np.linspace(0.0, 1.0, 11), of=net.dual(), start=start)


@pytest.mark.slow
def test_laws_of_speed_angle_and_time_are_laws_of_current_charge_and_time() -> None:
    net = train_that_rubs()
    dual = net.dual()
    assert dual.check() == ()
    same_motion(net, np.linspace(0.0, 3.0, 31), of=dual)


def test_the_dual_of_a_dual_has_the_laws_of_the_network() -> None:
    net = train_with_laws()
    twice = {part.name: part for part in net.dual().dual().parts}
    assert twice["motor"] == sw.CurrentSource("motor", i=60 - 2 * sw.u - 0.01 * sw.u * sympy.Abs(sw.u))
    assert twice["weight"] == sw.CurrentSource("weight", i=-3 * sympy.sin(sw.psi))
    dual = net.dual()
    same_motion(dual, of=dual.dual())


def test_a_dual_with_laws_is_the_same_after_it_was_saved(tmp_path: Path) -> None:
    dual = train_that_rubs().dual()
    dual.save(tmp_path / "dual.toml")
    assert sw.Network.load(tmp_path / "dual.toml") == dual


WITHOUT_DUAL = (
    *("LossyGear", "Backlash", "TranslationalBacklash", "SpeedController"),
    *("Switch", "InductionMachine", "BLDCMotor", "AveragedBLDC"),
    *("StateSpaceController", "TransferFunctionController"),
    *("VoltageControlledVoltageSource", "VoltageControlledCurrentSource", "VoltageControlledSwitch"),
    *("CurrentControlledCurrentSource", "CurrentControlledVoltageSource", "TransmissionLine"),
)
"""Parts of which the one in the test bed has no dual: flanks there are rigid."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in LONG))
        for name in registered()
        if name not in WITHOUT_DUAL
    ],
)
def test_the_dual_of_every_other_part_moves_as_it_does(name: str) -> None:
    net = bed_of(name)
    same_motion(net, of=net.dual())


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if name not in ("bldc-shaft", "ship-line", "ship-engine")])
def test_the_dual_of_a_scene_moves_as_it_does(name: str) -> None:
    net = SCENES[name]()
    same_motion(net, np.linspace(0.0, min(SCENES[name].t_end, 10.0), 101), of=net.dual())


def rubbing_twice(second: str) -> sw.Network:
    net = sw.Network("two frictions")
    net.add(sw.TorqueSource("motor", tau=20 * sympy.sin(3 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.CoulombLoad("load", tau=3.0), "a")
    net.add(sw.Gear("gear", ratio=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Brake("brake", tau=2.0, t_on=0.1), second)
    return net


def test_frictions_side_by_side_are_one() -> None:
    """How they share what holds is open, so that it cannot be read."""
    net = rubbing_twice("a")
    dual = net.dual()
    assert dual.analogy is not None
    times = np.linspace(0.0, 3.0, 31)
    wanted, found = (one.simulate(3.0, t_eval=times, rtol=1e-10) for one in (net, dual))
    for name in ("J1.omega", "J2.tau", "gear.tau_b", "brake.omega"):
        reached = dual.analogy.read(found, name)
        np.testing.assert_allclose(reached, wanted[name], atol=1e-9 * np.abs(wanted[name]).max(), rtol=0)
    with pytest.raises(sw.SignalError, match=r"no quantity 'brake\.tau'"):
        dual.analogy.read(found, "brake.tau")


def test_frictions_that_hold_the_same_train_have_no_dual() -> None:
    with pytest.raises(sw.NetworkError, match=r"Brake 'brake' holds what .*'load'.* can hold too"):
        rubbing_twice("b").dual()


def test_what_is_held_is_read_from_a_dual_too() -> None:
    net = sw.Network("held")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("shaft", c=10.0, d=1.0), "a", "wall")
    net.add(sw.Ground("frame"), "wall")
    net.add(sw.Damper("idle", d=1.0), "wall")
    net.add(sw.TorqueSource("pushed", tau=3.0 - sw.omega), "wall")
    same_motion(net, of=net.dual())


def test_a_long_shaft_is_written_out() -> None:
    net = sw.scenes.shaft_step(model=sw.Lumped(4))
    dual = net.dual()
    assert sum(isinstance(part, sw.Capacitor) for part in dual.parts) == 4


@pytest.mark.parametrize("model", [sw.Lumped(5), sw.Spectral(6), sw.CentralDifference(6), sw.OneSpring()])
def test_a_long_shaft_starts_in_the_dual_as_it_does(model: Any) -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Inertia("J1", J=0.02), "a")
    net.add(sw.Shaft("line", length=3.0, diameter=0.05, damping=30.0, friction=0.01, model=model), "a", "b")
    net.add(sw.Inertia("J2", J=0.05), "b")
    start, times, dual = {"J1.omega": 30.0, "J2.omega": 10.0}, np.linspace(0.0, 0.02, 11), net.dual()
    same_motion(net, times, of=dual, start=start)
    assert dual.analogy is not None
    wanted = net.simulate(0.02, t_eval=times, rtol=1e-10, initial=start)
    found = dual.simulate(0.02, t_eval=times, rtol=1e-10, initial=dual.analogy.initial(start))
    for name in ("line.omega", "line.tau"):
        along = dual.analogy.read(found, name)
        assert np.shape(along) == np.shape(wanted[name])
        np.testing.assert_allclose(along, wanted[name], atol=1e-9 * np.abs(wanted[name]).max(), rtol=0)


@pytest.mark.parametrize("ratio", [2.0, -2.0])
def test_gears_and_machines_have_duals(ratio: float) -> None:
    net = sw.Network("machine")
    net.add(sw.VoltageSource("supply", u=24.0), "p", "ground")
    net.add(sw.DCMachine("machine", k=0.3, R=0.5, L=0.01), "p", "ground", "rotor")
    net.add(sw.Inertia("J1", J=0.02), "rotor")
    net.add(sw.Gear("gear", ratio=ratio), "rotor", "output")
    net.add(sw.Damper("load", d=0.1), "output")
    dual = net.dual()
    assert dual.analogy is not None
    wanted, found = net.simulate(0.3, t_eval=TIMES), dual.simulate(0.3, t_eval=TIMES)
    for name in ("machine.i", "machine.tau", "J1.omega", "load.tau", "gear.tau_b", "supply.i"):
        np.testing.assert_allclose(dual.analogy.read(found, name), wanted[name], rtol=1e-9, atol=1e-12)
