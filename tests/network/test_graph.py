"""The circuit graph: every branch of every part, parallel ones included."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.core.domains import ROTATION
from shaftwork.network.templates import Shared


def hoist(**shaft: float) -> sw.Network:
    net = sw.Network("hoist")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.Spring("shaft", **{"c": 1e4, "d": 2.0, **shaft}), "rotor", "barrel")
    net.add(sw.Drum("drum", radius=0.2), "barrel", "hook")
    net.add(sw.Mass("load", m=50.0), "hook")
    return net


def test_a_spring_and_its_damping_are_parallel_edges() -> None:
    graph = hoist().graph().multigraph
    assert graph.number_of_edges("rotor", "barrel") == 2
    assert {data["part"] for *_, data in graph.edges("rotor", data=True)} == {"motor", "J1", "shaft"}


def test_every_term_of_every_branch_is_an_edge_and_the_reference_joins_all_domains() -> None:
    circuit = hoist().graph()
    graph = circuit.multigraph
    assert graph.number_of_edges() == sum(max(1, len(branch.terms)) for branch in circuit.branches)
    assert list(graph.nodes) == ["rotor", "barrel", "hook", "ground"]
    assert nx.is_weakly_connected(graph)
    assert [domain.name for domain in circuit.domains] == ["rotation", "rotation", "translation"]


def test_what_is_exactly_zero_leaves_no_branch() -> None:
    whole, less = hoist().graph(), hoist(d=0.0).graph()
    assert len(less.branches) == len(whole.branches) - 1
    assert less.zeros == ("shaft.d",)
    assert "shaft.d" not in less.parameters


def test_inner_nodes_are_named_after_their_part() -> None:
    net = sw.Network("drive")
    net.add(sw.VoltageSource("supply", u=24.0), "plus", "ground")
    net.add(sw.DCMachine("machine", k=0.1, R=0.5, L=1e-3), "plus", "ground", "rotor")
    net.add(sw.Inertia("J", J=0.01), "rotor")
    assert net.graph().nodes == ("plus", "rotor", "machine.resistor", "machine.emf")


@sw.component
class Stack(sw.Component):
    """So many equal springs in a row, with a wheel between each two: its branches need the number itself."""

    number: float = sw.parameter("1", "springs", at_least=1, whole=True)
    c: float = sw.parameter("N*m/rad", "stiffness of one", above=0)

    def inner_ports(self) -> tuple[sw.Port, ...]:
        return tuple(sw.Port(f"w{k}") for k in range(1, int(self.number)))

    def branches(self, p: Any) -> Iterator[object]:
        names = ["a", *(port.name for port in self.inner_ports()), "b"]
        for k, ends in enumerate(pairwise(names)):
            yield sw.ThroughStore(p.c, ends, f"tau_{k}")
        for name in names[1:-1]:
            yield sw.AcrossStore(sympy.Rational(1, 10), (name, None), f"omega_{name}")

    def signals(self) -> dict[str, sw.Signal]:
        return {"tau": sw.Signal("through", ("a", None), ROTATION)}


def stacked(*numbers: int) -> sw.Network:
    net = sw.Network("stacks")
    net.add(sw.TorqueSource("motor", tau=1.0), "n0")
    for k, number in enumerate(numbers):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        net.add(Stack(f"stack{k}", number=number, c=100.0), f"n{k}", f"n{k + 1}")
    net.add(sw.Inertia("J", J=1.0), f"n{len(numbers)}")
    return net


def described(net: sw.Network, part: str) -> list[tuple[Any, ...]]:
    """Kind, law, ends by name and label of every branch of a part."""
    graph = net.graph()
    found = next(made for made in graph.parts if made.name == part)
    rows = (graph.branches[k] for k in found.branches)
    return [(b.template.kind, b.template.law, b.template.ends, b.template.terms, b.template.label) for b in rows]


def test_parts_that_look_at_their_own_numbers_have_branches_of_their_own() -> None:
    for numbers in ((2, 5), (5, 2), (3, 1, 3, 4)):
        together = stacked(*numbers)
        for k, number in enumerate(numbers):
            assert described(together, f"stack{k}") == described(stacked(number), "stack0")


def test_a_ground_that_is_added_first_leaves_its_node_to_what_moves_there() -> None:
    net = sw.Network("wagon")
    net.add(sw.Ground("frame"), "wall")
    net.add(sw.TranslationalSpring("buffer", c=100.0), "wall", "car")
    net.add(sw.Mass("m", m=1.0), "car")
    names = net.simulate(0.1).names
    assert "wall.v" in names
    assert not any(name.endswith((".omega", ".tau")) for name in names)


def test_parts_that_are_alike_are_worked_out_once() -> None:
    """What makes a chain of a thousand springs quick; a number that becomes zero may change the branches."""
    worked: list[Any] = []
    shared = Shared(lambda part, *_: worked.append(part.ports))
    numbers = []
    for name, c, d in (("first", 100.0, 1.0), ("equal", 100.0, 1.0), ("softer", 50.0, 2.0), ("undamped", 50.0, 0.0)):
        shared.of(sw.Spring(name, c=c, d=d), {"c": c, "d": d})
        numbers.append(len(worked))
    assert numbers == [1, 1, 1, 2]


def test_work_that_looks_at_all_of_a_part_is_done_for_each() -> None:
    shared = Shared(lambda part, *_: vars(part)["name"])
    assert [shared.of(sw.Spring(name, c=1.0), {"c": 1.0, "d": 0.0})[0] for name in "ab"] == ["a", "b"]


@pytest.mark.slow
@pytest.mark.parametrize("first", [0.4, 1.0, 3.0])
def test_two_shafts_with_equal_auto_models_have_meshes_of_their_own(first: float) -> None:
    """A shaft of another length takes another mesh; the motion is that with both meshes given, to rounding."""
    steel = {"diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}

    def train(*models: ShaftModel) -> sw.Network:
        net = sw.Network("train")
        net.add(sw.TorqueSource("motor", tau=10.0), "a")
        for name, node in zip("123", "abc", strict=True):
            net.add(sw.Inertia(f"J{name}", J=0.1), node)
        for name, ends, length, model in zip("12", ("ab", "bc"), (first, 2.0), models, strict=True):
            net.add(sw.Shaft(f"line{name}", length=length, model=model, **steel), *ends)
        return net

    auto = train(sw.Auto(f_max=2000.0), sw.Auto(f_max=2000.0))
    chosen = [part.resolved for part in auto.parts if isinstance(part, sw.Shaft)]
    assert chosen[0] != chosen[1]
    own, wanted = (net.simulate(0.01)["line2.tau_b"] for net in (auto, train(*chosen)))
    np.testing.assert_allclose(own, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_new_number_that_a_part_looks_at_makes_its_branches_anew() -> None:
    model = stacked(2).compile()
    assert len(model.simulate(0.1, parameters={"stack0.number": 4.0}).states) == len(stacked(4).compile().states)
    assert len(model.simulate(0.1, parameters={"stack0.c": 50.0}).states) == len(model.states)
