"""The right-hand side as loops: rows that differ by the place of their states alone are one row of a loop.

So the thousand rows of a long shaft are two stencils, and the code of any network is as long as its equations in print.
What parameters alone tell is computed before the loops. The same loops are written in several languages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from sympy import Basic, Expr, Function, Integer, Rational, Symbol
from sympy.printing.c import C99CodePrinter
from sympy.printing.str import StrPrinter

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import ArrayPrinter, FloatPrinter, RealNumbers, executed
from shaftwork.codegen.taylor.heyoka_parameters import Fixed
from shaftwork.components.laws import NUMERICAL
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.formulation.explicit_rows import Rows


@dataclass(frozen=True)
class Stencil:
    """Equal rows one after the other.

    Args:
        first: place of the first of them.
        count: how many.
        rate: of the state of row i, in the symbols `near` of states, in parameters and time.
    """

    first: int
    count: int
    rate: Expr


def near(distance: int) -> Symbol:
    """The state so many places behind that of the row."""
    return Symbol(f"x[i{distance:+d}]", real=True)


def stencils_of(rows: Rows) -> tuple[Stencil, ...]:
    """The rows of all states, equal ones together."""
    place = {symbol: k for k, symbol in enumerate(rows.states)}
    stencils: list[Stencil] = []
    for i, rate in enumerate(rows.rates):
        relative = rate.xreplace({s: near(place[s] - i) for s in rate.free_symbols if s in place})
        if stencils and stencils[-1].rate == relative:
            stencils[-1] = replace(stencils[-1], count=stencils[-1].count + 1)
        else:
            stencils.append(Stencil(i, 1, relative))
    written: list[Stencil] = []
    for stencil in stencils:
        # Fewer than four equal rows are written one by one.
        written += (
            [stencil]
            if stencil.count >= 4
            else [Stencil(stencil.first + k, 1, stencil.rate) for k in range(stencil.count)]
        )
    return tuple(written)


class CPrinter(RealNumbers, C99CodePrinter):  # type: ignore[misc]
    """C's math functions; the sign and the step are not among them."""

    settings = MappingProxyType({"order": "none", "math_macros": {}})  # M_PI is not in the standard

    power = "pow"

    def _print_NumberSymbol(self, number: Expr) -> str:
        return repr(float(number))

    def _print_Rational(self, number: Rational) -> str:
        return f"{number.p}.0/{number.q}.0"

    def _print_sign(self, expression: Expr) -> str:
        argument = self._print(expression.args[0])
        return f"((({argument}) > 0) - (({argument}) < 0))"

    def _print_Heaviside(self, expression: Expr) -> str:
        argument, at_zero = (self._print(part) for part in expression.args)
        return f"(({argument}) > 0 ? 1.0 : ({argument}) < 0 ? 0.0 : {at_zero})"

    def _print_Integer(self, number: Integer) -> str:
        return f"{int(number)}.0"  # else quotients are those of whole numbers


class _Sympy(RealNumbers, StrPrinter):  # type: ignore[misc]
    """sympy's own functions."""

    settings = MappingProxyType({"order": "none"})

    def _print_Pow(self, power: Expr, *_: Any) -> str:
        return f"({self._print(power.base)})**({self._print(power.exp)})"


@dataclass(frozen=True)
class _Language:
    """How loops are written.

    Args:
        printer: of expressions.
        head: what stands before everything; {states} and {parameters} stand for how many there are.
        constant: a line that names what parameters tell.
        single: a line for one row; by place and rate.
        loop: the lines of a stencil; by first place, place behind the last and rate.
        foot: the lines behind everything.
        state: a state, by the stencil in which it stands and its distance from the row.
        view: a line before a stencil for each state that it reads, from its first place to behind its last.
    """

    printer: type[Any]
    head: str
    constant: str
    single: str
    loop: tuple[str, ...]
    foot: tuple[str, ...]
    state: Callable[[Stencil, int], str]
    view: str = ""


def _indexed(stencil: Stencil, distance: int) -> str:
    return f"x[{stencil.first + distance}]" if stencil.count == 1 else f"x[i{f'{distance:+d}' if distance else ''}]"


def _viewed(stencil: Stencil, distance: int) -> str:
    first = stencil.first + distance
    return f"x[{first}]" if stencil.count == 1 else f"x{first}[i]"


def _sliced(stencil: Stencil, distance: int) -> str:
    first = stencil.first + distance
    return f"x[{first}]" if stencil.count == 1 else f"x[{first}:{first + stencil.count}]"


_NUMPY = """from functools import reduce

from numpy import *


def rhs(t, x, p):
    rates = empty(({states}, *x.shape[1:]))"""
_NUMBA = """from math import *

from numba import njit


@njit(error_model="numpy")
def rhs(t, x, p, rates):"""
_IN_C = """#include <math.h>

void rhs(double t, const double *restrict x, const double *restrict p, double *restrict rates)
{"""
_SYMBOLS = """from sympy import *

t = Symbol("t", real=True)
x = symbols("x:{states}", real=True, seq=True)
p = symbols("p:{parameters}", real=True, seq=True)
rates = [None] * {states}"""
_LANGUAGES = {
    "numpy": _Language(
        ArrayPrinter,
        _NUMPY,
        "    {name} = {value}",
        "    rates[{first}] = {rate}",
        ("    rates[{first}:{last}] = {rate}",),
        ("    return rates",),
        _sliced,
    ),
    "numba": _Language(
        FloatPrinter,
        _NUMBA,
        "    {name} = {value}",
        "    rates[{first}] = {rate}",
        ("    made = rates[{first}:{last}]", "    for i in range({count}):", "        made[i] = {rate}"),
        ("    return",),
        _viewed,
        # indices that cannot be negative are what LLVM makes vectors of
        "    x{first} = x[{first}:{last}]",
    ),
    "c": _Language(
        CPrinter,
        _IN_C,
        "    const double {name} = {value};",
        "    rates[{first}] = {rate};",
        ("    for (int i = {first}; i < {last}; i++)", "        rates[i] = {rate};"),
        ("}",),
        _indexed,
    ),
    "sympy": _Language(
        _Sympy,
        _SYMBOLS,
        "{name} = {value}",
        "rates[{first}] = {rate}",
        ("for i in range({first}, {last}):", "    rates[i] = {rate}"),
        (),
        _indexed,
    ),
}
LANGUAGES = tuple(_LANGUAGES)


