"""Expressions as Python functions whose constants are the floats that the expressions hold."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, reduce
from types import MappingProxyType
from typing import Any

import numpy as np
from sympy import ITE, And, Basic, Expr, Float, Integer, Mul, Or, Piecewise, Pow, S, Symbol
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

from shaftwork.components.discontinuities import parts
from shaftwork.components.laws import NUMERICAL
from shaftwork.core.errors import CompileError

# Terms are printed as sympy keeps them, the same in every process; to sort them would take longer than the rest.
SETTINGS = {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True, "order": "none"}
SCALAR = {**vars(math), **NUMERICAL}
VECTORISED = {**vars(np), "reduce": reduce, **NUMERICAL}
SHARED = re.compile(r"\bs\d+\b")
Moves = Sequence[tuple[float, float, float, float]]
"""How states move; see `around`."""


class RealNumbers:
    """Numbers as the floats that they are, and powers that are real or no number.

    Args:
        names: of symbols, and of expressions that have been evaluated before.
    """

    settings: Mapping[str, Any] = MappingProxyType(SETTINGS)

    def __init__(self, names: Mapping[Symbol, str]) -> None:
        super().__init__(dict(self.settings))  # type: ignore[call-arg]
        self.names: dict[Basic, str] = dict(names)

    def doprint(self, expression: Expr) -> str:
        """The code of an expression."""
        return self._print(expression)

    def _print(self, node: Any, **options: Any) -> str:
        name = self.names.get(node) if isinstance(node, Basic) else None
        return name or str(super()._print(node, **options))  # type: ignore[misc]

    def _print_Symbol(self, symbol: Symbol) -> str:
        raise CompileError(f"'{symbol}' stands in a law and has no value: it is no argument and no parameter.")

    def _print_Integer(self, number: Integer) -> str:
        # numpy would take those that no machine integer holds for objects
        return str(number) if abs(number) < 2**53 else repr(float(number))

    def _print_Float(self, number: Float) -> str:
        return repr(float(number))  # sympy prints 15 digits, which is another float

    def _print_Pow(self, power: Pow, *options: Any, **named: Any) -> str:
        if abs(power.exp) == S.Half or power.exp.is_integer:
            return str(super()._print_Pow(power, *options, **named))  # type: ignore[misc]
        # Python's own ** gives a complex number for a negative base.
        base, exponent = self._print(power.base), self._print(power.exp)
        return f"{self.power}({base}, {exponent})"  # type: ignore[attr-defined]


class FloatPrinter(RealNumbers, PythonCodePrinter):  # type: ignore[misc]
    """Python's own math functions; sign and Heaviside are not among them."""

    power = "pow"

    def _print_sign(self, expression: Expr) -> str:
        argument = self._print(expression.args[0])
        return f"(1.0 if ({argument}) > 0 else -1.0 if ({argument}) < 0 else 0.0)"

    def _print_Heaviside(self, expression: Expr) -> str:
        argument, at_zero = (self._print(part) for part in expression.args)
        return f"(1.0 if ({argument}) > 0 else 0.0 if ({argument}) < 0 else {at_zero})"


class ArrayPrinter(RealNumbers, NumPyPrinter):  # type: ignore[misc]
    """numpy's functions."""

    power = "power"

    def _print_And(self, condition: And) -> str:
        return self._joined("logical_and", condition)

    def _print_Or(self, condition: Or) -> str:
        return self._joined("logical_or", condition)

    def _print_Piecewise(self, pieces: Piecewise) -> str:
        # sympy's printer simplifies a condition that holds another one, which takes seconds, and numpy's `select`
        # takes ten times as long as `where` for a few numbers
        pairs = [(self._print(piece.args[1]), self._print(piece.args[0])) for piece in pieces.args]
        return reduce(lambda rest, pair: f"where({pair[0]}, {pair[1]}, {rest})", reversed(pairs), "nan")

    def _print_Heaviside(self, expression: Expr) -> str:
        # sympy's printer makes pieces of it and of all maxima in it, which takes minutes
        return f"heaviside({', '.join(self._print(part) for part in expression.args)})"

    def _print_ITE(self, choice: ITE) -> str:
        return f"where({', '.join(self._print(part) for part in choice.args)})"

    def _joined(self, function: str, condition: And | Or) -> str:
        # sympy's printer stacks the conditions, which fails where one is of the time and another of many states
        first, *others = (self._print(part) for part in condition.args)
        return str(reduce(lambda joined, other: f"{function}({joined}, {other})", others, first))


