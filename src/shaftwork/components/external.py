"""Laws that another program evaluates: functions of numbers whose formulas nobody here knows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, Self

import numpy as np
import sympy

from shaftwork.core.errors import CompileError

RELATIVE_STEP = 6e-6
"""Of a central difference, the cube root of the rounding of floats: its error is then least, some 4e-11."""


class Program(Protocol):
    """What evaluates laws outside: a pure function of its arguments, however often and in which order it is asked."""

    key: str
    """The same for the same program, and for no other."""

    def value(self, row: int, arguments: tuple[float, ...]) -> float:
        """The value of one of its laws.

        Args:
            row: number of the law.
            arguments: numbers in SI.
        """
        ...


_PROGRAMS: dict[str, Program] = {}
"""Programs by their keys: compiled code is text and holds the key alone."""


class Handle(sympy.Atom):  # type: ignore[misc]
    """A program among the arguments of an expression."""

    is_commutative = True

    def __new__(cls, program: Program) -> Self:
        """The handle of a program; that of the same key goes on where there is one.

        Args:
            program: evaluates the laws.
        """
        handle: Self = super().__new__(cls)
        handle.program = _PROGRAMS.setdefault(program.key, program)
        return handle

    program: Program

    def __getnewargs__(self) -> tuple[Program]:
        return (self.program,)

    def _hashable_content(self) -> tuple[str]:
        return (self.program.key,)

    def _sympystr(self, _printer: Any) -> str:
        return repr(self.program.key)

    _sympyrepr = _pythoncode = _numpycode = _sympystr


def evaluated(key: str, row: Any, column: Any, *arguments: Any) -> Any:
    """Value of `External`, for numbers or arrays of numbers.

    Args:
        key: of the program.
        row: number of its law.
        column: of the argument by which the slope is asked; -1 for the value.
        *arguments: of the law.
    """
    law, place = int(row), int(column)
    if all(isinstance(argument, int | float) for argument in arguments):
        return _number(_PROGRAMS[key], law, place, [float(argument) for argument in arguments])
    broadcast = np.broadcast_arrays(*(np.asarray(argument, dtype=float) for argument in arguments))
    points = zip(*(values.ravel().tolist() for values in broadcast), strict=True)
    numbers = [_number(_PROGRAMS[key], law, place, list(point)) for point in points]
    return np.array(numbers).reshape(broadcast[0].shape)


def _number(program: Program, row: int, column: int, point: Sequence[float]) -> float:
    if column < 0:
        return program.value(row, tuple(point))
    step = RELATIVE_STEP * max(1.0, abs(point[column]))
    before, after = ([*point[:column], point[column] + side * step, *point[column + 1 :]] for side in (-1, 1))
    difference = program.value(row, tuple(after)) - program.value(row, tuple(before))
    return difference / (after[column] - before[column])


class External(sympy.Function):  # type: ignore[misc]
    """A law of a program: (handle, number of the law, -1 or the argument of a slope, arguments).

    Slopes are central differences, good to about ten digits.
    """

    # lambdify finds the numerical function of a sympy function under this name
    _imp_ = staticmethod(evaluated)

    @classmethod
    def eval(cls, *_arguments: sympy.Expr) -> None:
        """It stays as it is, also for numbers: a program is asked during a run alone."""

    def _eval_is_extended_real(self) -> bool:
        return True

    def _eval_evalf(self, _precision: int) -> sympy.Expr:
        handle, row, column, *arguments = self.args
        return External(handle, row, column, *(argument.evalf() for argument in arguments))

    def _ccode(self, _printer: Any) -> str:
        raise CompileError(
            "A part of the network is an FMU, of which there is no C code. Simulate it here, or export the rest."
        )

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        handle, row, column, *arguments = self.args
        slopes = [argument.diff(symbol) for argument in arguments]
        if column >= 0 and any(slope != 0 for slope in slopes):
            raise CompileError(f"A law of {handle.program.key} has slopes, but no second derivatives.")
        pairs = enumerate(slopes)
        return sympy.Add(*(External(handle, row, k, *arguments) * slope for k, slope in pairs if slope != 0))

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        _, row, column, *arguments = self.args
        power = "" if exp is None else f"^{{{exp}}}"
        slope = "" if column < 0 else f",{column}"
        inside = ", ".join(printer._print(argument) for argument in arguments)  # noqa: SLF001
        return rf"f_{{{row}{slope}}}{power}\left({inside}\right)"


NUMERICAL = {"External": evaluated}
"""Name and numerical function, for a code printer other than `sympy.lambdify`."""
