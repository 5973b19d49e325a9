"""What a user writes in a law: time, the quantities of the source's own branch, tables, steps and ramps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import sympy
from sympy.core.relational import Relational

from shaftwork.components import noise, roots
from shaftwork.components.branches import ACROSS, INTEGRAL, readings_in
from shaftwork.components.clips import larger, smaller
from shaftwork.components.noise import SmoothNoise
from shaftwork.components.tables import TABLE_FUNCTIONS, Table, interpolate, interpolation_slope
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

SYMBOLS: tuple[sympy.Symbol, ...] = (t, omega, phi, v, s, u, psi)
"""Every symbol that a law may contain."""

MOST_POWER = 8
"""Pulses of higher powers of time, and powers of such, are not looked for."""
EDGES = (
    *(sympy.exp, sympy.sinh, sympy.cosh, sympy.tanh, sympy.coth, sympy.sech, sympy.csch),
    *(sympy.erf, sympy.erfc, sympy.atan, sympy.Pow),
)
"""Functions that rise or fall in a small part of their argument's range; powers, where it or a fraction is in them."""
FLANK = (-24.0, -8.0, -2.0, -0.5)
"""Exponents at which steps end on the flank of a bell: e^-24 is below every tolerance, and the last is near the top."""
NUMERICAL = {"Interpolation": interpolate, "InterpolationSlope": interpolation_slope, **noise.NUMERICAL}
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
    given = frequency if free and frequency.free_symbols else in_si("PWM: frequency", frequency, "Hz", above=0)
    rate = sympy.sympify(given, strict=True)
    (share,) = _finite("PWM", duty=duty)
    inside = larger(0, smaller(1, share))
    if inside.is_number and float(inside) in (0, 1):
        return sympy.Integer(int(inside))
    # the second difference keeps the two apart beyond 0 and 1, where they would touch at each turn of the triangle
    above = sympy.cos(2 * sympy.pi * rate * t) - sympy.cos(sympy.pi * inside) + share - inside
    return sympy.Heaviside(above, 0)


def breakpoints(expression: sympy.Basic, values: Mapping[sympy.Symbol, float] | None = None) -> tuple[float, ...]:
    """Times in s at which an expression jumps or kinks because of the time alone, increasing.

    Found are comparisons, Heaviside, sign, Abs, Max, Min and tables of arguments that are linear in `t`. A switch that
    depends on a state has no time that is known beforehand and is left out, as is one that depends on a nonlinear
    function of time, or that is one of endlessly many: those are found in the span of a run (`codegen.time_switches`).
    A listed time need not be a kink (equal slopes on both sides).

    Args:
        expression: a law or any expression that contains laws.
        values: a number for each parameter in the expression.
    """
    numbers = {symbol: sympy.Float(value) for symbol, value in (values or {}).items()}
    times: set[float] = set()
    for argument, levels in switches(expression):
        found = line(argument.xreplace(numbers))
        if found is None or found[0].is_zero or found[0].free_symbols | found[1].free_symbols:
            continue
        slope, offset = float(found[0]), float(found[1])
        times.update((level - offset) / slope + 0.0 for level in levels)
    return tuple(sorted(time for time in times if math.isfinite(time)))


def switches(expression: sympy.Basic) -> Iterator[tuple[sympy.Expr, Sequence[float]]]:
    """Every argument in an expression with the levels at which it makes the expression jump or bend.

    One that is constant but for steps of `floor` passes its levels there alone, and is left out.
    """
    for node in sympy.preorder_traversal(expression):
        yield from ((argument, levels) for argument, levels in switches_of(node) if not _only_steps(argument))


def switches_of(node: sympy.Basic) -> Iterable[tuple[sympy.Expr, Sequence[float]]]:
    """Arguments of a node and the levels at which the node is not smooth in them."""
    if isinstance(node, TABLE_FUNCTIONS):
        return [(node.argument, node.xs)]
    match node:
        case Relational():
            return [(node.lhs - node.rhs, (0.0,))]
        case sympy.Heaviside() | sympy.sign() | sympy.Abs():
            return [(node.args[0], (0.0,))]
        case sympy.Max() | sympy.Min():
            return [(first - second, (0.0,)) for first, second in combinations(node.args, 2)]
        case sympy.atan2():
            return [(node.args[0], (0.0,))]
        case sympy.tan() | sympy.sec():
            return [(sympy.cos(node.args[0]), (0.0,))]
        case sympy.cot() | sympy.csc():
            return [(sympy.sin(node.args[0]), (0.0,))]
        case sympy.asin() | sympy.acos() if (corner := roots.complement(node)) is not None:
            return [(corner, (0.0,))]  # of asin(sin(x)), a triangular wave, cos(x)
        case sympy.Pow() if roots.is_root(node) and (root := roots.square_root(node.base)) is not None:
            return [(root, (0.0,))]
        case sympy.floor() | SmoothNoise():
            # a sine changes sign at every whole number, and no list of levels would have an end
            return [(sympy.sin(sympy.pi * node.args[0]), (0.0,))]
    return []


