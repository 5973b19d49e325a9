"""Duals of drive trains: series and parallel change places, and a graph that is not planar has none."""

from __future__ import annotations

import numpy as np
import pytest

import shaftwork as sw
from tests.analogues.test_circuits import TIMES, two_masses


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


def test_all_parts_without_a_dual_are_named() -> None:
    with pytest.raises(sw.NetworkError) as caught:
        sw.scenes.six_phases().dual()
    assert {name for problem in caught.value.problems for name in problem.parts} == {
        "motor", "brake", "shaft", "load",
    }  # fmt: skip
    assert all("net.circuit()" in problem.hint for problem in caught.value.problems)


def test_a_torque_that_rises_with_the_speed_has_a_circuit_but_no_dual() -> None:
    net = sw.Network("unstable")
    net.add(sw.TorqueSource("motor", tau=1.0 + 0.5 * sw.omega), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    assert net.circuit().check() == ()
    with pytest.raises(sw.NetworkError, match="TorqueSource 'motor': its torque rises with its speed"):
        net.dual()


def test_a_long_shaft_is_written_out() -> None:
    net = sw.scenes.shaft_step(model=sw.Lumped(4))
    dual = net.dual()
    assert sum(isinstance(part, sw.Capacitor) for part in dual.parts) == 4


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
