"""Laws as ngspice reads them: expressions of B sources, and waveforms of sources that depend on time alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any

import sympy
from sympy import Expr, Float, Piecewise, Symbol, pi
from sympy.core.relational import Relational
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from shaftwork.components.discontinuities import breakpoints, pieces_degree
from shaftwork.components.laws import smaller, t
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.components.tables import Table

LONGEST_PRODUCT = 6
"""Powers up to here are products: a power of ngspice takes its base without the sign."""
LARGEST_POWER = 600
"""Exponents in pieces of a law that are switched off: what is infinite is no number when it is multiplied by zero."""
NUMBERS, MOST_NUMBERS = 20, 20_000
"""Points of a table for each whole number of smooth noise, which is off by 1e-3 between them; and the most of them."""
SAME_NAME = ("Abs", "acos", "asin", "atan", "cos", "cosh", "exp", "sin", "sinh", "sqrt", "tan", "tanh", "floor")


class NoSpiceFormError(Exception):
    """What an expression or a part has that ngspice has not, and what to take instead."""

    def __init__(self, why: str, instead: str) -> None:
        super().__init__(why)
        self.instead = instead


class _SpicePrinter(StrPrinter):  # type: ignore[misc]
    """Expressions of sympy in the words of ngspice."""

    printmethod = "_ngspice"  # tables print themselves for other readers

    def _print_Float(self, number: Float) -> str:
        return repr(float(number))

    def _print_Rational(self, number: Any) -> str:
        return repr(float(number))

    def _print_Pow(self, power: Any, rational: bool = False) -> str:  # noqa: ARG002, FBT001, FBT002
        base, exponent = power.args
        if exponent in (sympy.Rational(1, 2), sympy.Rational(-1, 2)):
            root = f"sqrt({self._print(base)})"
            return root if exponent > 0 else f"(1/{root})"
        if exponent.is_Integer and 0 < abs(exponent) <= LONGEST_PRODUCT:
            factor = self.parenthesize(base, PRECEDENCE["Pow"])
            product = "*".join([factor] * abs(int(exponent)))
            return f"({product})" if exponent > 0 else f"(1/({product}))"
        size = f"pow({self._print(base)},{self._print(exponent)})"
        return f"(sgn({self._print(base)})*{size})" if exponent.is_Integer and exponent % 2 else size

    def _print_Piecewise(self, pieces: Any) -> str:
        text = "0"
        for value, condition in reversed(pieces.args):
            yes = self._print(value)
            text = yes if condition == sympy.true else f"({self._print(condition)} ? {yes} : {text})"
        return text if text.startswith("(") else f"({text})"

    def _print_Relational(self, relation: Any) -> str:
        return f"({self._print(relation.lhs)} {relation.rel_op} {self._print(relation.rhs)})"

    def _print_And(self, both: Any) -> str:
        return f"({' && '.join(map(self._print, both.args))})"

    def _print_Or(self, either: Any) -> str:
        return f"({' || '.join(map(self._print, either.args))})"

    def _print_Not(self, negation: Any) -> str:
        return f"({self._print(negation.args[0])} ? 0 : 1)"

    def _print_BooleanTrue(self, _: Any) -> str:
        return "1"

    def _print_BooleanFalse(self, _: Any) -> str:
        return "0"

    def _print_Max(self, most: Any) -> str:
        return self._folded("max", most.args)

    def _print_Min(self, least: Any) -> str:
        return self._folded("min", least.args)

    def _folded(self, function: str, args: Sequence[Any]) -> str:
        text: str = reduce(lambda first, other: f"{function}({first}, {other})", map(self._print, args))
        return text

    def _print_Heaviside(self, step: Any) -> str:
        argument, at_zero = map(self._print, step.args)
        if step.args[1] in (0, 1):
            return f"(({argument} {'>' if step.args[1] == 0 else '>='} 0) ? 1 : 0)"
        return f"(({argument} > 0) ? 1 : ({argument} < 0) ? 0 : {at_zero})"

    def _print_sign(self, sign: Any) -> str:
        return f"sgn({self._print(sign.args[0])})"

    def _print_log(self, logarithm: Any) -> str:
        return f"ln({self._print(logarithm.args[0])})"

    def _print_Interpolation(self, curve: Any) -> str:
        xs, ys = curve.xs, curve.ys
        points = ", ".join(f"{x!r}, {y!r}" for x, y in zip(xs, ys, strict=True))
        within = f"max({xs[0]!r}, min({xs[-1]!r}, {self._print(curve.argument)}))"  # a pwl goes on beyond its ends
        return f"pwl({within}, {points})"

    def _print_Function(self, function: Any) -> str:
        name = type(function).__name__
        if name not in SAME_NAME:
            instead = f"Write it without {name}, or as a Table."
            raise NoSpiceFormError(f"a law has the function {name}, which ngspice does not have", instead)
        arguments = ", ".join(map(self._print, function.args))
        return f"{name.lower()}({arguments})"

    _print_Abs = _print_Function
    _print_floor = _print_Function
    _print_InterpolationSlope = _print_Function


def of_time(law: Expr, t_end: float, edge: float) -> tuple[Expr, dict[float, Symbol]]:
    """A law without noise and jumps over time, and the switches in it that rise from 0 to 1 at a time in s.

    Noise becomes a table; a piece of a law is multiplied by a switch that rises within an edge, since a law that jumps
    leaves ngspice no step.

    Args:
        law: in numbers, quantities of the circuit and the time.
        t_end: up to where it is read, s.
        edge: in what time a jump rises, s.

    Raises:
        NoSpiceFormError: the noise is over an angle, or has more numbers than `MOST_NUMBERS`.
    """
    noise = sorted(law.atoms(HeldNoise, SmoothNoise), key=sympy.default_sort_key)
    law = law.xreplace({one: _table(one, t_end, edge) for one in noise})
    if law.free_symbols == {t} and waveform(law, t_end, edge) is not None:
        return law, {}
    switches: dict[float, Symbol] = {}

    def switched(relation: Any) -> Expr | None:
        difference = relation.lhs - relation.rhs
        if difference.free_symbols != {t} or not (rate := difference.diff(t)).is_number or rate == 0:
            return None
        time = float(-difference.subs(t, 0) / rate)
        if time <= 0:
            return sympy.Integer(int(bool(relation.subs(t, t_end))))
        after = switches.setdefault(time, Symbol(f"v(from_{len(switches) + 1})"))
        return after if relation.subs(t, time + t_end) == sympy.true else 1 - after

    return _without_jumps(law, switched), switches


def _without_jumps(law: Any, switched: Callable[[Any], Expr | None]) -> Any:
    """A law whose pieces are weighted by switches, where these are pieces of time."""
    if not law.args or not law.has(t):
        return law
    if isinstance(law, sympy.Heaviside):
        step = switched(sympy.Gt(law.args[0], 0, evaluate=False))
        return law if step is None else step
    if isinstance(law, Relational):
        return law
    if not isinstance(law, Piecewise):
        return law.func(*(_without_jumps(arg, switched) for arg in law.args))
    total: Any = sympy.S.Zero
    for value, condition in reversed(law.args):
        weight = _weight(condition, switched)
        piece = _without_jumps(value, switched)
        if weight is None:
            total = Piecewise((piece, condition), (total, True))
        elif weight != 1 or condition != sympy.true:
            bounded = piece.replace(sympy.exp, lambda power: sympy.exp(smaller(power, LARGEST_POWER)))
            total = weight * bounded + (1 - weight) * total
        else:
            total = piece
    return total


def _weight(condition: Any, switched: Callable[[Any], Expr | None]) -> Expr | None:
    """1 where a condition of time holds, 0 where it does not; None where it is not one of time alone."""
    if condition in (sympy.true, sympy.false):
        return sympy.Integer(int(bool(condition)))
    if isinstance(condition, Relational):
        return switched(condition)
    optional = [_weight(one, switched) for one in condition.args]
    weights = [weight for weight in optional if weight is not None]
    if len(weights) < len(optional):
        return None
    match condition:
        case sympy.And():
            return sympy.Mul(*weights)
        case sympy.Or():
            return 1 - sympy.Mul(*(1 - one for one in weights))
        case sympy.Not():
            return 1 - weights[0]
    return None


def _table(noise: Expr, t_end: float, edge: float) -> Expr:
    """Noise over time as a table."""
    argument = noise.args[0].xreplace({floor: floor.args[0] for floor in noise.args[0].atoms(sympy.floor)})
    rate, start = argument.diff(t), argument.subs(t, 0)
    if noise.free_symbols != {t} or not rate.is_number or not 0 < float(rate) * t_end < MOST_NUMBERS:
        why = f"a law has noise over an angle, or over time more than {MOST_NUMBERS} numbers of it"
        raise NoSpiceFormError(why, "Take slower noise over time, or a Table.")
    first, last = math.floor(start), math.ceil(start + rate * t_end)

    def value(place: float) -> float:
        return float(noise.func(sympy.Float(place), *noise.args[1:]))

    if isinstance(noise, SmoothNoise):
        places = [first + k / NUMBERS for k in range((last - first) * NUMBERS + 1)]
        return Table(places, [value(place) for place in places])(argument)
    points = [(float(first), value(first))]
    for k in range(first + 1, last + 1):
        points += [(k - edge * float(rate), value(k - 1)), (float(k), value(k))]
    return Table(*zip(*points, strict=True))(argument)


def printed(law: Expr) -> str:
    """An expression as ngspice reads it; symbols by their names, the time as `time`.

    Raises:
        NoSpiceFormError: ngspice has no such function.
    """
    law = law.xreplace({t: Symbol("time"), pi: pi.n(17)})
    text: str = _SpicePrinter().doprint(law)
    return text


def waveform(law: Expr, t_end: float, edge: float) -> str | None:
    """A law of time as the value of a source: a number, SIN or PWL; None where it is none of these.

    Args:
        law: in numbers and the time.
        t_end: up to where it is read, s.
        edge: in what time a jump rises, s.
    """
    if law.is_number:
        return repr(float(law))
    if law.free_symbols != {t}:
        return None
    if (wave := _sine(law) or _pulses(law, edge)) is not None:
        return wave
    if pieces_degree(law) is None or law.has(sympy.floor):
        return None
    points = [*_corners(law, t_end, edge)]
    return f"PWL({' '.join(f'{time!r} {value!r}' for time, value in points)})"


def _sine(law: Expr) -> str | None:
    """SIN(offset amplitude frequency delay damping phase) of offset + amplitude sin(2 pi f t + phase)."""
    offset, wave = law.as_independent(t, as_Add=True)
    amplitude, wave = wave.as_independent(t, as_Add=False)
    if not isinstance(wave, sympy.sin | sympy.cos):
        return None
    argument = wave.args[0].as_poly(t)
    if argument is None or argument.degree() != 1:
        return None
    rate, phase = (float(argument.coeff_monomial(power)) for power in (t, 1))
    degrees = float(sympy.deg(phase)) + (90.0 if isinstance(wave, sympy.cos) else 0.0)
    frequency = rate / (2 * float(pi))
    if frequency < 0:  # the frequency of a SIN is a size
        return _sine(offset + amplitude * sympy.sin(pi - argument.as_expr())) if isinstance(wave, sympy.sin) else None
    return f"SIN({float(offset)!r} {float(amplitude)!r} {frequency!r} 0 0 {degrees!r})"


def _pulses(law: Expr, edge: float) -> str | None:
    """PULSE(high low delay rise fall width period) of low + (high - low) Heaviside(cos(2 pi f t) - level)."""
    low, wave = law.as_independent(t, as_Add=True)
    height, wave = wave.as_independent(t, as_Add=False)
    if not isinstance(wave, sympy.Heaviside):
        return None
    level, cosine = wave.args[0].as_independent(t, as_Add=True)
    if not isinstance(cosine, sympy.cos) or not abs(level) < 1 or not (rate := cosine.args[0] / t).is_number:
        return None
    period = float(2 * pi / rate)
    on = float(sympy.acos(-level) / pi)  # share of a period
    low, high = float(low), float(low + height)
    edge = min(edge, on * period / 2, (1 - on) * period / 2)
    return f"PULSE({high!r} {low!r} {(on * period - edge) / 2!r} {edge!r} {edge!r} {(1 - on) * period!r} {period!r})"


def _corners(law: Expr, t_end: float, edge: float) -> Iterator[tuple[float, float]]:
    """Times and values between which a law goes straight; a jump is an edge that ends when it comes."""
    times = [time for time in breakpoints(law) if time > 0.0]
    end = max(t_end, 2 * times[-1] if times else 0.0)
    yield 0.0, float(law.subs(t, 0.0))
    for before, time in pairwise((0.0, *times, end)):
        inner = [before + share * (time - before) for share in (0.25, 0.75)]
        low, high = (float(law.subs(t, place)) for place in inner)
        left = high + (high - low) / 2  # on the line through both, at the end of the piece
        right = float(law.subs(t, time))
        if time < end and abs(right - left) > 1e-12 * max(abs(right), abs(left)):
            yield max(time - edge, (before + time) / 2), left
        yield time, left if time == end else right