def narrow_places(expression: sympy.Basic) -> Iterator[tuple[sympy.Expr, bool]]:
    """What is zero where an expression of time may have a narrow pulse or edge, or a train of them.

    Law: a function f(g(t)) of an edge, tanh((t - 5) / 1e-3), has it where g is zero; that of a pulse,
    exp(-((t - 5) / 1e-3)^2) or 1 / (1 + ((t - 5) / 1e-3)^2), where g has its turning point, and between the edges of a
    train, tanh(300 sin(20 t)), it has one too. What a fraction of a polynomial has goes on far away from there, which
    is told with it. What switches where a wave in time passes something that moves, as a pulse width does that follows
    a current, may do so twice between two turning points of the wave and no more often.
    """
    waves = dict.fromkeys(wave for argument, _ in switches(expression) for wave in _waves(argument))
    yield from ((wave.diff(t), False) for wave in waves)
    for node in sympy.preorder_traversal(expression):
        if isinstance(node, EDGES):
            argument, fraction = _inside(node)
            if argument.has(t) and _is_simple(argument):
                slope = argument.diff(t)
                yield slope if slope.has(t) else argument, fraction and argument.is_polynomial(t)


def unsolved_places(expression: sympy.Basic, symbols: Iterable[sympy.Symbol]) -> Iterator[sympy.Expr]:
    """What in an expression may have pulses and edges that `narrow_places` cannot solve for, as sin(t)^20000.

    Args:
        expression: a law.
        symbols: what it may hold beside the time.
    """
    nodes = sympy.preorder_traversal(expression)
    for node in nodes:
        if isinstance(node, EDGES) and node.has(t) and node.free_symbols <= {t, *symbols}:
            whole = isinstance(node, sympy.Pow) and node.exp.is_Integer and 0 < node.exp <= MOST_POWER
            argument, _ = _inside(node)
            if not whole and not (argument.has(t) and _is_simple(argument)):
                nodes.skip()
                yield node


def _waves(argument: sympy.Expr) -> Iterator[sympy.Expr]:
    """The sines of lines in time in an argument that moves besides."""
    if argument.has(t) and argument.has(*SYMBOLS[1:], ACROSS, INTEGRAL, *readings_in(argument)):
        waves = sorted(argument.atoms(sympy.sin, sympy.cos), key=sympy.default_sort_key)
        yield from (wave for wave in waves if wave.has(t) and line(wave.args[0]) is not None)


def _inside(node: sympy.Basic) -> tuple[sympy.Expr, bool]:
    """The argument of a function that may have an edge, and whether it is a fraction."""
    fraction = isinstance(node, sympy.Pow) and node.exp.is_negative
    return node.exp if isinstance(node, sympy.Pow) and not fraction else node.args[0], fraction  # 2^-x is exp(-x log 2)


def _is_simple(argument: sympy.Expr) -> bool:
    """Whether an expression is a polynomial, as pulses have it, of time and of sines of lines in time."""
    waves = (wave for wave in argument.atoms(sympy.sin, sympy.cos) if wave.has(t) and line(wave.args[0]) is not None)
    sines = {wave: sympy.Dummy() for wave in waves}
    plain, moving = argument.xreplace(sines), (t, *sines.values())
    powers = [power.exp for power in plain.atoms(sympy.Pow) if power.has(*moving)]
    return all(power.is_Integer and 0 < power <= MOST_POWER for power in powers) and plain.is_polynomial(*moving)


def bells(expression: sympy.Basic, symbols: Sequence[sympy.Symbol]) -> Iterator[tuple[sympy.Expr, tuple[float, ...]]]:
    """Where steps end at bells over what moves, exp(-((omega - 5) / 1e-2)^2): at their tops and on their flanks.

    A step that begins before a bell and ends behind it sees nothing of it, but for the slope of the exponent.
    """
    for node in sorted(expression.atoms(sympy.exp), key=sympy.default_sort_key):
        slopes = [node.args[0].diff(symbol) for symbol in symbols]
        tops = [slope for slope, symbol in zip(slopes, symbols, strict=True) if slope.has(symbol)]
        yield from ((top, (0.0,)) for top in tops)
        yield from [(node.args[0], FLANK)] if tops else ()


def between_steps(expression: sympy.Expr) -> set[sympy.Symbol]:
    """The symbols on which an expression depends while none of its floors steps."""
    floors: dict[sympy.Expr, sympy.Expr] = {step: sympy.Dummy() for step in expression.atoms(sympy.floor)}
    return set(expression.xreplace(floors).free_symbols.difference(floors.values()))


def _only_steps(argument: sympy.Expr) -> bool:
    """Whether an argument is constant but for the steps of its floors."""
    if not argument.has(sympy.floor):
        return False
    moving = (*SYMBOLS, ACROSS, INTEGRAL, *readings_in(argument))
    return between_steps(argument).isdisjoint(moving)


def line(expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr] | None:
    """Slope and offset of an expression that is linear in t, else None."""
    still, moving = expression.as_independent(t, as_Add=True)  # no polynomial need expand what is still
    if (polynomial := moving.as_poly(t)) is None or polynomial.degree() > 1:
        return None
    return polynomial.coeff_monomial(t), still + polynomial.coeff_monomial(1)


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
