"""Energy and network theory lead to the same equations of motion."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import HealthCheck, given, settings
from sympy import Rational, Symbol, cancel, expand, powsimp

from shaftwork.core.errors import CompileError
from shaftwork.equations.lagrange import Lagrangian, lagrangian
from shaftwork.equations.second_order import SecondOrder, second_order
from shaftwork.reduction.tree import normal_tree
from tests.equations.networks import MECHANICAL, dc_drive, from_pieces, graph_of
from tests.strategies import Network, networks


def assert_equal(network: SecondOrder, energies: Lagrangian, values: Mapping[Symbol, Rational] | None = None) -> None:
    assert network.coordinates == energies.coordinates
    for row, equation in enumerate(energies.equations):
        difference = (network.residual(row) - equation).subs(dict(values or {}))
        assert powsimp(expand(difference)) == 0 or cancel(difference) == 0, network.coordinates[row]


@pytest.mark.parametrize("name", MECHANICAL)
def test_lagranges_equations_are_the_second_order_form(name: str) -> None:
    graph = graph_of(MECHANICAL[name]())
    assert_equal(second_order(graph), lagrangian(graph))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(pieces=networks(max_inertias=6, electrical=False))
def test_lagranges_equations_are_the_second_order_form_of_random_networks(pieces: Network) -> None:
    """Symbol by symbol, but for ratios whose values the structure rests on: 2 and 1/2 in a row twist no spring."""
    graph = graph_of(from_pieces(pieces))
    meeting = {Symbol(name, real=True): Rational(str(graph.parameters[name])) for name in normal_tree(graph).frozen}
    assert_equal(second_order(graph), lagrangian(graph), meeting)


def test_a_wrong_equation_is_told_from_a_right_one() -> None:
    graph = graph_of(MECHANICAL["crane"]())
    other = graph_of(MECHANICAL["inertias in parallel"]())
    assert lagrangian(graph).equations[0] != lagrangian(other).equations[0]
    stiff = second_order(graph).residual(0).subs(Symbol("shaft.c", real=True), 2)
    assert expand(stiff - lagrangian(graph).equations[0]) != 0


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
    first, second, ratio = (Symbol(name, real=True) for name in ("J1.J", "J2.J", "g.ratio"))
    assert form.mass == {(0, 0): first + second / ratio**2}


def test_an_electrical_network_has_no_second_order_form() -> None:
    graph = graph_of(dc_drive())
    with pytest.raises(CompileError, match=r"electrical nodes p, M\.resistor"):
        second_order(graph)
    with pytest.raises(CompileError, match="electrical nodes"):
        lagrangian(graph)


def test_the_lagrangian_of_the_crane_is_its_kinetic_less_its_potential_energy() -> None:
    energies = lagrangian(graph_of(MECHANICAL["crane"]()))
    J1, J2, c = (Symbol(name, real=True) for name in ("J1.J", "J2.J", "shaft.c"))
    phi1, phi2 = energies.coordinates
    w1, w2 = (Symbol(f"der({phi.name})", real=True) for phi in (phi1, phi2))
    expected = (J1 * w1**2 + J2 * w2**2 - c * (phi1 - phi2) ** 2) / 2
    assert expand(energies.lagrangian - expected) == 0
