"""The circuit graph: every branch of every part, parallel ones included."""

from __future__ import annotations

import networkx as nx

import shaftwork as sw


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
