"""Measured curves: tables of points, as sympy expressions and as numbers."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np
import sympy
from numpy.typing import NDArray

from shaftwork.components.csv_columns import Columns
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, numbers_in_si

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
            x: n >= 2 strictly increasing arguments, in the unit of the argument; of a law of time a quantity will do.
            y: n values, in the unit of the law.

        Raises:
            ParameterError: a value is no finite number, x does not increase, or the lengths differ.
        """
        xs, ys = _finite_floats("x", numbers_in_si("Table: x", x, "s")), _finite_floats("y", y)
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

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        x: str | int = 0,
        y: str | int = 1,
        *,
        delimiter: str = ",",
        decimal: str = ".",
        scale: tuple[float, float] = (1.0, 1.0),
        units: tuple[str | None, str | None] = (None, None),
    ) -> Self:
        """The curve through two columns of a file, as measuring equipment writes it.

        Lines that are empty or begin with "#" are left out, and so are those before the first that has numbers in both
        columns: of these the last that has the names is the head, with units as "omega [rpm]", "omega (rpm)",
        "omega_rpm", or in a line below it. Without `units` and `scale` numbers are taken as they stand, for SI, and a
        `NetworkWarning` says where the head has another unit, such as ms. Arguments may be time stamps,
        "2026-03-01T12:00:00.5", to the microsecond: they become seconds from the first.

        Args:
            path: of the file.
            x: name in the head of the column with the arguments, or its number from 0.
            y: of the column with the values.
            delimiter: what stands between columns, such as ";" or a tabulator.
            decimal: the decimal sign, "." or ",".
            scale: by which x and y are multiplied, into the units that they are to have; (1e-3, 1) for x in ms.
            units: to which x and y are converted from the units in the head, ("s", "N*m"); by default as they stand.

        Raises:
            ParameterError: the file cannot be read, has no such column, or a line has no finite number there or one
                that does not follow the one before; with its line. Or a unit is missing or of something else.
            MissingExtraError: a unit is to be converted, and pint is not installed (extra `units`).
        """
        if delimiter == decimal or len(delimiter) != 1:
            raise ParameterError(
                f"Table.from_csv: delimiter = {delimiter!r} must be one sign, other than that of decimals, {decimal!r}."
            )
        first, second = (in_si(f"Table.from_csv: scale[{place}]", factor) for place, factor in enumerate(scale))
        points = Columns(Path(path), (x, y), delimiter, decimal, _two_units(units), (first, second)).read()
        try:
            return cls(*points)
        except ParameterError as error:
            raise ParameterError(f"'{path}': {error}") from None

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


def _two_units(units: Any) -> tuple[str | None, str | None]:
    match units:
        case [(str() | None) as x, (str() | None) as y]:
            return x, y
    raise ParameterError(f"Table.from_csv: units = {units!r} must be two units as texts or None, such as ('s', 'N*m').")


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
        raise ParameterError(
            f"Table: {name} must be a list of numbers, such as [0.0, 1.0], in the unit of the "
            f"{'argument' if name == 'x' else 'law'}: {error}."
        ) from None
    for index, value in enumerate(floats):
        if not math.isfinite(value):
            raise ParameterError(f"Table: {name}[{index}] = {value} is not finite. Remove that point.")
    return floats


TABLE_FUNCTIONS = (Interpolation, InterpolationSlope)
"""Functions whose data are the points of a table, which they name `xs`."""
