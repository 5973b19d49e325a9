"""Zeros of one function and of many."""

from __future__ import annotations

import numpy as np
import pytest

from shaftwork.numerics.polynomials import Array
from shaftwork.numerics.zeros import Chosen, zero, zeros


def test_a_zero_is_found_to_its_last_digits() -> None:
    assert zero(lambda t: t**2 - 2.0, 0.0, 2.0) == pytest.approx(np.sqrt(2.0), rel=1e-15)
    assert zero(lambda t: t - 1e-200, -1.0, 1.0) == pytest.approx(1e-200, rel=1e-15)


def test_a_zero_is_refused_where_signs_are_alike() -> None:
    with pytest.raises(ValueError, match="sign"):
        zero(lambda t: t**2 + 1.0, -1.0, 1.0)


@pytest.mark.parametrize("rising", [True, False])
def test_many_zeros_are_found_side_by_side(*, rising: bool) -> None:
    wanted = np.array([0.1, 0.5, 0.9, 1e-9])
    sign = 1.0 if rising else -1.0

    def course(chosen: Chosen, t: Array) -> tuple[Array, Array]:
        away = t - wanted[chosen]
        return sign * (away + 5 * away**3), sign * (1 + 15 * away**2)

    found = zeros(course, np.zeros(4), np.ones(4), rising=rising, iterations=50)
    np.testing.assert_allclose(found, wanted, rtol=1e-14)


def test_a_zero_that_does_not_move_any_more_is_not_looked_at_again() -> None:
    asked = list[int]()

    def course(chosen: Chosen, t: Array) -> tuple[Array, Array]:
        asked.append(t.size)
        return np.where(np.arange(2)[chosen] == 0, t - 0.25, np.tanh(40 * (t - 0.3))), np.where(
            np.arange(2)[chosen] == 0, 1.0, 40 / np.cosh(40 * (t - 0.3)) ** 2
        )

    found = zeros(course, np.zeros(2), np.ones(2), iterations=100, xtol=1e-12)
    np.testing.assert_allclose(found, [0.25, 0.3], atol=1e-11)
    assert asked[0] == 2
    assert asked[-1] == 1
    assert len(asked) < 100
