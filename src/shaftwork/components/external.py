"""External functions: laws without a formula here, evaluated by another program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, Self

import numpy as np
import sympy

from shaftwork.core.errors import CompileError

RELATIVE_STEP = 6e-6
"""Of a central difference, the cube root of the rounding of floats: its error is then least, some 4e-11."""


class ExternalFunction(Protocol):
    """A function of several outputs; a pure one, so that calls may be repeated and come in any order."""

    key: str
    """Identifies the function."""

    def value(self, output: int, arguments: tuple[float, ...]) -> float:
        """The value of one output.

        Args:
            output: its index.
            arguments: numbers in SI.
        """
        ...


_FUNCTIONS: dict[str, ExternalFunction] = {}
"""Functions by their keys: compiled code is text and holds the key alone."""


class Handle(sympy.Atom):  # type: ignore[misc]
    """An external function among the arguments of an expression."""

    is_commutative = True

    def __new__(cls, function: ExternalFunction) -> Self:
        """The handle of a function; an instance of the same key is reused.

        Args:
            function: to be called.
        """
        handle: Self = super().__new__(cls)
        handle.function = _FUNCTIONS.setdefault(function.key, function)
        return handle

    function: ExternalFunction

    def __getnewargs__(self) -> tuple[ExternalFunction]:
        return (self.function,)

    def _hashable_content(self) -> tuple[str]:
        return (self.function.key,)

    def _sympystr(self, _printer: Any) -> str:
        return repr(self.function.key)

    _sympyrepr = _pythoncode = _numpycode = _sympystr


def evaluated(key: str, output: Any, direction: Any, *arguments: Any) -> Any:
    """Value of `External`, for numbers or arrays of numbers.

    Args:
        key: of the function.
        output: index of the output.
        direction: index of the argument of a partial derivative; -1 for the value.
        *arguments: of the function.
    """
    function, indices = _FUNCTIONS[key], (int(output), int(direction))
    if all(isinstance(argument, int | float) for argument in arguments):
        return _number(function, *indices, [float(argument) for argument in arguments])
    broadcast = np.broadcast_arrays(*(np.asarray(argument, dtype=float) for argument in arguments))
    points = zip(*(values.ravel().tolist() for values in broadcast), strict=True)
    numbers = [_number(function, *indices, list(point)) for point in points]
    return np.array(numbers).reshape(broadcast[0].shape)


def _number(function: ExternalFunction, output: int, direction: int, point: Sequence[float]) -> float:
    if direction < 0:
        return function.value(output, tuple(point))
    k, step = direction, RELATIVE_STEP * max(1.0, abs(point[direction]))
    before, after = ([*point[:k], point[k] + side * step, *point[k + 1 :]] for side in (-1, 1))
    difference = function.value(output, tuple(after)) - function.value(output, tuple(before))
    return difference / (after[k] - before[k])


class External(sympy.Function):  # type: ignore[misc]
    """An output of an external function or its partial derivative: (handle, output, argument or -1, arguments).

    Partial derivatives are central differences, good to about ten digits.
    """

    # lambdify finds the numerical function of a sympy function under this name
    _imp_ = staticmethod(evaluated)

    @classmethod
    def eval(cls, *_arguments: sympy.Expr) -> None:
        """It stays as it is, also for numbers: the function is called during a run alone."""

    def _eval_is_extended_real(self) -> bool:
        return True

    def _eval_evalf(self, _precision: int) -> sympy.Expr:
        handle, output, direction, *arguments = self.args
        return External(handle, output, direction, *(argument.evalf() for argument in arguments))

    def _ccode(self, _printer: Any) -> str:
        raise CompileError(
            "A part of the network is an FMU, of which there is no C code. Simulate it here, or export the rest."
        )

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        handle, output, direction, *arguments = self.args
        inner = [argument.diff(symbol) for argument in arguments]
        if direction >= 0 and any(derivative != 0 for derivative in inner):
            raise CompileError(f"{handle.function.key} has first derivatives, but no second ones.")
        chain = ((k, derivative) for k, derivative in enumerate(inner) if derivative != 0)
        return sympy.Add(*(External(handle, output, k, *arguments) * derivative for k, derivative in chain))

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        _, output, direction, *arguments = self.args
        power = "" if exp is None else f"^{{{exp}}}"
        derivative = "" if direction < 0 else f",{direction}"
        inside = ", ".join(printer._print(argument) for argument in arguments)  # noqa: SLF001
        return rf"f_{{{output}{derivative}}}{power}\left({inside}\right)"


NUMERICAL = {"External": evaluated}
"""Name and numerical function, for a code printer other than `sympy.lambdify`."""
