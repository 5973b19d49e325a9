"""The quintic through values, rates and accelerations at both ends of a step."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

pytest.importorskip("numba")
from numba import njit

from shaftwork.numerics import hermite
from shaftwork.numerics.hermite import BEYOND

peak, powers, reach, root = (  # compiled functions alone call those of the library
    njit(function.py_func) for function in (hermite.peak, hermite.powers, hermite.reach, hermite.root)
)

COURSE = Polynomial([0.4, -1.3, 2.2, 0.8, -3.1, 1.7])
LEFT, RIGHT, LENGTH = 0.3, 1.1, 0.8


def jets(course: Polynomial = COURSE) -> tuple[tuple[float, ...], ...]:
    return tuple((course(t), course.deriv()(t), course.deriv(2)(t)) for t in (LEFT, RIGHT))


def test_the_quintic_of_a_quintic_is_itself() -> None:
    share = np.linspace(0, 1, 11)
    np.testing.assert_allclose(np.polyval(powers(LENGTH, *jets()), share), COURSE(LEFT + LENGTH * share), rtol=1e-13)


def test_it_reaches_no_higher_than_is_said() -> None:
    for course in (COURSE, -COURSE):
        inside, _ = reach(LENGTH, *jets(course))
        assert course(np.linspace(LEFT, RIGHT, 201)).max() <= max(inside, course(LEFT), course(RIGHT))


def test_the_distance_from_the_cubic_is_that_in_the_middle() -> None:
    left, right = jets()
    cubic = (left[0] + right[0]) / 2 + LENGTH * (left[1] - right[1]) / 8
    expected = BEYOND * abs(COURSE((LEFT + RIGHT) / 2) - cubic)
    assert reach(LENGTH, left, right)[1] == pytest.approx(expected, rel=1e-12)


def test_peaks_and_zeros_are_those_of_the_polynomial() -> None:
    course = Polynomial.fromroots([0.2, 0.6, 1.4, 2.0, -1.0])
    course *= np.sign(course.deriv()(0.6))
    left, right = jets(course)
    assert LEFT + LENGTH * root(powers(LENGTH, left, right), 0.0, 1.0, 1.0) == pytest.approx(0.6, abs=1e-14)
    tops = [place for place in course.deriv().roots() if LEFT < place < RIGHT and course.deriv(2)(place) < 0]
    share, height = peak(LENGTH, left, right)
    assert height == pytest.approx(course(tops).max(), rel=1e-12)
    assert course(LEFT + LENGTH * share) == pytest.approx(height, rel=1e-12)


def test_what_has_no_peak_says_so() -> None:
    assert peak(LENGTH, (0.0, 1.0, 0.0), (LENGTH, 1.0, 0.0))[1] == -np.inf
