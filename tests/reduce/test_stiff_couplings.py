"""Couplings that are rigid but for a number beside soft shafts: frequencies, errors and the choice stay right."""

from __future__ import annotations

from itertools import combinations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.reduce.tridiagonal_modes import TridiagonalChain, singular_values
from tests.properties.examples import share_of_examples
from tests.reduce.test_simplify import chain, groups_of

wide = st.lists(st.integers(-60, 60).map(lambda k: 10 ** (k / 10)), min_size=3, max_size=8)
stiffness = st.lists(st.integers(-30, 120).map(lambda k: 10 ** (k / 10)), min_size=8, max_size=8)


def rates(inertias: list[float], stiffnesses: list[float], supports: list[float] | None = None) -> list[mpmath.mpf]:
    """Rates in rad/s without that of the turning whole, in 60 digits."""
    with mpmath.workdps(60):
        count = len(inertias)
        matrix = mpmath.matrix(count)
        for k, c in enumerate(stiffnesses):
            for a, b, sign in ((k, k, 1), (k + 1, k + 1, 1), (k, k + 1, -1), (k + 1, k, -1)):
                matrix[a, b] += sign * mpmath.mpf(c)
        for k, c in enumerate(supports or []):
            matrix[k, k] += mpmath.mpf(c)
        roots = [mpmath.sqrt(mpmath.mpf(size)) for size in inertias]
        scaled = mpmath.matrix(count)
        for a in range(count):
            for b in range(count):
                scaled[a, b] = matrix[a, b] / roots[a] / roots[b]
        found = sorted(abs(square) for square in mpmath.eigsy(scaled, eigvals_only=True))
        return [mpmath.sqrt(square) for square in found[0 if any(supports or []) else 1 :]]


@share_of_examples(0.3)
@given(wide, stiffness, st.integers(0, 99), st.sampled_from([0.0, 1e-3, 1.0, 1e6, 1e12]))
def test_every_rate_of_a_chain_has_all_digits(
    inertias: list[float], stiffnesses: list[float], place: int, bearing: float
) -> None:
    """Inertias over twelve decades, stiffness over fifteen. Each of 20 roundings on the way is 1.1e-16."""
    count = len(inertias)
    springs, supports = stiffnesses[: count - 1], [bearing * (k == place % count) for k in range(count)]
    row = TridiagonalChain(np.array(inertias), np.array(springs), np.array(supports))
    true = rates(inertias, springs, supports)
    assert row.rates() == pytest.approx([float(rate) for rate in true], rel=4e-15)
    assert row.rates(1) == pytest.approx([float(true[0])], rel=4e-15)
    matrix = np.diff(np.eye(count), axis=0) * np.sqrt(springs)[:, None]
    matrix = np.vstack([matrix, np.diag(np.sqrt(supports))]) / np.sqrt(inertias)
    assert singular_values(matrix)[-len(true) :] == pytest.approx([float(rate) for rate in true], rel=1e-10)


@share_of_examples(0.1)
@given(wide, stiffness)
def test_the_lowest_shape_and_its_torques_fulfil_the_equations(inertias: list[float], stiffnesses: list[float]) -> None:
    """The torque of each spring is what moves all before it; from speeds it would be a difference of equal ones."""
    row = TridiagonalChain(np.array(inertias), np.array(stiffnesses[: len(inertias) - 1]), np.zeros(len(inertias)))
    (rate,) = row.rates(1)
    shape, torques = row.swing(rate)
    moved = np.cumsum(rate**2 * row.inertias * shape)[:-1]
    size = rate**2 * np.cumsum(row.inertias * np.abs(shape))[:-1]
    assert np.abs(torques + moved).max() <= 1e-9 * size.max() or np.abs(torques - moved).max() <= 1e-9 * size.max()
    assert np.sum(row.inertias * shape**2) == pytest.approx(1.0, rel=1e-12)


@share_of_examples(0.05)
@given(wide, stiffness, st.integers(0, 99), st.integers(2, 4))
def test_no_contiguous_grouping_is_better_beside_stiff_couplings_either(
    inertias: list[float], stiffnesses: list[float], pick: int, masses: int
) -> None:
    """By the frequencies of 60 digits; errors below 1e-13 are those of two roundings."""
    springs = stiffnesses[: len(inertias) - 1]
    kept, masses = pick % len(springs), min(masses, len(inertias))
    small = sw.reduce.simplify(chain(inertias, springs), masses, f"c{kept}")
    true = rates(inertias, springs)[0]
    tried = [cuts for cuts in combinations(range(len(springs)), masses - 1) if kept in cuts]
    errors = [float(abs(rates(*groups_of(inertias, springs, cuts, kept))[0] / true - 1)) for cuts in tried]
    taken = small.frequencies[0]
    assert taken.before == pytest.approx(float(true / (2 * mpmath.pi)), rel=4e-15)
    assert abs(taken.error or 0.0) <= min(errors) * (1 + 1e-9) + 2e-13
    assert taken.error == pytest.approx(small.groupings[0].frequency_error, abs=1e-14) or taken.error < 0


def test_a_coupling_that_is_rigid_but_for_a_number_is_not_where_groups_are_cut() -> None:
    net = chain([0.02, 0.01, 0.05, 3.0, 20.0, 60.0], [1e12, 800.0, 500.0, 900.0, 24.0])
    small = sw.reduce.simplify(net, 4, "c4")
    assert small.groupings[0].groups[0] == ("0", "1", "2")
    assert small.frequencies[0].error == pytest.approx(2.556e-8, rel=1e-3)


def test_a_light_mass_behind_a_stiff_coupling_leaves_the_lowest_frequency_right() -> None:
    """By K itself it would be 0.225 Hz."""
    small = sw.reduce.simplify(chain([1.0, 1e-8, 1e4], [1e8, 0.1]), 2, "c1")
    assert small.frequencies[0].before == pytest.approx(0.05033172822538455, rel=1e-14)
    assert small.frequencies[0].error == pytest.approx(5e-10, rel=1e-4)
    assert small.valid_up_to > 1e6


@pytest.mark.slow
@share_of_examples(0.08)
@given(wide, stiffness, st.integers(0, 99), st.sampled_from([0.0, 1e-3, 1e12]))
def test_all_modes_together_have_the_frequencies_of_the_train_beside_stiff_couplings(
    inertias: list[float], stiffnesses: list[float], pick: int, bearing: float
) -> None:
    """And fewer of them none below; rotations by Jacobi, and what is projected is a sum of positive terms."""
    springs = stiffnesses[: len(inertias) - 1]
    net = chain(inertias, springs)
    if bearing:
        net.add(sw.Spring("bearing", c=bearing), f"{pick % len(inertias)}", "ground")
    for masses in range(2, len(inertias) + 1):
        small = sw.reduce.simplify(net, masses, f"c{pick % len(springs)}")
        pairs = [(row.before, row.by_modes) for row in small.frequencies if row.by_modes is not None]
        assert all(bound >= true * (1 - 1e-10) for true, bound in pairs)
    assert [bound for _, bound in pairs] == pytest.approx([true for true, _ in pairs], rel=1e-10)
