"""What a user writes in a law: time, the quantities of the source's own branch, tables, steps and ramps."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from typing import Any, Self

import numpy as np
import sympy
from numpy.typing import NDArray
from sympy.core.relational import Relational

from shaftwork.components import noise
from shaftwork.components.branches import ACROSS, INTEGRAL, readings_in
from shaftwork.components.noise import SmoothNoise
from shaftwork.core.errors import ParameterError

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

Samples = tuple[tuple[float, ...], tuple[float, ...]]


class Table(sympy.Atom):  # type: ignore[misc]
    """A measured curve: straight lines between its points, constant beyond its ends.

    Law: y = y_k + (y_{k+1} - y_k) (x - x_k) / (x_{k+1} - x_k) for x_k <= x <= x_{k+1}.

    `Table(x, y)` alone, where a law is expected, is a law of time; `Table(x, y)(argument)` is a sympy expression of
    any argument, such as a motor's torque over its speed.
    """

    is_commutative = True

    def __new__(cls, x: Sequence[float] | NDArray[Any], y: Sequence[float] | NDArray[Any]) -> Self:
        """The curve through the points.

        Args:
            x: n >= 2 strictly increasing arguments, in the unit of the argument.
            y: n values, in the unit of the law.

        Raises:
            ParameterError: a value is no finite number, x does not increase, or the lengths differ.
        """
        xs, ys = _finite_floats("x", x), _finite_floats("y", y)
        if len(xs) != len(ys) or len(xs) < 2:
            raise ParameterError(
                f"Table: x has {len(xs)} values and y has {len(ys)}. Give both the same number, 2 or more."
            )
        for index, (left, right) in enumerate(pairwise(xs)):
            if left >= right:
                raise ParameterError(
                    f"Table: x must increase strictly, but x[{index + 1}] = {right!r} follows x[{index}] = {left!r}. "
                    "Sort the points; write a jump as a Step."
                )
            if not math.isfinite((ys[index + 1] - ys[index]) / (right - left)):
                raise ParameterError(
                    f"Table: between x[{index}] = {left!r} and x[{index + 1}] = {right!r} the slope is not finite. "
                    "Write a jump as a Step."
                )
        table: Self = super().__new__(cls)
        table.xs, table.ys = xs, ys
        return table

    xs: tuple[float, ...]
    ys: tuple[float, ...]

    def __call__(self, argument: Any) -> sympy.Expr:
        return Interpolation(argument, self)

    def __getnewargs__(self) -> Samples:
        return self.xs, self.ys

    def _hashable_content(self) -> Samples:
        return self.xs, self.ys

    def _sympystr(self, _printer: Any) -> str:
        return f"Table({list(self.xs)}, {list(self.ys)})"

    _sympyrepr = _sympystr

    def _pythoncode(self, _printer: Any) -> str:
        return f"({self.xs!r}, {self.ys!r})"

    _numpycode = _lambdacode = _pythoncode

    def _latex(self, printer: Any) -> str:
        points = [
            rf"{_printed(sympy.Float(x), printer)} \mapsto {_printed(sympy.Float(y), printer)}"
            for x, y in zip(self.xs, self.ys, strict=True)
        ]
        return r",\, ".join(points if len(points) <= 4 else [points[0], points[1], r"\ldots", points[-1]])


def interpolate(x: Any, samples: Samples) -> Any:
    """Value of a table at x, a number or an array of numbers; NaN where x is NaN."""
    xs, ys = samples
    if not isinstance(x, float):
        return np.interp(x, xs, ys)
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    if math.isnan(x):
        return x
    index = bisect_right(xs, x)
    x0, y0 = xs[index - 1], ys[index - 1]
    return (ys[index] - y0) / (xs[index] - x0) * (x - x0) + y0


def interpolation_slope(x: Any, samples: Samples) -> Any:
    """Slope of a table at x, a number or an array of numbers; to the right of a point, zero beyond the ends."""
    xs, ys = samples
    if isinstance(x, float):
        index = bisect_right(xs, x)
        inside = 0 < index < len(xs)
        return (ys[index] - ys[index - 1]) / (xs[index] - xs[index - 1]) if inside else 0.0
    slopes = np.concatenate(([0.0], np.diff(ys) / np.diff(xs), [0.0]))
    return slopes[np.searchsorted(xs, x, side="right")]


class _TableFunction(sympy.Function):  # type: ignore[misc]
    """A function of one argument whose data are the points of a table."""

    @property
    def argument(self) -> sympy.Expr:
        return self.args[0]

    @property
    def table(self) -> Table:
        return self.args[1]  # type: ignore[no-any-return]

    @property
    def xs(self) -> tuple[float, ...]:
        return self.table.xs

    @property
    def ys(self) -> tuple[float, ...]:
        return self.table.ys

    @classmethod
    def eval(cls, argument: sympy.Expr, table: Table) -> sympy.Expr | None:
        if not argument.is_number:
            return None
        try:
            return sympy.Float(cls._imp_(float(argument), (table.xs, table.ys)))
        except TypeError:  # a complex number, which sympy tries on its own
            return None

    def _eval_is_real(self) -> bool | None:
        return self.argument.is_extended_real  # type: ignore[no-any-return]

    def _eval_evalf(self, _precision: int) -> sympy.Expr:
        return self.func(self.argument.evalf(), self.table)


class Interpolation(_TableFunction):
    """`Table(x, y)(argument)` as a sympy expression; the points are `.xs` and `.ys`."""

    # lambdify finds the numerical function of a sympy function under this name
    _imp_ = staticmethod(interpolate)

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        return InterpolationSlope(self.argument, self.table) * self.argument.diff(symbol)

    def _sympystr(self, printer: Any) -> str:
        return f"{self.table}({_printed(self.argument, printer)})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return _latex_call("table", self, printer, exp)


class InterpolationSlope(_TableFunction):
    """Derivative of an `Interpolation` by its argument: constant between the points."""

    _imp_ = staticmethod(interpolation_slope)

    def _eval_derivative(self, _symbol: sympy.Symbol) -> sympy.Expr:
        return sympy.S.Zero

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return _latex_call("slope", self, printer, exp)


EDGES = (
    *(sympy.exp, sympy.sinh, sympy.cosh, sympy.tanh, sympy.coth, sympy.sech, sympy.csch),
    *(sympy.erf, sympy.erfc, sympy.atan, sympy.Pow),
)
"""Functions that rise or fall in a small part of their argument's range, powers where they are negative."""
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
        start: time of the jump in s.
        before: value before the jump, in the unit of the law.

    Raises:
        ParameterError: an argument is not finite.
    """
    rise, begin, base = _finite("Step", height=height, start=start, before=before)
    return sympy.Piecewise((base, t < begin), (base + rise, True))


def Ramp(height: Any, duration: Any, start: Any = 0.0, before: Any = 0.0) -> sympy.Expr:
    """A law that rises along a straight line.

    Law: `before` for t < start, `before + height (t - start) / duration`, `before + height` from start + duration on.

    Args:
        height: the whole rise, in the unit of the law.
        duration: time of the rise in s, greater than 0.
        start: time at which the rise begins in s.
        before: value before the rise, in the unit of the law.

    Raises:
        ParameterError: an argument is not finite, or the duration is not positive.
    """
    rise, length, begin, base = _finite("Ramp", height=height, duration=duration, start=start, before=before)
    if length.is_nonpositive:
        raise ParameterError(f"Ramp: duration = {duration} must be greater than 0 s. Write a jump as a Step.")
    line = base + rise * (t - begin) / length
    return sympy.Piecewise((base, t < begin), (line, t < begin + length), (base + rise, True))


def breakpoints(expression: sympy.Basic, values: Mapping[sympy.Symbol, float] | None = None) -> tuple[float, ...]:
    """Times in s at which an expression jumps or kinks because of the time alone, increasing.

    Found are comparisons, Heaviside, sign, Abs, Max, Min and tables of arguments that are linear in `t`. A switch that
    depends on a state has no time that is known beforehand and is left out, as is one that depends on a nonlinear
    function of time, or that is one of endlessly many: those are found in the span of a run (`codegen.switching`). A
    listed time need not be a kink (equal slopes on both sides).

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
        case _TableFunction():
            return [(node.argument, node.xs)]
        case sympy.floor() | SmoothNoise():
            # a sine changes sign at every whole number, and no list of levels would have an end
            return [(sympy.sin(sympy.pi * node.args[0]), (0.0,))]
    return []


