"""Which branches carry the state: the normal tree of small networks whose answer is known by hand."""

from __future__ import annotations

import pytest
import sympy

import shaftwork as sw
from shaftwork.formulation.gains import exact_of, value_of
from shaftwork.formulation.tree import NormalTree, normal_tree
from shaftwork.network.graph import CircuitGraph, build_graph
from shaftwork.network.kinds import Kind

Placed = tuple[sw.Component, tuple[str, ...]]


def _tree(*placed: Placed) -> tuple[CircuitGraph, NormalTree]:
    net = sw.Network("by hand")
    for part, nodes in placed:
        net.add(part, *nodes)
    graph = build_graph(net.netlist())
    return graph, normal_tree(graph)


def _names(graph: CircuitGraph, branches: tuple[int, ...]) -> list[str]:
    return [graph.part_of(branch).name for branch in branches]


GEARED: tuple[Placed, ...] = (
    (sw.Inertia("J1", J=1.0), ("a",)),
    (sw.Gear("gear", ratio=2.5), ("a", "b")),
    (sw.Inertia("J2", J=1.0), ("b",)),
    (sw.Spring("shaft", c=10.0, d=0.1), ("b", "c")),
    (sw.Inertia("J3", J=1.0), ("c",)),
    (sw.TorqueSource("motor", tau=1.0), ("a",)),
)


def test_inertias_enter_the_tree_and_springs_stay_outside() -> None:
    graph, tree = _tree(*GEARED)
    assert _names(graph, tree.tree[Kind.ACROSS_STORE]) == ["J1", "J3"]
    assert _names(graph, tree.links[Kind.THROUGH_STORE]) == ["shaft"]
    assert _names(graph, tree.links[Kind.CONDUCTANCE]) == ["shaft"]
    assert _names(graph, tree.links[Kind.THROUGH_SOURCE]) == ["motor"]


def test_a_rigidly_geared_inertia_is_a_link_whose_loop_holds_the_ratio() -> None:
    """omega_J2 = omega_J1 / ratio."""
    graph, tree = _tree(*GEARED)
    (link,) = tree.links[Kind.ACROSS_STORE]
    stores = {graph.part_of(k).name: gain for k, gain in tree.loops[link].items() if k in tree.tree[Kind.ACROSS_STORE]}
    assert list(stores) == ["J1"]
    assert value_of(stores["J1"]) == pytest.approx(1 / 2.5)
    assert exact_of([stores["J1"]])[0] == 1 / sympy.Symbol("gear.ratio", real=True)


def test_every_node_is_a_sum_of_tree_branches() -> None:
    """Node c moves with J3 alone, node b with J1 through the gear."""
    graph, tree = _tree(*GEARED)
    stores = tree.tree[Kind.ACROSS_STORE]
    moved = {
        node: {graph.part_of(k).name: value_of(g) for k, g in row.items() if k in stores}
        for node, row in zip(graph.nodes, tree.potentials, strict=True)
        if row is not None
    }
    assert moved == {"a": {"J1": 1.0}, "b": {"J1": pytest.approx(0.4)}, "c": {"J3": 1.0}}


def test_a_prescribed_speed_goes_before_an_inertia() -> None:
    graph, tree = _tree((sw.Inertia("J", J=1.0), ("a",)), (sw.SpeedSource("drive", omega=1.0), ("a",)))
    assert _names(graph, tree.tree[Kind.ACROSS_SOURCE]) == ["drive"]
    assert _names(graph, tree.links[Kind.ACROSS_STORE]) == ["J"]


def test_of_springs_in_series_all_but_one_enter_the_tree() -> None:
    graph, tree = _tree(
        (sw.Inertia("J1", J=1.0), ("a",)),
        (sw.Spring("s1", c=1.0), ("a", "m")),
        (sw.Spring("s2", c=1.0), ("m", "b")),
        (sw.Inertia("J2", J=1.0), ("b",)),
    )
    assert _names(graph, tree.tree[Kind.THROUGH_STORE]) == ["s1"]
    assert _names(graph, tree.links[Kind.THROUGH_STORE]) == ["s2"]


def test_a_second_gear_of_equal_ratio_is_redundant_and_locks_nothing() -> None:
    graph, tree = _tree(*GEARED, (sw.Gear("twin", ratio=2.5), ("a", "b")))
    assert _names(graph, tree.redundant) == ["twin"]
    assert not tree.locked


def test_ratios_that_agree_only_in_value_are_remembered() -> None:
    """Two parallel gears: their equations agree because both ratios are 2.5, not because they are one parameter."""
    _, tree = _tree(*GEARED, (sw.Gear("twin", ratio=2.5), ("a", "b")))
    assert {name for entry in tree.frozen for name in _parameters(entry)} == {"gear.ratio", "twin.ratio"}


def _parameters(frozen: object) -> set[str]:
    """A remembered condition is a parameter's name, or an expression of parameters."""
    return {s.name for s in frozen.free_symbols} if isinstance(frozen, sympy.Expr) else {str(frozen)}


def test_ratios_typed_to_ten_digits_still_agree_around_a_loop() -> None:
    """7/3 typed to ten decimals differs from 7/3 by a part of 1e-11, far more than rounding."""
    loop = [("g1", 2.3333333333, ("a", "b")), ("g2", 1.5, ("b", "c")), ("g3", 3.5, ("a", "c"))]
    graph, tree = _tree(
        (sw.Inertia("J", J=1.0), ("a",)), *((sw.Gear(name, ratio=ratio), nodes) for name, ratio, nodes in loop)
    )
    assert _names(graph, tree.redundant) == ["g3"]
    assert not tree.locked


def test_unequal_gears_side_by_side_lock_both_shafts() -> None:
    graph, tree = _tree(*GEARED, (sw.Gear("other", ratio=3.0), ("a", "b")))
    ((closing, nodes),) = tree.locked
    assert graph.part_of(closing).name == "other"
    assert {graph.nodes[node] for node in nodes} == {"a", "b"}
    assert "J1" not in _names(graph, tree.tree[Kind.ACROSS_STORE])


def test_a_node_without_any_path_has_no_potential() -> None:
    graph, tree = _tree((sw.Inertia("J", J=1.0), ("a",)), (sw.Resistor("R", R=1.0), ("p", "q")))
    known = dict(zip(graph.nodes, tree.potentials, strict=True))
    assert known["a"] is not None
    assert known["p"] is None
    assert known["q"] is None


def test_loops_and_cutsets_are_transposes() -> None:
    """Tellegen: v_link = F' v_tree and i_tree = -F i_link, so the powers of all branches cancel for any v and i."""
    graph, tree = _tree(*GEARED, (sw.Spring("frame", c=1.0), ("a", "ground")))
    for link, loop in tree.loops.items():
        around: dict[int, float] = {}
        for branch, factor in ((link, 1.0), *((k, -value_of(gain)) for k, gain in loop.items())):
            placed = graph.branches[branch]
            terms = placed.terms or ((sympy.Integer(1), placed.plus, placed.minus),)
            ratio = {sympy.Symbol("ratio", real=True): 2.5}
            for coefficient, plus, minus in terms:
                for node, sign in ((plus, 1.0), (minus, -1.0)):
                    around[node] = around.get(node, 0.0) + sign * factor * float(coefficient.xreplace(ratio))
        assert all(abs(total) < 1e-15 for node, total in around.items() if node >= 0), graph.part_of(link).name
