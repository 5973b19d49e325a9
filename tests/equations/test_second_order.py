"""M q'' + D q' + K q = T of mechanical networks."""

from __future__ import annotations

import pytest
from sympy import cancel

from shaftwork.core.errors import CompileError
from shaftwork.equations.second_order import second_order
from tests.equations.networks import MECHANICAL, dc_drive, graph_of
from tests.equations.test_lagrange import quantity


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


def test_an_electrical_network_has_no_second_order_form() -> None:
    with pytest.raises(CompileError, match=r"electrical nodes p, M\.resistor"):
        second_order(graph_of(dc_drive()))