def narrow_places(expression: sympy.Basic) -> Iterator[tuple[sympy.Expr, bool]]:
    """Polynomials of time that are zero where an expression of it may have a narrow pulse or edge.

    Law: a function f(g(t)) of an edge, tanh((t - 5) / 1e-3), has it where g is zero; that of a pulse,
    exp(-((t - 5) / 1e-3)^2) or 1 / (1 + ((t - 5) / 1e-3)^2), where g has its turning point. What a fraction has goes
    on far away from there, which is told with it.
    """
    for node in sympy.preorder_traversal(expression):
        if not isinstance(node, EDGES) or (isinstance(node, sympy.Pow) and not node.exp.is_negative):
            continue
        argument = node.args[0]
        if argument.has(t) and (polynomial := argument.as_poly(t)) is not None:
            yield argument if polynomial.degree() == 1 else argument.diff(t), isinstance(node, sympy.Pow)


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


def _latex_call(name: str, node: _TableFunction, printer: Any, exponent: str | None) -> str:
    power = "" if exponent is None else f"^{{{exponent}}}"
    argument, table = _printed(node.argument, printer), _printed(node.table, printer)
    return rf"\operatorname{{{name}}}{power}\left({argument};\, {table}\right)"


def _printed(expression: sympy.Basic, printer: Any) -> str:
    # the public doprint would open a new formula inside the formula
    return str(printer._print(expression))  # noqa: SLF001


def _finite_floats(name: str, values: Iterable[Any]) -> tuple[float, ...]:
    try:
        # adding zero turns -0.0 into 0.0, so that equal tables print alike
        floats = tuple(float(value) + 0.0 for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise ParameterError(f"Table: {name} must be a list of numbers, such as [0.0, 1.0]: {error}.") from None
    for index, value in enumerate(floats):
        if not math.isfinite(value):
            raise ParameterError(f"Table: {name}[{index}] = {value} is not finite. Remove that point.")
    return floats


def _finite(law: str, **arguments: Any) -> list[sympy.Expr]:
    expressions = [sympy.sympify(value, strict=True) for value in arguments.values()]
    for name, expression in zip(arguments, expressions, strict=True):
        if expression.has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo):
            raise ParameterError(f"{law}: {name} = {expression} is not finite. Give a number or an expression.")
    return expressions