class MachineCode:
    """A right-hand side that numba compiles when it is first called.

    Args:
        source: of a function rhs(t, x, p, rates).
        states: how many there are.
        parameters: how many there are.
    """

    def __init__(self, source: str, states: int, parameters: int) -> None:
        names: dict[str, Any] = {}
        self._shapes = (states,), (parameters,)
        self.into: Callable[[float, Array, Array, Array], None] = executed(source, "rhs", names, names)
        """Writes the rates into an array, (t, x, p, rates); code of your own that numba compiles may call it, too.

        It checks nothing, and reads and writes beyond arrays that are too short: give float arrays of the right sizes.
        """

    def __call__(self, t: float, x: Array, p: Array) -> Array:
        """The rates (n,) at a time in s of states (n,), with (parameters,) values.

        Raises:
            ParameterError: x or p is no array of floats of that size.
        """
        if (x.shape, p.shape) != self._shapes or not (x.dtype == p.dtype == np.float64):
            (states,), (parameters,) = self._shapes
            raise ParameterError(
                f"x has the shape {x.shape} of {x.dtype}, p {p.shape} of {p.dtype}: give {states} states and "
                f"{parameters} parameters of float64. model.rhs takes lists and (n, k) states, too."
            )
        rates = np.empty_like(x)
        self.into(t, x, p, rates)
        return rates


class LoopedSource:
    """The loops of a right-hand side.

    Args:
        rows: the state equations.
        title: of the network, for messages.
    """

    def __init__(self, rows: Rows, title: str) -> None:
        self._rows, self._title = rows, title

    @cached_property
    def stencils(self) -> tuple[tuple[Stencil, ...], dict[Symbol, Basic]]:
        """The stencils in terms of what parameters alone tell, and that by symbols."""
        stencils, symbols = stencils_of(self._rows), dict[Basic, Symbol]()
        free = dict.fromkeys(symbol for stencil in stencils for symbol in stencil.rate.free_symbols)
        moving = [symbol for symbol in free if symbol not in self._rows.parameters]
        fixed = Fixed(self._rows.parameters, moving, [stencil.rate for stencil in stencils])

        def taken_out(node: Any) -> Any:
            """With symbols in place of its largest parts of parameters alone."""
            if node in fixed.places:
                return symbols.setdefault(node, Symbol(f"c{len(symbols)}", real=True))
            if not node.args or not node.free_symbols:
                return node
            return node.func(*map(taken_out, fixed.arguments(node)))

        rates = tuple(replace(stencil, rate=taken_out(stencil.rate)) for stencil in stencils)
        return rates, {symbol: part for part, symbol in symbols.items()}

    def source(self, language: str) -> str:
        """The code in a language.

        Raises:
            ParameterError: it is none of them.
            CompileError: a law has no code in it.
        """
        if not isinstance(language, str) or language not in _LANGUAGES:
            raise ParameterError(f"There is no source in {language!r}. Take one of: {', '.join(map(repr, LANGUAGES))}.")
        form, (stencils, constants) = _LANGUAGES[language], self.stencils
        names: dict[Basic, str] = {TIME: "t"}
        names |= {symbol: f"p[{k}]" for k, symbol in enumerate(self._rows.parameters)}
        names |= {symbol: str(symbol.name) for symbol in constants}
        head = form.head.replace("{states}", str(len(self._rows.rates)))
        lines = [head.replace("{parameters}", str(len(self._rows.parameters)))]
        values = form.printer(names)
        lines += [
            form.constant.format(name=symbol.name, value=self._printed(values, value))
            for symbol, value in constants.items()
        ]
        for stencil in stencils:
            read = {symbol: form.state(stencil, distance) for symbol, distance in read_by(stencil.rate)}
            rate = self._printed(form.printer({**names, **read}), stencil.rate)
            written = (form.single,) if stencil.count == 1 else form.loop
            begins = (
                [stencil.first + distance for _, distance in read_by(stencil.rate)]
                if form.view and stencil.count > 1
                else []
            )
            lines += [form.view.format(first=begin, last=begin + stencil.count) for begin in begins]
            span = {"first": stencil.first, "last": stencil.first + stencil.count, "count": stencil.count}
            lines += [line.format(rate=rate, **span) for line in written]
        return "\n".join((*lines, *form.foot, ""))

    def _printed(self, printer: Any, expression: Any) -> str:
        special = sorted({str(f.func) for f in expression.atoms(Function)} & NUMERICAL.keys())
        if special:
            raise CompileError(
                f"'{self._title}' has a law with a table or noise, {', '.join(special)}, of which there is no code. "
                "Take model.rhs, or a formula in place of it."
            )
        return str(printer.doprint(expression))


def read_by(rate: Expr) -> list[tuple[Symbol, int]]:
    """The states that a rate reads, and their distances."""
    states = (symbol for symbol in rate.free_symbols if symbol.name.startswith("x[i"))
    return sorted(((symbol, int(symbol.name[3:-1])) for symbol in states), key=lambda pair: pair[1])
