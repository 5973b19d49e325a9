"""Expressions as statements of C99, with tables and noise."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from sympy import Basic, Expr, Mod, Piecewise, Pow, Symbol, true
from sympy.printing.codeprinter import PrintMethodNotImplementedError

from shaftwork.codegen.code import shared_parts
from shaftwork.codegen.looped_source import CPrinter
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.components.tables import Interpolation, InterpolationSlope, Table
from shaftwork.core.errors import CompileError
from shaftwork.formulation.coupled_blocks import CoupledBlock, blocks_in

LARGEST_PRODUCT = 4
"""Powers up to this one of a plain name are products: `pow` takes ten times as long."""
TERM = re.compile(r"\b(?:s|solved_)\d+\b")
"""The name of what stands in expressions more than once, or of the solution of a linear system."""


class TablePrinter(CPrinter):
    """C's math functions, tables and noise.

    Args:
        names: of symbols.
        tables: by table the number under which its points stand; what is printed adds its own.
    """

    def __init__(self, names: Mapping[Symbol, str], tables: dict[Table, int]) -> None:
        super().__init__(names)
        self.tables = tables

    def _print_Interpolation(self, node: Interpolation) -> str:
        return f"table({self._table(node)}, {self._print(node.argument)})"

    def _print_InterpolationSlope(self, node: InterpolationSlope) -> str:
        return f"table_slope({self._table(node)}, {self._print(node.argument)})"

    def _table(self, node: Interpolation | InterpolationSlope) -> str:
        number = self.tables.setdefault(node.table, len(self.tables))
        return f"{len(node.xs)}, TABLE_{number}_X, TABLE_{number}_Y"

    def _print_HeldNoise(self, noise: HeldNoise) -> str:
        return f"held_noise({', '.join(self._print(part) for part in noise.args)})"

    def _print_Mod(self, node: Mod) -> str:
        number, period = (f"({self._print(part)})" for part in node.args)
        return f"({number} - {period} * floor({number} / {period}))"  # fmod has the sign of the number

    def _print_Pow(self, power: Pow, *options: Any, **named: Any) -> str:
        base = self._print(power.base)
        if power.exp.is_Integer and 2 <= power.exp <= LARGEST_PRODUCT and base.replace("_", "").isalnum():
            return f"({' * '.join([base] * int(power.exp))})"
        return super()._print_Pow(power, *options, **named)

    def _print_BooleanTrue(self, _: Basic) -> str:
        return "1"

    def _print_BooleanFalse(self, _: Basic) -> str:
        return "0"

    def _print_Piecewise(self, pieces: Piecewise) -> str:
        text = "NAN"
        for value, condition in reversed(pieces.args):
            code = self._print(value)
            text = code if condition is true else f"({self._print(condition)} ? {code} : {text})"
        return f"({text})"


class Statements:
    """Writes expressions as assignments.

    Args:
        names: C code of every symbol.
        title: of the network, for messages.
    """

    def __init__(self, names: Mapping[Symbol, str], title: str) -> None:
        self._names, self._title = names, title
        self.tables: dict[Table, int] = {}
        self.matrices: dict[int, tuple[str, str]] = {}
        """Name and text of the function of each matrix, by its identity."""

    def assigned(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """The lines that assign expressions to targets, what stands in them more than once first."""
        code = self.code_of(expressions)
        for lines in code.systems.values():
            yield from lines
        yield from (f"const double {term} = {value};" for term, value in code.terms.items())
        yield from (f"{target} = {value};" for target, value in zip(targets, code.values, strict=True))

    def code_of(self, expressions: Sequence[Expr]) -> InTerms:
        """Expressions in terms that stand in them more than once, and in what linear systems of equations tell.

        Raises:
            CompileError: C has no such function.
        """
        names, systems = dict(self._names), dict[str, list[str]]()
        for number, system in enumerate(blocks_in(expressions)):
            n, vector = len(system.right), f"solved_{number}"
            terms, sides = self._in_terms(names, system.right)
            lines = [f"double matrix[{n * n}] = {{0.0}};", f"{self._matrix(system)}(m, t, x, matrix);"]
            lines += (f"const double {term} = {code};" for term, code in terms.items())
            lines += (f"{vector}[{k}] = {side};" for k, side in enumerate(sides))
            lines.append(f"solve({n}, matrix, 1, {vector});")
            systems[vector] = [f"double {vector}[{n}] = {{0.0}};", "{", *(f"    {line}" for line in lines), "}"]
            names |= {unknown: f"{vector}[{k}]" for k, unknown in enumerate(system.unknowns)}
        return InTerms(systems, *self._in_terms(names, expressions))

    def _matrix(self, system: CoupledBlock) -> str:
        """The name of the function that fills in the matrix of a system; its derivatives have the same one."""
        if id(system.matrix) not in self.matrices:
            name, n = f"matrix_{len(self.matrices)}", len(system.right)
            lines = self.assigned([f"matrix[{i * n + j}]" for i, j in system.matrix], [*system.matrix.values()])
            head = f"void {name}(const NAME *m, double t, const double *restrict x, double *restrict matrix)"
            self.matrices[id(system.matrix)] = name, function(head, [*lines])
        return self.matrices[id(system.matrix)][0]

    def _in_terms(self, names: Mapping[Symbol, str], expressions: Sequence[Expr]) -> tuple[dict[str, str], list[str]]:
        plain = [_in_pieces(expression) for expression in expressions]
        printer = TablePrinter(names, self.tables)
        try:
            return shared_parts(printer, plain, scaled=False), [printer.doprint(expression) for expression in plain]
        except PrintMethodNotImplementedError as error:
            raise CompileError(
                f"'{self._title}' has a law that C has no function for: {error}. Write it with others, or as a Table."
            ) from None


class InTerms(NamedTuple):
    """The code of expressions.

    Args:
        systems: lines that declare and fill in a vector, the solution of a linear system, by its name.
        terms: code of what stands in the expressions more than once, by its name.
        values: code of the expressions.
    """

    systems: dict[str, list[str]]
    terms: dict[str, str]
    values: list[str]


def _in_pieces(expression: Expr) -> Expr:
    """With smooth noise in terms of numbers that are held."""
    noises: dict[Basic, Basic] = {noise: noise.pieces for noise in expression.atoms(SmoothNoise)}
    return expression.xreplace(noises) if noises else expression


def function(head: str, lines: Sequence[str]) -> str:
    """A static C function; arguments that its lines do not read are marked as unused."""
    names = [argument.split("*")[-1].split(" ")[-1] for argument in head[head.index("(") + 1 : -1].split(", ")]
    words = {word for line in lines for word in re.findall(r"(?<!->)\b\w+", line)}
    unused = [f"(void){name};" for name in names if name not in words]
    return "\n".join([f"static {head}", "{", *(f"    {line}" for line in (*unused, *lines)), "}", ""])


def text_of(value: str) -> str:
    """A C string literal; signs beyond ASCII are escaped byte by byte."""
    signs = (chr(byte) if 32 <= byte < 127 and byte not in (34, 92, 63) else f"\\{byte:03o}" for byte in value.encode())
    return f'"{"".join(signs)}"'


def array(kind: str, name: str, values: Sequence[str], width: int = 100) -> str:
    """A static table of constants, several on a line; at least one, as C knows no empty arrays."""
    lines, line = list[str](), "   "
    for value in values or ["0"]:
        if len(line) + len(value) > width:
            lines.append(line)
            line = "   "
        line += f" {value},"
    return "\n".join([f"static {kind} {name}[] = {{", *lines, line, "};", ""])
