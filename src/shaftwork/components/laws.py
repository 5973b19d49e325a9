"""What a user writes in a law: time, the quantities of the source's own branch, tables, steps and ramps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy
from sympy import Basic, Expr, Max, Min, Piecewise, Symbol

from shaftwork.components import external, noise
from shaftwork.components.tables import Interpolation, Table, interpolate, interpolation_slope
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, is_quantity, without_unit

t = sympy.Symbol("t", real=True)
"""Time in s."""
omega = sympy.Symbol("omega", real=True)
"""Speed of the source's node in rad/s; of node a against node b where it has two."""
phi = sympy.Symbol("phi", real=True)
"""Angle in rad, the integral of `omega`."""
v = sympy.Symbol("v", real=True)
"""Translational speed in m/s, across the source."""
s = sympy.Symbol("s", real=True)
"""Position in m, the integral of `v`."""
u = sympy.Symbol("u", real=True)
"""Voltage in V, across the source."""
psi = sympy.Symbol("psi", real=True)
"""Flux linkage in V s, the integral of `u`."""
i = sympy.Symbol("i", real=True)
"""Current in A that a source of voltage delivers."""
q = sympy.Symbol("q", real=True)
"""Charge in A s that it has delivered, the integral of `i`."""

SYMBOLS: tuple[sympy.Symbol, ...] = (t, omega, phi, v, s, u, psi, i, q)
"""Every symbol that a law may contain."""

NUMERICAL = {
    "Interpolation": interpolate,
    "InterpolationSlope": interpolation_slope,
    **noise.NUMERICAL,
    **external.NUMERICAL,
}
"""Names and numerical functions of tables and noise, for a code printer other than `sympy.lambdify`."""


def as_expression(law: Any) -> sympy.Expr:
    """The expression of a law: a table alone is a law of time, numbers become sympy's.

    Raises:
        ParameterError: the law is no number, table or sympy expression.
    """
    if isinstance(law, Table):
        return law(t)
    try:
        expression = sympy.sympify(law, strict=True)
    except sympy.SympifyError:
        expression = None
    if isinstance(law, bool) or not isinstance(expression, sympy.Expr):
        names = ", ".join(symbol.name for symbol in SYMBOLS)
        raise ParameterError(
            f"{law!r} is no law. Give a number, a Table, or a sympy expression of {names} of this package."
        )
    return expression


def Step(height: Any, start: Any = 0.0, before: Any = 0.0) -> sympy.Expr:
    """A law that jumps at a time.

    Law: `before` for t < start, `before + height` for t >= start.

    Args:
        height: the jump, in the unit of the law.
        start: time of the jump in s, or a quantity.
        before: value before the jump, in the unit of the law.

    Raises:
        ParameterError: an argument is not finite, or the height has a unit.
    """
    rise, begin, base = _finite("Step", height=height, start=start, before=before)
    return sympy.Piecewise((base, t < begin), (base + rise, True))


def Ramp(height: Any, duration: Any, start: Any = 0.0, before: Any = 0.0) -> sympy.Expr:
    """A law that rises along a straight line.

    Law: `before` for t < start, `before + height (t - start) / duration`, `before + height` from start + duration on.

    Args:
        height: the whole rise, in the unit of the law.
        duration: time of the rise in s, greater than 0, or a quantity.
        start: time at which the rise begins in s, or a quantity.
        before: value before the rise, in the unit of the law.

    Raises:
        ParameterError: an argument is not finite, the duration is not positive, or the height has a unit.
    """
    rise, length, begin, base = _finite("Ramp", height=height, duration=duration, start=start, before=before)
    if length.is_nonpositive:
        raise ParameterError(f"Ramp: duration = {duration} must be greater than 0 s. Write a jump as a Step.")
    line = base + rise * (t - begin) / length
    return sympy.Piecewise((base, t < begin), (line, t < begin + length), (base + rise, True))


