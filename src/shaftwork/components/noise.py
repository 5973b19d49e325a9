"""Seeded noise in laws: normal numbers that depend on their place and a seed alone, not on who asks, when, how often.

Number k of a seed is the same in every engine, order of calls and process, for k of any sign and size.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
import sympy

_STANDARD = NormalDist()

_ALONG, *_AROUND = sympy.symbols("u, w:4", real=True)
_WEIGHTS = (
    (1 - _ALONG) ** 3,
    4 - 6 * _ALONG**2 + 3 * _ALONG**3,
    1 + 3 * _ALONG + 3 * _ALONG**2 - 3 * _ALONG**3,
    _ALONG**3,
)
"""Of the four numbers around a place, by the way u from the second to the third: a cubic spline's, not yet scaled."""
_SQUARES = sympy.expand(sum(weight**2 for weight in _WEIGHTS))
_NEIGHBOURS = range(-1, 3)
"""Numbers of the four, counted from the whole number below the place."""


def _split_mix(start: int, number: int) -> int:
    """A number of the generator SplitMix64, of 64 bits."""
    word = (start + number * 0x9E3779B97F4A7C15) % 2**64
    word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 % 2**64
    word = (word ^ word >> 27) * 0x94D049BB133111EB % 2**64
    return word ^ word >> 31


@lru_cache(maxsize=2**16)
def normal(number: int, seed: float) -> float:
    """Number `number` of the standard normal numbers of a seed.

    Law: the quantile function of the normal distribution at a uniform number, the first 53 bits of number `number` of
    the generator SplitMix64. Source: Steele, Lea, Flood, Fast splittable pseudorandom number generators, 2014.
    """
    # adding zero makes -0.0 and 0.0 one seed
    (bits,) = struct.unpack("<Q", struct.pack("<d", seed + 0.0))
    return _STANDARD.inv_cdf(((_split_mix(_split_mix(bits, 1), number) >> 11) + 0.5) / 2**53)


def held(x: Any, seed: Any) -> Any:
    """Value of `HeldNoise`, a number or an array of numbers; NaN where x has no whole number below it."""
    if isinstance(x, int | float) and isinstance(seed, int | float):
        return normal(math.floor(x), float(seed)) if math.isfinite(x) else math.nan
    x, seed = np.broadcast_arrays(np.floor(x), np.asarray(seed, dtype=float))
    values = np.full(x.shape, math.nan)
    for one in np.unique(seed).tolist():
        finite = (seed == one) & np.isfinite(x)
        numbers, places = np.unique(x[finite], return_inverse=True)
        normals = np.array([normal(int(number), one) for number in numbers.tolist()])
        values[finite] = normals[places.reshape(-1)] if normals.size else values[finite]
    return values


def smooth(x: Any, seed: Any, order: Any = 0) -> Any:
    """Value of `SmoothNoise` or of one of its derivatives by x, a number or an array of numbers."""
    if isinstance(x, int | float):
        if not math.isfinite(x):
            return math.nan
        below: Any = math.floor(x)
    else:
        x = np.where(np.isfinite(x), x, math.nan)
        below = np.floor(x)
    around = (held(below + k, seed) for k in _NEIGHBOURS)
    return _piece(int(order))(x - below, *around)


@lru_cache(maxsize=8)
def _numerator(order: int) -> sympy.Expr:
    """Of a derivative of N / sqrt(Q) written as N_order / Q^(order + 1/2), with the sum Q of the squared weights."""
    if order == 0:
        return sum(weight * number for weight, number in zip(_WEIGHTS, _AROUND, strict=True))
    last = _numerator(order - 1)
    return last.diff(_ALONG) * _SQUARES - (order - sympy.S.Half) * last * _SQUARES.diff(_ALONG)


def _nested(polynomial: sympy.Expr) -> sympy.Expr:
    """A polynomial of the way along by Horner's rule: without powers."""
    return sympy.horner(sympy.expand(polynomial), _ALONG)


@lru_cache(maxsize=8)
def _piece(order: int) -> Callable[..., Any]:
    """A derivative between two whole numbers, from the way along and the four numbers around.

    Sums, products and square roots alone: they round alike for numbers and arrays, which powers do not.
    """
    symbols = [_ALONG, *_AROUND]
    numerator, squares = (sympy.lambdify(symbols, _nested(part)) for part in (_numerator(order), _SQUARES))

    def value(along: Any, *around: Any) -> Any:
        total = squares(along, *around)
        root = math.sqrt(total) if isinstance(total, float) else np.sqrt(total)
        quotient = numerator(along, *around) / root
        for _ in range(order):
            quotient = quotient / total
        return quotient

    return value


