"""A right-hand side in machine code: what parameters alone tell is worked out once, and so is what stands twice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from sympy import Basic, Expr, Function, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import FloatPrinter, executed, shared_parts, vectorised_list
from shaftwork.codegen.looped_source import LoopedSource, Stencil, read_by
from shaftwork.components.laws import NUMERICAL
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.machine_code import held_noise, interpolate, interpolation_slope, machine_rates

CALLED: dict[str, Any] = {
    "Interpolation": interpolate,
    "InterpolationSlope": interpolation_slope,
    "HeldNoise": held_noise,
}
"""Functions that sympy does not print, by their names there."""


class MachineProgram:
    """The right-hand side of explicit rows, compiled by numba.

    Args:
        rows: the explicit state equations.
        title: of the network, for messages.

    Raises:
        CompileError: a law has no machine code.
    """

    def __init__(self, rows: Rows, title: str) -> None:
        stencils, constants = LoopedSource(rows, title).stencils
        used = {str(function.func) for stencil in stencils for function in stencil.rate.atoms(Function)}
        if without := sorted(used & NUMERICAL.keys() - CALLED.keys()):
            raise CompileError(f"'{title}' has a law with {', '.join(without)}, of which there is no machine code.")
        count = len(rows.parameters)
        self._parameters, self._constants = rows.parameters, tuple(constants.values())
        self._names: dict[Basic, str] = {TIME: "t"}
        self._names |= {symbol: f"p[{k}]" for k, symbol in enumerate(rows.parameters)}
        self._names |= {symbol: f"p[{count + k}]" for k, symbol in enumerate(constants)}
        self._tables: dict[str, Any] = {}
        body = [*self._lines([stencil for stencil in stencils if stencil.count == 1])]
        for stencil in stencils:
            body += self._loop(stencil) if stencil.count > 1 else ()
        self.source = "\n".join(("def rhs(t, x, p, rates):", *(f"    {line}" for line in body or ["return"]), ""))
        """The code."""
        names = {**vars(math), **{function.__name__: function for function in CALLED.values()}, **self._tables}
        try:
            self.rates = machine_rates(executed(self.source, "rhs", names, names))
            """(t, x (n,), p, dx (n,)) writes dx, for the parameters that `values` gives."""
        except NumbaError as error:
            raise CompileError(f"'{title}' has a law that numba cannot compile: {error}") from error

    def values(self, p: Array) -> Array:
        """The parameters of the code from those of the model."""
        with np.errstate(all="ignore"):
            return np.append(p, [float(value) for value in self._function(*p.tolist())])

    @cached_property
    def _function(self) -> Any:
        return vectorised_list(self._parameters, self._constants)

    def _lines(self, stencils: Sequence[Stencil]) -> list[str]:
        """The lines of single rows."""
        rates, names = list[Expr](), dict(self._names)
        for stencil in stencils:
            places = {symbol: stencil.first + distance for symbol, distance in read_by(stencil.rate)}
            states = {symbol: Symbol(f"x[{place}]", real=True) for symbol, place in places.items()}
            names |= {state: state.name for state in states.values()}
            rates.append(stencil.rate.xreplace(states))
        printer = _MachinePrinter(names, self._tables)
        lines = [f"{name} = {code}" for name, code in shared_parts(printer, rates).items()]
        printed = (printer.doprint(rate) for rate in rates)
        return lines + [f"rates[{stencil.first}] = {rate}" for stencil, rate in zip(stencils, printed, strict=True)]

    def _loop(self, stencil: Stencil) -> list[str]:
        """The lines of equal rows; indices that cannot be negative are what LLVM makes vectors of."""
        first, last, reads = stencil.first, stencil.first + stencil.count, read_by(stencil.rate)
        names = {symbol: f"x{k}[i]" for k, (symbol, _) in enumerate(reads)}
        rate = _MachinePrinter({**self._names, **names}, self._tables).doprint(stencil.rate)
        views = [f"x{k} = x[{first + distance}:{last + distance}]" for k, (_, distance) in enumerate(reads)]
        return [*views, f"part = rates[{first}:{last}]", f"for i in range({stencil.count}):", f"    part[i] = {rate}"]


class _MachinePrinter(FloatPrinter):
    """Python code as numba takes it.

    Args:
        names: of symbols.
        tables: arrays by their names in the code, to which those of tables are added.
    """

    def __init__(self, names: dict[Basic, str], tables: dict[str, Any]) -> None:
        super().__init__(names)
        self._tables = tables

    def _print_Interpolation(self, function: Expr) -> str:
        return f"interpolate({self._of_table(function)})"

    def _print_InterpolationSlope(self, function: Expr) -> str:
        return f"interpolation_slope({self._of_table(function)})"

    def _print_HeldNoise(self, function: Expr) -> str:
        return f"held_noise({', '.join(self._print(argument) for argument in function.args)})"

    def _of_table(self, function: Any) -> str:
        data, names = (function.xs, function.ys), []
        for values in data:
            equal = (name for name, array in self._tables.items() if np.array_equal(array, values))
            name = next(equal, f"table{len(self._tables)}")
            self._tables[name] = np.array(values, dtype=float)
            names.append(name)
        return f"{self._print(function.argument)}, {', '.join(names)}"
