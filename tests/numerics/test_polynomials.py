"""Nodes, tables of collocation and interpolation, against what polynomials are known to do."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss
from scipy.special import roots_jacobi

from shaftwork.numerics.polynomials import (
    Interpolant,
    chebyshev_nodes,
    lobatto_rule,
    radau_nodes,
    to_chebyshev,
    to_integrals,
    to_legendre,
    to_powers,
    to_slopes,
)

NODES = {
    "gauss": leggauss(6)[0],
    "radau": radau_nodes(6),
    "lobatto": lobatto_rule(5)[0],
    "chebyshev": chebyshev_nodes(5),
}


@pytest.mark.parametrize("nodes", NODES.values(), ids=NODES)
def test_values_at_nodes_tell_slopes_integrals_and_coefficients(nodes: np.ndarray) -> None:
    polynomial = Polynomial([0.3, -1.0, 2.0, 0.7, -0.4, 1.1])
    values, antiderivative = polynomial(nodes), polynomial.integ(lbnd=-1)
    places = np.array([-1.0, 0.2, 0.9])
    np.testing.assert_allclose(to_powers(nodes) @ values, polynomial.coef, rtol=1e-13)
    np.testing.assert_allclose(to_slopes(nodes, places) @ values, polynomial.deriv()(places), rtol=1e-13)
    np.testing.assert_allclose(to_integrals(nodes) @ values, antiderivative(nodes), atol=1e-14)
    np.testing.assert_allclose(np.polynomial.legendre.legval(places, to_legendre(nodes) @ values), polynomial(places))
    np.testing.assert_allclose(
        np.polynomial.chebyshev.chebval(places, to_chebyshev(nodes) @ values), polynomial(places)
    )


@pytest.mark.parametrize("degree", [1, 2, 7, 24])
def test_lobatto_is_exact_up_to_twice_its_degree_less_one(degree: int) -> None:
    nodes, weights = lobatto_rule(degree)
    assert (nodes[0], nodes[-1]) == (-1.0, 1.0)
    for power in range(2 * degree):
        assert weights @ nodes**power == pytest.approx((1 + (-1) ** power) / (power + 1), abs=1e-14)


@pytest.mark.parametrize("count", [1, 2, 6, 16])
def test_radau_nodes_are_those_of_jacobi(count: int) -> None:
    inner = roots_jacobi(count - 1, 1, 0)[0] if count > 1 else np.empty(0)
    np.testing.assert_allclose(radau_nodes(count), np.append(inner, 1.0), rtol=0, atol=3e-15)


def test_a_constant_has_no_slope_to_the_last_bit() -> None:
    nodes = lobatto_rule(12)[0]
    assert to_slopes(nodes, nodes).sum(axis=1) == pytest.approx(0.0, abs=1e-13)


def test_an_interpolant_is_exact_at_its_points_and_close_between() -> None:
    times = (1 + chebyshev_nodes(20)) / 2
    course = Interpolant(0.0, 1.0, np.column_stack([np.sin(times), np.exp(-times)]))
    np.testing.assert_array_equal(course(times), course.values)
    between = np.linspace(0.0, 1.0, 57)
    np.testing.assert_allclose(course(between), np.column_stack([np.sin(between), np.exp(-between)]), atol=1e-14)
