"""Slopes of laws between their jumps."""

from __future__ import annotations

import pytest
import sympy
from sympy import Abs, Derivative, DiracDelta, Heaviside, Max, Piecewise, sign, sqrt

from shaftwork.components.law_slopes import jumps, slope, wraps
from shaftwork.components.laws import omega, phi, t
from shaftwork.components.tables import Table


@pytest.mark.parametrize(
    "law",
    [
        sign(omega) * omega**2,
        Heaviside(omega - 1) * omega,
        Abs(omega) * omega,
        Abs(omega**2 - sign(omega) * Abs(omega - 1)),
        Abs(sqrt(omega + 9)) * sign(omega),
        Max(omega, 0) * sign(omega + 1),
        Piecewise((omega, Abs(omega) < 1), (omega**3 * sign(omega), True)),
        Table([0, 1, 3], [0, 5, -1])(Abs(omega)),
        sympy.exp(-Abs(omega)),
        sympy.asin(sympy.sin(3 * omega)),
        sympy.acos(1 - 2 * sympy.sin(2 * omega) ** 2),
        sympy.acos(sympy.cos(omega**2)) * omega,
        sqrt(omega**2 - 2 * omega + 1) ** 3,
        sqrt(0.09 * omega**2 - 0.06 * omega + 0.01),
        sqrt(2 - 2 * sympy.cos(omega) * sympy.cos(2 * omega) - 2 * sympy.sin(omega) * sympy.sin(2 * omega)),
        (omega - 2) * sqrt(Abs(omega - 2)),
    ],
    ids=str,
)
def test_the_slope_is_the_limit_of_the_difference_quotient(law: sympy.Expr) -> None:
    found = slope(law, omega)
    assert not found.has(DiracDelta, Derivative)
    for speed in (-2.3, -0.4, 0.3, 2.2):
        above, below = (float(law.subs(omega, speed + side)) for side in (1e-6, -1e-6))
        # central differences: 1e-12 of the third derivative and 1e-16 / 1e-6 of rounding
        assert float(found.subs(omega, speed)) == pytest.approx((above - below) / 2e-6, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize(
    ("law", "corner", "after"),
    [
        (sympy.asin(sympy.sin(omega)), sympy.pi / 2, -1.0),
        (sympy.acos(sympy.cos(4 * omega)), 0, 4.0),
        (sympy.asin(sympy.cos(4 * omega)), 0, -4.0),
        (sympy.acos(1 - 2 * sympy.sin(2 * omega) ** 2), 0, 4.0),
        (sqrt(omega**2 - 2 * omega + 1), 1, 1.0),
        (sqrt(2 - 2 * sympy.cos(4 * omega)), 0, 4.0),
        (omega * sqrt(Abs(omega)), 0, 0.0),
        ((3 - omega) * Abs(omega - 3) ** 0.3, 3, 0.0),
    ],
    ids=str,
)
def test_the_slope_is_exact_on_both_sides_of_a_corner(law: sympy.Expr, corner: sympy.Expr, after: float) -> None:
    found = sympy.lambdify(omega, slope(law, omega), "math")
    place = float(corner)
    assert found(place + 1e-12) == pytest.approx(after, abs=1e-3)
    assert found(place - 1e-12) == pytest.approx(-after, abs=1e-3)
    assert abs(found(place)) <= abs(after) + 1e-3


def test_a_step_of_time_has_no_slope() -> None:
    assert slope(sign(t - 0.5) + Heaviside(t), t) == 0


def test_what_jumps_is_told_from_what_does_not() -> None:
    assert jumps(Piecewise((1, omega < 0.5), (2, True)), omega)
    assert jumps(Heaviside(phi), omega, phi)
    assert not jumps(Heaviside(t) * omega, omega, phi)
    assert not jumps(omega**2, omega)


@pytest.mark.slow
def test_the_inverse_function_of_what_is_clipped_on_both_sides_begins_no_new_turn() -> None:
    """A trapezoid over an angle is made so: its corners are those of the clipping, which laws are looked at for."""
    x = sympy.Symbol("x", real=True)
    half = sympy.Rational(1, 2)
    clipped = sympy.asin(sympy.Max(-half, sympy.Min(half, sympy.sin(x))))
    assert not wraps(clipped)
    assert wraps(sympy.asin(sympy.sin(x)))
    assert wraps(sympy.asin(sympy.Max(-half, sympy.sin(x))))
    found = sympy.lambdify(x, slope(clipped, x), "math")
    assert found(0.3) == 1.0
    assert found(1.5) == 0.0