def scalar(
    arguments: Sequence[Symbol] | Mapping[str, Symbol | Sequence[Symbol]], expressions: Sequence[Expr]
) -> Callable[..., Any]:
    """Expressions as one function of floats to a list of floats; its code is its `__doc__`.

    Args:
        arguments: symbols; or, by names for the code, a symbol or those of the floats in a list.
        expressions: what stands in them more than once is evaluated once.
    """
    if not isinstance(arguments, Mapping):
        arguments = {f"v{k}": symbol for k, symbol in enumerate(arguments)}
    printer, lines = _reading(arguments, expressions)
    return _function(printer, lines, tuple(arguments), expressions, SCALAR)


def bindable(
    arguments: Mapping[str, Symbol | Sequence[Symbol]],
    parameters: Mapping[str, Sequence[Symbol]],
    first: Sequence[Expr],
    second: Sequence[Expr],
) -> Callable[..., tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]]:
    """Two lists of expressions as functions of floats, for values of the parameters that are given once.

    The first one gives both lists, the second one the second list alone, and the third one is `around` in code of its
    own; a value that is none is nan.

    Args:
        arguments: a symbol and those of the floats in a list, by names for the code.
        parameters: the same, of what is bound.
        first: expressions; those of `around` are the rates of the floats in the list.
        second: expressions.
    """
    both = (*first, *second)
    printer, bound = _reading(parameters, both)
    arguments_printer, read = _reading(arguments, both)
    printer.names |= arguments_printer.names
    shared = shared_parts(printer, both)
    lists = [[printer.doprint(expression) for expression in expressions] for expressions in (first, second)]
    everything, (t, x) = {**arguments, **parameters}, arguments
    slow = f"second({', '.join(everything)})"
    (whole, values), (alone, last) = (_evaluated(shared, some) for some in (lists, lists[1:]))
    beside = [f"start = {t}", *read, *whole, f"rates, now = {values}", *_moved(t, x, len(first), alone, last)]
    inner = [
        *_guarded(f"both({t}, {x})", [*read, *whole, f"return {values}"], f"first({', '.join(everything)}), {slow}"),
        *_guarded(f"one({t}, {x})", [*read, *alone, f"return {last}"], slow),
        *_guarded(f"near({t}, {x}, tick, moves, most)", beside, f"around(both, one, start, {x}, tick, moves, most)"),
        "return both, one, near",
    ]
    names = {**SCALAR, "around": around}
    names |= {"first": branchwise(everything, first), "second": branchwise(everything, second)}
    return _compiled("bind", tuple(parameters), [*bound, *inner], names)


def around(
    both: Callable[..., Any], one: Callable[..., Any], t: float, x: list[float], tick: float, moves: Moves, most: float
) -> tuple[list[float], list[float], list[float]]:
    """Values at an instant, as far away from it as rounding may move it, and later along a straight line.

    Args:
        both: rates of the states, and the values.
        one: the values alone.
        t: time.
        x: states.
        tick: how far rounding moves the time.
        moves: of each state a part of it and the least that rounding moves it, the side, and how far the line takes it.
        most: the longest time along the line.
    """
    (rates, now), beside, step = both(t, x), [], most
    for value, rate, (part, least, side, reach) in zip(x, rates, moves, strict=True):
        # all of it to the same side: what a tick moves must not make up for the rest
        beside.append(value + part * abs(value) + least + side * tick * abs(rate))
        if rate and reach < step * abs(rate):
            step = reach / abs(rate)
    later = [value + step * rate for value, rate in zip(x, rates, strict=True)]
    return now, one(t + tick, beside), one(t + step, later)


