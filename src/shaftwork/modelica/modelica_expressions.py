"""Modelica in small pieces: expressions, names, numbers, units and texts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import reduce
from textwrap import fill
from types import MappingProxyType
from typing import Any

from sympy import And, Basic, Expr, Float, Integer, Not, Or, Piecewise, Pow, Rational, S, Symbol
from sympy.core.relational import Relational
from sympy.printing.codeprinter import CodePrinter

from shaftwork.codegen.code import RealNumbers
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import normal
from shaftwork.core.errors import CompileError
from shaftwork.network.netlist import unused

KEYWORDS = frozenset(
    re.findall(
        r"\w+",
        "algorithm and annotation assert block break class connect connector constant constrainedby der discrete "
        "each else elseif elsewhen encapsulated end enumeration equation expandable extends external false final "
        "flow for function if import impure in initial inner input loop model not operator or outer output package "
        "parameter partial protected public pure record redeclare replaceable return stream then true type when "
        "while within time abs sign sqrt div mod rem ceil floor integer sin cos tan asin acos atan atan2 sinh cosh "
        "tanh exp log log10 pre edge change delay sample size ndims zeros ones fill identity transpose sum product "
        "min max homotopy smooth noEvent terminal reinit Real Integer Boolean String Modelica Network interpolate ",
    )
)
"""Words that name nothing else."""
INTERPOLATE = """  function interpolate "Straight lines between points, constant beyond their ends"
    input Real x[:] "Arguments, ascending";
    input Real y[:] "Values";
    input Real u;
    output Real v;
  protected
    Integer k;
  algorithm
    k := 1;
    while k < size(x, 1) - 1 and u > x[k + 1] loop
      k := k + 1;
    end while;
    v := y[k] + (y[k + 1] - y[k]) * (max(x[1], min(x[size(x, 1)], u)) - x[k]) / (x[k + 1] - x[k]);
  end interpolate;
