"""M q'' + D q' + K q = T of mechanical networks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from sympy import cancel

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.components.branches import Branch, across_of
from shaftwork.core.errors import CompileError
from shaftwork.equations.second_order import second_order
from tests.equations.networks import MECHANICAL, dc_drive, graph_of
from tests.lagrange.test_lagrange import quantity


@pytest.mark.parametrize("name", MECHANICAL)
def test_mass_damping_and_stiffness_are_symmetric(name: str) -> None:
    form = second_order(graph_of(MECHANICAL[name]()))
    for entries in (form.mass, form.damping, form.stiffness):
        assert all(cancel(entry - entries[j, i]) == 0 for (i, j), entry in entries.items())


def test_a_node_without_inertia_keeps_an_empty_row_of_m() -> None:
    form = second_order(graph_of(MECHANICAL["springs in series"]()))
    assert [str(q) for q in form.coordinates] == ["J1.phi", "J2.phi", "phi(m)"]
    assert not any(2 in place for place in form.mass)


def test_referred_inertias_are_divided_by_the_square_of_the_ratio() -> None:
    form = second_order(graph_of(MECHANICAL["geared inertias"]()))
    first, second, ratio = (quantity(name) for name in ("J1.J", "J2.J", "g.ratio"))
    assert form.mass == {(0, 0): first + second / ratio**2}


def test_a_row_of_a_large_network_names_every_torque_at_its_node() -> None:
    """Where no matrix fits on the page: each source once, on the right side, which goes over two lines."""
    net = sw.Network("row")
    for k in range(14):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        if k:
            net.add(sw.Spring(f"c{k}", c=1.0 + k), f"n{k - 1}", f"n{k}")
    for k in range(8):
        net.add(sw.TorqueSource(f"source{k}", tau=1.0 + k * sw.t), "n3")
    text = net.equations().latex(form="second-order")
    (row,) = (row for row in text.partition("where")[0].split(r" \\[1ex]") if "source" in row)
    right = row.rpartition(" = ")[2]
    assert [right.count(rf"+ \tau_{{\mathrm{{source}},{k}}}") for k in range(1, 8)] == [1] * 7
    assert right.startswith(r"\tau_{\mathrm{source},0}")


def test_an_electrical_network_has_no_second_order_form() -> None:
    with pytest.raises(CompileError, match=r"electrical nodes p, M\.resistor"):
        second_order(graph_of(dc_drive()))


def test_a_law_that_reads_other_quantities_of_its_part_has_no_second_order_form_and_is_named() -> None:
    @sw.component
    class Follower(sw.Component):
        gain: float = sw.parameter("N*m*s/rad", "torque on b over the speed of a")
        ports = (sw.Port("a"), sw.Port("b"))

        def branches(self, p: Any) -> Iterator[Branch]:
            yield sw.ThroughLaw(p.gain * across_of("a"), ("b", None))

    try:
        net = sw.Network("led")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(Follower("follower", gain=2.0), "a", "b")
        net.add(sw.Inertia("J2", J=1.0), "b")
        with pytest.raises(CompileError, match="A law of 'follower' reads other quantities than its own speed"):
            net.equations().latex("second-order")
    finally:
        del REGISTRY["Follower"]