def _moved(t: str, x: str, count: int, alone: list[str], values: str) -> list[str]:
    """The lines of `around` behind the rates, without loops and calls: they are run at every event."""
    lines = ["step = most"]
    for k in range(count):
        lines += [
            f"value, rate{k}, (part, least, side, reach) = {x}[{k}], rates[{k}], moves[{k}]",
            f"speed = abs(rate{k})",
            f"{x}{k} = value + part * abs(value) + least + side * tick * speed",
            "if speed and reach < step * speed:",
            "    step = reach / speed",
        ]
    later = [f"{x}{k} = {x}[{k}] + step * rate{k}" for k in range(count)]
    lines += [f"{t} = start + tick", *alone, f"beside = {values}"]
    return [*lines, f"{t} = start + step", *later, *alone, f"return now, beside, {values}"]


def branchwise(
    arguments: Mapping[str, Symbol | Sequence[Symbol]], expressions: Sequence[Expr]
) -> Callable[..., list[float]]:
    """Expressions as a slow function of floats, for where those of `scalar` raise; a value that is none is nan.

    What stands in an expression more than once is evaluated there though no branch may need it whose condition holds.

    Args:
        arguments: as of `scalar`.
        expressions: to evaluate.
    """
    symbols = [s for one in arguments.values() for s in ((one,) if isinstance(one, Symbol) else one)]
    compiled = list[Callable[..., Any]]()

    def function(*values: Any) -> list[float]:
        if not compiled:
            compiled.append(vectorised_list(symbols, expressions))
        with np.errstate(all="ignore"):
            numbers = [float(value) for value in compiled[0](*np.hstack(values))]
        return [value if math.isfinite(value) else math.nan for value in numbers]

    return function


def _evaluated(shared: Mapping[str, str], lists: list[list[str]]) -> tuple[list[str], str]:
    """The lines that evaluate what stands in lists more than once, and the lists."""
    needed = _needed(shared, [text for texts in lists for text in texts])
    lines = [f"{part} = {shared[part]}" for part in shared if part in needed]
    return lines, ", ".join(f"[{', '.join(texts)}]" for texts in lists)


def _guarded(head: str, lines: list[str], slow: str) -> list[str]:
    """The lines of a function that computes more slowly where Python's functions raise."""
    return [
        f"def {head}:",
        "    try:",
        *(f"        {line}" for line in lines),
        "    except (ArithmeticError, ValueError):",
        f"        return {slow}",
    ]


def _needed(shared: Mapping[str, str], texts: Iterable[str]) -> set[str]:
    """The names of shared parts that stand in texts, or in such parts."""
    needed = set[str]()
    names = {name for text in texts for name in SHARED.findall(text)}
    while names:
        needed |= names
        names = {name for part in names for name in SHARED.findall(shared[part])} - needed
    return needed


def _reading(
    arguments: Mapping[str, Symbol | Sequence[Symbol]], expressions: Sequence[Expr]
) -> tuple[FloatPrinter, list[str]]:
    """A printer that knows the symbols of arguments by name, and the lines that read them from lists."""
    names: dict[Symbol, str] = {}
    lines = []
    used = set(parts(expressions))
    for name, symbols in arguments.items():
        if isinstance(symbols, Symbol):
            names[symbols] = name
            continue
        taken = {symbol: k for k, symbol in enumerate(symbols) if symbol in used}
        lines += [f"{name}{k} = {name}[{k}]" for k in taken.values()]
        names |= {symbol: f"{name}{k}" for symbol, k in taken.items()}
    return FloatPrinter(names), lines


