"""The unit of an expression, from the units of its symbols."""

from __future__ import annotations

from collections.abc import Mapping

from sympy import Expr, Max, Min, Piecewise, Rational

from shaftwork.components.laws import t as TIME

Powers = dict[str, Rational]


def unit_of(expression: Expr, units: Mapping[str, str]) -> str:
    """The SI unit of an expression, as "N*m/rad"; "1" of a number, of a function such as a sine, and of an angle over
    an angle.

    Args:
        expression: whose terms have one unit.
        units: of its symbols by their names.
    """
    powers = {name: power for name, power in _powers(expression, units).items() if power != 0}
    above = [_raised(name, power) for name, power in powers.items() if power > 0]
    below = [_raised(name, -power) for name, power in powers.items() if power < 0]
    if not below:
        return "*".join(above) or "1"
    return f"{'*'.join(above) or '1'}/{below[0] if len(below) == 1 else '(' + '*'.join(below) + ')'}"


def _raised(name: str, power: Rational) -> str:
    return name if power == 1 else f"{name}^{power}"


def _powers(expression: Expr, units: Mapping[str, str]) -> Powers:
    if expression == TIME:
        return {"s": Rational(1)}
    if expression.is_Symbol:
        name, rates = str(expression.name), 0
        while name.startswith("der("):
            name, rates = name[4:-1], rates + 1
        powers = _parsed(units[name])
        return {**powers, "s": powers.get("s", Rational(0)) - rates} if rates else powers
    if expression.is_Mul:
        product: Powers = {}
        for factor in expression.args:
            for name, power in _powers(factor, units).items():
                product[name] = product.get(name, Rational(0)) + power
        return product
    if expression.is_Pow and expression.exp.is_Rational:
        return {name: power * expression.exp for name, power in _powers(expression.base, units).items()}
    if expression.is_Add or isinstance(expression, Max | Min):
        terms = [term for term in expression.args if term != 0]
        return {} if any(term.is_number for term in terms) else _powers(terms[0], units)
    if isinstance(expression, Piecewise):
        return _powers(expression.args[0].expr, units)
    return {}


def _parsed(unit: str) -> Powers:
    """The powers of a unit as parameters declare it, "N*m^2/rad"."""
    powers: Powers = {}
    for sign, part in zip((1, -1), unit.split("/"), strict=False):
        for name, _, power in (factor.partition("^") for factor in part.split("*")):
            if name != "1":
                powers[name] = powers.get(name, Rational(0)) + sign * Rational(power or 1)
    return powers