class HeldNoise(sympy.Function):  # type: ignore[misc]
    """Noise that is held from one whole number to the next: the standard normal number that x has reached.

    Law: number floor(x) of the standard normal numbers of a seed.

    `22.4 + 10 * sw.HeldNoise(sw.t / 0.05, 1)` changes every 0.05 s, with mean 22.4 and standard deviation 10. The
    argument may also be an angle over a pitch. Its derivative is zero.
    """

    nargs = 2
    # lambdify finds the numerical function of a sympy function under this name
    _imp_ = staticmethod(held)

    @classmethod
    def eval(cls, x: sympy.Expr, seed: sympy.Expr) -> sympy.Expr | None:
        """A number for numbers; else the noise of the whole number below x.

        Args:
            x: the argument, an expression.
            seed: any number; other seeds give independent noise.
        """
        if x.is_number and seed.is_number:
            return sympy.Float(held(float(x), float(seed)))
        # so all that makes a law switch at whole numbers is its floors
        return None if _is_whole(x) else cls(sympy.floor(x), seed)

    def _eval_is_extended_real(self) -> bool:
        return True

    def _eval_derivative(self, _symbol: sympy.Symbol) -> sympy.Expr:
        return sympy.S.Zero

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return _latex(r"\nu", self, printer, exp)


class SmoothNoise(sympy.Function):  # type: ignore[misc]
    """Band-limited noise: standard normal at every place, smooth, and forgotten after four whole numbers.

    Law: sum_k B(x - k) w_k / sqrt(sum_k B(x - k)^2), with w_k number k of the standard normal numbers of a seed and B
    the cubic spline over five whole numbers. Two derivatives are continuous. The power spectrum is that of the spline,
    sinc(f)^8 with f in cycles for each 1 of x: half at f = 0.23, and 99.9 % of the power below f = 0.6.
    """

    nargs = (2, 3)
    _imp_ = staticmethod(smooth)

    @classmethod
    def eval(cls, x: sympy.Expr, seed: sympy.Expr, order: sympy.Expr = sympy.S.Zero) -> sympy.Expr | None:
        """A number for numbers, else None: it stays as it is.

        Args:
            x: the argument, an expression.
            seed: any number; other seeds give independent noise.
            order: of a derivative by x.
        """
        return sympy.Float(smooth(float(x), float(seed), order)) if x.is_number and seed.is_number else None

    @property
    def pieces(self) -> sympy.Expr:
        """The same in numbers that are held and the way from one whole number to the next."""
        x, seed, *orders = self.args
        order = int(orders[0]) if orders else 0
        below = sympy.floor(x)
        values = {number: HeldNoise(below + k, seed) for k, number in zip(_NEIGHBOURS, _AROUND, strict=True)}
        squares = _nested(_SQUARES)
        piece = _nested(_numerator(order)) / sympy.sqrt(squares) / squares**order
        return piece.xreplace({_ALONG: x - below, **values})

    def _eval_is_extended_real(self) -> bool:
        return True

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        x, seed, *orders = self.args
        return SmoothNoise(x, seed, sum(orders, sympy.S.One)) * x.diff(symbol)

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        x, seed, *orders = self.args
        letter = r"\tilde\nu" + (rf"^{{({printer._print(orders[0])})}}" if orders else "")  # noqa: SLF001
        return _latex(letter, self.func(x, seed), printer, exp)


def _is_whole(x: sympy.Expr) -> bool:
    """Whether an expression is a whole number, its floors taken as such; sympy doubts that 1 / p has a floor."""
    return bool(x.xreplace({floor: sympy.Dummy(integer=True) for floor in x.atoms(sympy.floor)}).is_integer)


NUMERICAL = {"HeldNoise": held, "SmoothNoise": smooth}
"""Names and numerical functions of the noise, for a code printer other than `sympy.lambdify`."""


def _latex(letter: str, node: sympy.Function, printer: Any, exponent: str | None) -> str:
    # the public doprint would open a new formula inside the formula
    x, seed = (printer._print(argument) for argument in node.args)  # noqa: SLF001
    text = rf"{letter}_{{{seed}}}\left({x}\right)"
    return text if exponent is None else rf"\left({text}\right)^{{{exponent}}}"