@lru_cache(maxsize=4096)
def vectorised(symbols: tuple[Symbol, ...], expression: Expr) -> Callable[..., Any]:
    """An expression as a function of arrays or floats; kept, as the same laws come back in every set of equations."""
    return vectorised_list(symbols, expression)


def is_rough(function: Callable[..., Any], arguments: Iterable[Any]) -> bool:
    """Whether a function computes on its way what is no number, as in a branch that does not hold."""
    try:
        with np.errstate(all="ignore", divide="raise", invalid="raise"):
            function(*arguments)
    except FloatingPointError:
        return True
    return False


def vectorised_list(symbols: Sequence[Symbol], expressions: Expr | Sequence[Expr]) -> Callable[..., Any]:
    """Several expressions as one function of arrays or floats; or one, which is not kept."""
    arguments = tuple(f"v{k}" for k in range(len(symbols)))
    return _function(ArrayPrinter(dict(zip(symbols, arguments, strict=True))), [], arguments, expressions, VECTORISED)


def _function(
    printer: Any, lines: list[str], arguments: tuple[str, ...], result: Expr | Sequence[Expr], names: dict[str, Any]
) -> Callable[..., Any]:
    """A function of its own code that returns an expression, or a list of them.

    `sympy.lambdify` builds every expression anew to rename its symbols and to share its parts: most of the time in
    which a network is compiled. A printer that knows the names does without.
    """
    shared = shared_parts(printer, [result] if isinstance(result, Expr) else result)
    lines += [f"{name} = {code}" for name, code in shared.items()]
    values = printer.doprint(result) if isinstance(result, Expr) else f"[{', '.join(map(printer.doprint, result))}]"
    return _compiled("function", arguments, [*lines, f"return {values}"], names)


def _compiled(name: str, arguments: tuple[str, ...], lines: list[str], names: dict[str, Any]) -> Callable[..., Any]:
    source = f"def {name}({', '.join(arguments)}):\n" + "".join(f"    {line}\n" for line in lines)
    function = executed(source, name, names, {})
    function.__doc__ = source
    return function


def executed(source: str, name: str, names: dict[str, Any], namespace: dict[str, Any]) -> Callable[..., Any]:
    """A function of code that was made from expressions.

    Args:
        source: the code.
        name: of the function.
        names: objects by their names in the code.
        namespace: where all that the code defines goes.
    """
    exec(compile(source, "<equations>", "exec"), names, namespace)  # noqa: S102 (of our own making, from expressions)
    function: Callable[..., Any] = namespace[name]
    return function


def shared_parts(printer: Any, expressions: Sequence[Expr], *, scaled: bool = True) -> dict[str, str]:
    """The code of what stands in expressions more than once, by the names that the printer knows from here on.

    Args:
        printer: of the expressions.
        expressions: all of them.
        scaled: whether multiples of a symbol count, which compiled code has at once.
    """
    codes = {}
    repeated = _repeated(expressions)
    for number, shared in enumerate(repeated if scaled else [one for one in repeated if not _is_scaled(one)]):
        codes[f"s{number}"] = printer.doprint(shared)
        printer.names[shared] = f"s{number}"
    return codes


def _repeated(expressions: Sequence[Expr]) -> list[Basic]:
    """What stands in expressions more than once, each after its own parts."""
    times: dict[Basic, int] = {}

    def count(node: Basic) -> None:
        if node.args:
            times[node] = times.get(node, 0) + 1
            if times[node] == 1:
                for part in node.args:
                    count(part)
                del times[node]  # behind its parts
                times[node] = 1

    for expression in expressions:
        count(expression)
    # a reciprocal is printed as a division
    return [n for n, uses in times.items() if uses > 1 and isinstance(n, Expr) and not _is_reciprocal(n)]


def _is_scaled(node: Basic) -> bool:
    return isinstance(node, Mul) and len(node.args) == 2 and node.args[0].is_number and node.args[1].is_Symbol


def _is_reciprocal(node: Basic) -> bool:
    return isinstance(node, Pow) and bool(node.exp.is_number and node.exp.is_negative)
