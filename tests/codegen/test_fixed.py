"""What does not move in equations is a parameter of its own, worked out once."""

import numpy as np
import pytest
import sympy
from sympy import Heaviside, Max, Piecewise, cos, exp, floor, sin, sqrt

from shaftwork.codegen.taylor.heyoka_parameters import Fixed

x, t, a, b, mode = sympy.symbols("x t a b mode", real=True)
PARAMETERS = (a, b, mode)


def parts(*expressions):
    return Fixed(PARAMETERS, (x, t, mode), expressions)


@pytest.mark.parametrize(
    ("expression", "found"),
    [
        (2 * a * x / b, {2 * a / b}),
        (a + b + x, {a + b}),
        (sin(a) * x + cos(x) * b, {sin(a)}),
        (a * x, set()),
        (3 * sympy.pi * x, set()),
        (a * mode * x, set()),
        (a * b * mode * x, {a * b}),
        (Max(a, b) * x, {Max(a, b)}),
        (Piecewise((a * x, x > a + b), (a / b, True)), {a + b, a / b}),
        (floor(t / a) * x, {1 / a}),
        (floor(a) * x, set()),
    ],
)
def test_each_part_of_parameters_alone_is_found(expression, found):
    assert set(parts(expression).places) == found


def test_values_are_those_of_the_expressions_for_one_set_of_parameters_and_for_many():
    made = parts(sqrt(a) * x, x * exp(-b) + a / b, Heaviside(a - b) * x)
    p = np.array([[2.0, 3.0], [0.5, 7.0], [1.0, -1.0]])
    many = made.values(p)
    for k in range(2):
        numbers = dict(zip(PARAMETERS, p[:, k].tolist(), strict=True))
        expected = [float(part.xreplace(numbers)) for part in made.places]
        assert made.values(p[:, k]) == pytest.approx(expected, rel=1e-15)  # the same functions, a rounding apart
        assert many[:, k] == pytest.approx(expected, rel=1e-15)


def test_what_has_no_value_is_no_error_before_it_is_needed():
    """A law may hold 1 / a in a branch that is not taken; warnings are errors here."""
    made = parts(Piecewise((x / a, x > 0), (x, True)), sqrt(b) * x)
    values = dict(zip(made.places, made.values(np.array([0.0, -1.0, 0.0])), strict=True))
    assert values[1 / a] == np.inf
    assert np.isnan(values[sqrt(b)])


def test_parts_that_were_known_before_keep_their_places():
    before = parts(a * b * x)
    more = Fixed(PARAMETERS, (x, t), (a / b * x, a * b * x), before=before.places)
    assert list(more.places) == [a * b, a / b]


def test_no_part_at_all():
    assert parts(x, t).values(np.array([1.0, 2.0, 3.0])).shape == (0,)
