"""The quintic through values, rates and accelerations at both ends of a step."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from shaftwork.numerics.hermite import apart, inner, quintic

COURSE = Polynomial([0.4, -1.3, 2.2, 0.8, -3.1, 1.7])
LEFT, RIGHT, LENGTH = 0.3, 1.1, 0.8


def jets() -> tuple[np.ndarray, np.ndarray]:
    left, right = (np.array([COURSE(t), COURSE.deriv()(t), COURSE.deriv(2)(t)]) for t in (LEFT, RIGHT))
    return left, right


def test_the_quintic_of_a_quintic_is_itself() -> None:
    share = np.linspace(0, 1, 11)
    np.testing.assert_allclose(np.polyval(quintic(LENGTH, *jets()), share), COURSE(LEFT + LENGTH * share), rtol=1e-13)


def test_bernstein_coefficients_enclose_the_quintic() -> None:
    left, right = jets()
    bounds = [left[0], *inner(LENGTH, left, right), right[0]]
    values = COURSE(np.linspace(LEFT, RIGHT, 201))
    assert min(bounds) <= values.min()
    assert values.max() <= max(bounds)


def test_the_distance_from_the_cubic_is_that_in_the_middle() -> None:
    left, right = jets()
    cubic = (left[0] + right[0]) / 2 + LENGTH * (left[1] - right[1]) / 8
    np.testing.assert_allclose(apart(LENGTH, left, right), COURSE((LEFT + RIGHT) / 2) - cubic, rtol=1e-12)
