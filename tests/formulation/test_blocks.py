"""Coupled rates in closed form: many inertias that carry few others."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import Expr, Symbol

import shaftwork as sw
from shaftwork.formulation.explicit_rows import BlockTooLargeError, Tie, explicit_rows, solve_tied

SIZES = (2.0, 0.5, 3.0, 1.5, 0.8, 4.0)
RATIOS = (0.7, 1.3, 0.4, 2.5, 0.9)


def summed(carried: float, *, source: bool = False) -> sw.Network:
    """Six inertias, each on a motor of its own, whose speeds planetary gears add up to that of a carried one.

    Args:
        carried: its inertia, kg m^2.
        source: whether a speed is prescribed in place of the last of the six.
    """
    net = sw.Network("sum")
    for k, size in enumerate(SIZES):
        if source and k == len(SIZES) - 1:
            net.add(sw.SpeedSource("drive", omega=3.0 * sw.t), f"{k}")
        else:
            net.add(sw.TorqueSource(f"motor{k}", tau=1.0 + k), f"{k}")
            net.add(sw.Inertia(f"J{k}", J=size), f"{k}")
    for k, ratio in enumerate(RATIOS):
        here = "0" if k == 0 else f"sum{k - 1}"
        net.add(sw.PlanetaryGear(f"planets{k}", ratio=ratio), here, f"sum{k}", f"{k + 1}")
    net.add(sw.Inertia("carried", J=carried), f"sum{len(RATIOS) - 1}")
    return net


def shares() -> np.ndarray:
    """Of each speed in that of the carried inertia: (1 + ratio) carrier = sun + ratio ring."""
    found = np.eye(len(SIZES))[0]
    for k, ratio in enumerate(RATIOS):
        found = (found + ratio * np.eye(len(SIZES))[k + 1]) / (1 + ratio)
    return found


@pytest.mark.parametrize("source", [False, True])
def test_many_inertias_that_carry_one_have_rates_in_closed_form(source: bool) -> None:  # noqa: FBT001
    """(diag(J) + J_c a a^T) omega' = tau - J_c a (a_s omega_s'), solved by hand in numbers."""
    model = summed(1.7, source=source).compile()
    assert model.rows is not None
    free, a, taus = len(model.states), shares(), np.arange(1.0, 7.0)
    given = 1.7 * a[free:].sum() * 3.0
    matrix = np.diag(SIZES[:free]) + 1.7 * np.outer(a[:free], a[:free])
    wanted = np.linalg.solve(matrix, taus[:free] - given * a[:free])
    values = {Symbol(name, real=True): value for name, value in model.parameters.items()}
    rates = [float(rate.xreplace(values)) for rate in model.rows.rates]
    # a well-conditioned system of six: rounding alone
    assert rates == pytest.approx(wanted, rel=1e-13)
    assert model.rhs(0.0, np.zeros(free)) == pytest.approx(wanted, rel=1e-13)


def test_what_is_carried_by_one_alone_is_not_counted_among_the_couplings() -> None:
    """Four inertias beside each of six are no couplings, so that the one sum is still solved for by itself."""
    net = summed(1.7)
    for k in range(4):
        net.add(sw.Inertia(f"beside{k}", J=0.3), f"{k}")
    model = net.compile()
    assert model.rows is not None
    values = {Symbol(name, real=True): value for name, value in model.parameters.items()}
    whole = np.add(SIZES, [0.3, 0.3, 0.3, 0.3, 0.0, 0.0])
    wanted = np.linalg.solve(np.diag(whole) + 1.7 * np.outer(shares(), shares()), np.arange(1.0, 7.0))
    assert [float(rate.xreplace(values)) for rate in model.rows.rates] == pytest.approx(wanted, rel=1e-13)


def test_many_that_are_carried_by_many_are_left_to_the_matrices() -> None:
    ones: dict[int, Expr] = {k: Symbol(f"a{k}") for k in range(5)}
    ties = [Tie(Symbol(f"J{k}"), ones, ones, Symbol("e")) for k in range(4)]
    with pytest.raises(BlockTooLargeError):
        solve_tied(ones, ties, ones)


def test_the_formulas_of_a_large_sum_stay_short() -> None:
    """Each rate has the one reaction in it: what is written once does not grow with the square of the inertias."""
    from shaftwork.components.discontinuities import parts
    from shaftwork.formulation.form import state_form
    from shaftwork.network.graph import build_graph

    rows = explicit_rows(state_form(build_graph(summed(1.7).netlist())))
    assert len(list(parts(rows.rates))) < 40 * len(SIZES)