def PWM(duty: Any, frequency: Any) -> sympy.Expr:
    """A law of pulses: 1 while the duty is above a triangle of this frequency between 0 and 1, and 0 while it is below.

    Law: the triangle is acos(cos(2 pi frequency t)) / pi, zero at t = 0, so that pulses stand around whole periods
    (natural sampling). Multiply it by what is pulsed: 540 * PWM(0.3, 8e3) for a voltage.

    Args:
        duty: share of the time: a number or a law; of 0 and less there is no pulse, of 1 and more no gap.
        frequency: of the triangle, Hz, or a quantity.

    Raises:
        ParameterError: an argument is not finite, or the frequency is not positive.
    """
    free = isinstance(frequency, sympy.Expr) and frequency.free_symbols.isdisjoint(SYMBOLS)
    symbolic = free and frequency.free_symbols
    rate = sympy.sympify(frequency if symbolic else in_si("PWM: frequency", frequency, "Hz", above=0), strict=True)
    (share,) = _finite("PWM", duty=duty)
    inside = larger(0, smaller(1, share))
    if inside.is_number and float(inside) in (0, 1):
        return sympy.Integer(int(inside))
    # the second difference keeps the two apart beyond 0 and 1, where they would touch at each turn of the triangle
    above = sympy.cos(2 * sympy.pi * rate * t) - sympy.cos(sympy.pi * inside) + share - inside
    return sympy.Heaviside(above, 0)


def _finite(law: str, **arguments: Any) -> list[sympy.Expr]:
    expressions = list[sympy.Expr]()
    for name, value in arguments.items():
        try:
            expressions.append(as_expression(_plain(law, name, value)))
        except ParameterError as error:
            raise ParameterError(f"{law}: {name} = {error}") from None
        if expressions[-1].has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo, sympy.I):
            raise ParameterError(f"{law}: {name} = {value} is not finite and real. Give a number or an expression.")
    return expressions


def _plain(law: str, name: str, value: Any) -> Any:
    """An argument without its unit: times in s; of the others only the law's own unit would tell what it is."""
    if name in ("start", "duration") and is_quantity(value):
        return in_si(f"{law}: {name}", value, "s")
    return without_unit(f"{law}: {name}", value, "of the law, as N m")


def larger(*args: Any) -> Expr:
    """The largest of numbers and expressions."""
    return _limit(Max, args)


def smaller(*args: Any) -> Expr:
    """The smallest of numbers and expressions."""
    return _limit(Min, args)


def replaced(expression: Basic, replacements: Mapping[Any, Any]) -> Any:
    """The same as `expression.xreplace(replacements)`, at once where limits are in it."""
    if not expression.has(Max, Min):
        return expression.xreplace(replacements)
    results: dict[Basic, Basic] = {}

    def anew(node: Basic) -> Basic:
        if node in replacements:
            return replacements[node]
        if not node.args:
            return node
        if node not in results:
            args = [anew(one) for one in node.args]
            if all(new is old for new, old in zip(args, node.args, strict=True)):
                results[node] = node
            else:
                results[node] = _limit(node.func, args) if isinstance(node, Max | Min) else node.func(*args)
        return results[node]

    return anew(expression)


def _limit(function: type[Basic], args: Any) -> Any:
    """A limit of the arguments, which are compared where all of them are numbers.

    sympy compares the arguments of every Max and Min that it makes, by factoring their difference: 20 ms for a
    controller's limit, at each of the hundreds of times that an expression around it is made anew.
    """
    compared = all(getattr(one, "is_number", True) for one in args)
    return function(*args) if compared else function(*args, evaluate=False)


def no_less(p: Any, name: str, least: int) -> Expr:
    """The law of a parameter, and `least` where that falls below; a number is checked against its declared bound.

    Args:
        p: what `Component.branches` is given.
        name: of the parameter.
        least: the lowest value that makes sense.
    """
    law: Expr = getattr(p, name)
    if law == Symbol(name, real=True):
        return law
    if isinstance(law, Piecewise):  # the times of a ramp stay as they are given
        return Piecewise(*((_no_less(value, least), condition) for value, condition in law.args))
    return _no_less(law, least)


def _no_less(law: Expr, least: int) -> Expr:
    if isinstance(law, Interpolation) and min(law.ys) >= least:
        return law
    return larger(least, law)