"""
"""The function that tables are printed as."""
NOISE = range(-16, 1001)
"""The numbers of noise that a text holds; a motion that comes to others stops there."""
_NOISE_NAME = re.compile(r"held_noise_(\w+)\(")
_UNITS = {"ohm": "Ohm"}


class ModelicaPrinter(RealNumbers, CodePrinter):  # type: ignore[misc]
    """Expressions in Modelica.

    Args:
        names: the text of each symbol; what else stands in an expression has none.
        title: whose law it is, for messages.
        values: of parameters by their symbols, where noise reads its seed.
    """

    language = "Modelica"
    printmethod = "_modelica"
    settings: Mapping[str, Any] = MappingProxyType({"order": "none"})
    _operators = MappingProxyType({"and": "and", "or": "or", "not": "not"})

    def __init__(self, names: Mapping[Any, str], title: str, values: Mapping[Any, float] | None = None) -> None:
        super().__init__({TIME: "time", **names})
        self.title, self.values = title, values or {}

    def _print_Integer(self, whole: Integer) -> str:
        return str(whole) if abs(whole) < 2**31 else repr(float(whole))

    def _print_Rational(self, quotient: Rational) -> str:
        return f"{quotient.p} / {quotient.q}" if max(abs(quotient.p), quotient.q) < 2**31 else repr(float(quotient))

    def _print_Float(self, value: Float) -> str:
        return number(float(value))

    def _print_NumberSymbol(self, value: Expr) -> str:
        return repr(float(value))

    def _print_Pow(self, power: Pow, *_: Any, **__: Any) -> str:
        if power.exp == S.Half:
            return f"sqrt({self._print(power.base)})"
        if power.exp == -S.Half:
            return f"1 / sqrt({self._print(power.base)})"
        if power.exp == -1:
            return f"1 / {self._in_brackets(power.base)}"
        return f"{self._in_brackets(power.base)} ^ {self._in_brackets(power.exp)}"

    def _in_brackets(self, node: Expr) -> str:
        text = self._print(node)
        return text if re.fullmatch(r"[\w.\[\]]+", text) else f"({text})"

    def _print_Piecewise(self, pieces: Piecewise) -> str:
        *before, (last, always) = pieces.args
        if always != S.true:
            raise CompileError(f"{self.title}: a law has no value in some places. End its Piecewise with True.")
        words = "".join(f"if {self._print(when)} then {self._print(value)} else " for value, when in before)
        return f"({words}{self._print(last)})"

    def _print_Relational(self, relation: Relational) -> str:
        return f"{self._print(relation.lhs)} {relation.rel_op} {self._print(relation.rhs)}"

    def _print_And(self, condition: And) -> str:
        return " and ".join(f"({self._print(part)})" for part in condition.args)

    def _print_Or(self, condition: Or) -> str:
        return " or ".join(f"({self._print(part)})" for part in condition.args)

    def _print_Not(self, condition: Not) -> str:
        return f"not ({self._print(condition.args[0])})"

    def _print_BooleanTrue(self, _: Basic) -> str:
        return "true"

    def _print_BooleanFalse(self, _: Basic) -> str:
        return "false"

    def _print_Max(self, most: Expr) -> str:
        return reduce(lambda first, second: f"max({first}, {second})", map(self._print, most.args))

    def _print_Min(self, least: Expr) -> str:
        return reduce(lambda first, second: f"min({first}, {second})", map(self._print, least.args))

    def _print_Heaviside(self, step: Expr) -> str:
        argument, at_zero = map(self._print, step.args)
        if step.args[1] in (0, 1):
            return f"(if {argument} {'>' if step.args[1] == 0 else '>='} 0 then 1 else 0)"
        return f"(if {argument} > 0 then 1 else if {argument} < 0 then 0 else {at_zero})"

    def _print_Abs(self, size: Expr) -> str:
        return f"abs({self._print(size.args[0])})"

    def _print_Mod(self, rest: Expr) -> str:
        return f"mod({self._print(rest.args[0])}, {self._print(rest.args[1])})"

    def _print_ITE(self, choice: Expr) -> str:
        when, then, other = map(self._print, choice.args)
        return f"(if {when} then {then} else {other})"

    def _print_Interpolation(self, table: Any) -> str:
        points, values = (", ".join(map(number, numbers)) for numbers in (table.xs, table.ys))
        return f"interpolate({{{points}}}, {{{values}}}, {self._print(table.argument)})"

    def _print_HeldNoise(self, noise: Expr) -> str:
        number_of, seed = noise.args
        seed = self.values.get(seed, seed)
        word = repr(float(seed)).removesuffix(".0").replace("-", "m").replace(".", "p").replace("+", "")
        return f"held_noise_{word}({self._print(number_of)})"

    def _print_SmoothNoise(self, noise: Any) -> str:
        return self._print(noise.pieces)

    def _print_Function(self, function: Expr) -> str:
        name = function.func.__name__
        if name not in FUNCTIONS:
            raise CompileError(
                f"{self.title}: a law has {name}, which has no counterpart in Modelica. Put a table or a formula of "
                f"{', '.join(FUNCTIONS)} in its place."
            )
        return f"{name}({', '.join(map(self._print, function.args))})"

    _print_floor = _print_sign = _print_ceiling = _print_Function


FUNCTIONS = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
    *("exp", "log", "sign", "floor"),
)
"""Functions that have the same name in sympy and in Modelica."""


def functions_in(text: str) -> str:
    """The functions that laws in a text call: interpolation in tables, and noise by its seeds."""
    functions = [INTERPOLATE] if "interpolate(" in text else []
    return "".join((*functions, *map(_noise, dict.fromkeys(_NOISE_NAME.findall(text)))))


def _noise(word: str) -> str:
    """The function of the noise of a seed."""
    seed = float(word.replace("m", "-").replace("p", "."))
    values = fill(
        ", ".join(repr(normal(k, seed)) for k in NOISE), 110, initial_indent=" " * 6, subsequent_indent=" " * 6
    )
    reach = f"k >= {NOISE[0]} and k <= {NOISE[-1]}"
    return f"""  function held_noise_{word} "Number k of the standard normal numbers of the seed {seed:g}"
    input Real k;
    output Real v;
  protected
    constant Real values[{len(NOISE)}] = {{
{values}}};
  algorithm
    assert({reach}, "The text holds the noise of {reach} alone");
    v := values[integer(k) + {1 - NOISE[0]}];
  end held_noise_{word};
"""


def number(value: float) -> str:
    """A number so that it is read as the same float."""
    return str(int(value)) if value == int(value) and abs(value) < 1e6 else repr(value)


def unit(text: str) -> str:
    """The unit of a parameter in Modelica's spelling: N*m*s/rad is N.m.s/rad."""
    return re.sub(r"\w+", lambda word: _UNITS.get(word[0], word[0]), text.replace("*", ".").replace("^", ""))


def quoted(text: str) -> str:
    """A comment in quotes, in one line."""
    return '"' + " ".join(text.split()).replace("\\", "\\\\").replace('"', '\\"') + '"'


class Identifiers:
    """Names of Modelica, each once.

    Args:
        taken: names that are not to be used besides.
    """

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken) | KEYWORDS  # only asked for membership
        self._by_name: dict[str, str] = {}

    def __getitem__(self, name: str) -> str:
        """The identifier of a name; the same one each time."""
        if name not in self._by_name:
            self._by_name[name] = self.unused(name)
        return self._by_name[name]

    def unused(self, name: str) -> str:
        """A name that nothing has yet, made from one: letters, digits and underscores alone."""
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)
        plain = plain if re.match(r"[A-Za-z]", plain) else f"x_{plain}"
        candidate = unused(plain, self._taken, "{}_{}")
        self._taken.add(candidate)
        return candidate


def symbols_of(names: Mapping[str, str]) -> dict[Symbol, str]:
    """The texts of symbols by their names."""
    return {Symbol(name, real=True): text for name, text in names.items()}
