"""The slopes of laws about a point, as parameters where they are made of these, else as letters, and their values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from sympy import Expr, Float, Integer, Rational, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE
from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError, no_quantity
from shaftwork.equations.quantities import Quantities, is_rate
from shaftwork.formulation.form import Names
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, readings_of
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

VARIED = Symbol("varied", real=True)
"""Stands for what a law that jumps reads."""
FRACTION_DIGITS = 40
"""Decimal digits with which numbers that are no fractions, as pi, become fractions: far more than floats have."""

Values = Mapping[str, float]


class Slope(NamedTuple):
    """What the letter of a slope stands for: how what a law lets through changes with what it reads.

    Attributes:
        of: symbol of what passes through, with a sign; zero where that of the law alone has none.
        by: what the law reads.
        value: the slope, in quantities of the network.
        part: whose law it is.
        jumps: the law with `VARIED` in place of what it reads, where it may jump in that; else None.
    """

    of: Expr
    by: Expr
    value: Expr
    part: str
    jumps: Expr | None


class LawSlopes:
    """The slopes of the laws of a network.

    Args:
        quantities: its symbols.
    """

    def __init__(self, quantities: Quantities) -> None:
        self._quantities, self._slopes = quantities, dict[int, Mapping[Symbol, Expr]]()
        self.letters: dict[Symbol, Slope] = {}
        """What the letters stand for, of all laws that have been asked for."""

    def of(self, branch: GraphBranch) -> Mapping[Symbol, Expr]:
        """The slopes of a law by what it reads, in the symbols of its template."""
        if branch.index not in self._slopes:
            self._slopes[branch.index] = dict(self._slopes_of(branch))
        return self._slopes[branch.index]

    def _slopes_of(self, branch: GraphBranch) -> Iterator[tuple[Symbol, Expr]]:
        quantities, index = self._quantities, branch.index
        law, reads = quantities.own_law(index), readings_of(quantities.graph, index)
        if RATE in reads:  # printed it lacks what stands with the store
            law = quantities.graph.in_network_symbols(branch.template.law, branch)
        names = {"across": quantities.node, "through": quantities.carried, "integral": quantities.integral}
        names["rate"] = quantities.rate
        point = {ACROSS: quantities.across((branch.plus, branch.minus)), INTEGRAL: quantities.integral(index)}
        point |= {symbol: names[of.kind](of.of) for symbol, of in reads.items()}
        for symbol in point:
            rate = slope(law, symbol) if law.has(symbol) else Integer(0)
            may_jump = jumps(law, symbol)
            if rate == 0 and not may_jump:
                continue
            if not may_jump and rate.free_symbols.isdisjoint({*point, TIME}) and rate.is_rational_function():
                yield symbol, rate
            else:
                jumping = law.xreplace({**point, symbol: VARIED}) if may_jump else None
                yield symbol, self._letter(index, point[symbol], rate.xreplace(point), jumping)

    def _letter(self, index: int, by: Expr, value: Expr, jumping: Expr | None) -> Symbol:
        quantities = self._quantities
        owner, flow = quantities.graph.part_of(index).name, quantities.flow_of[index]
        number = sum(each.part == owner for each in self.letters.values())
        name = f"slope{f'_{number + 1}' if number else ''}({owner})"  # no parameter has such a name
        letter = Symbol(name, real=True)
        of = flow.sign * quantities.through(flow) if len(flow.branches) == 1 else Integer(0)
        self.letters[letter] = Slope(of, by, value, owner, jumping)
        return letter


def exact(expression: Expr) -> Expr:
    """Floats as the fractions that they are written as, 0.05 as 1/20, which is within their rounding."""
    return expression.xreplace({number: Rational(repr(float(number))) for number in expression.atoms(Float)})


def fraction(number: Expr) -> Rational:
    """A number as a fraction, to `FRACTION_DIGITS` digits where it is none."""
    return number if number.is_Rational else Rational(number.evalf(FRACTION_DIGITS))


class PointValues:
    """The values of all symbols.

    Raises:
        ParameterError: there is no such parameter or quantity.
    """

    def __init__(self, equations: Equations, parameters: Values | None, at: Values | None, t: float | None) -> None:
        graph = equations.form.graph
        values = {**graph.parameters, **_checked(graph, parameters or {})}
        self._parameters = {Symbol(name, real=True): Rational(float(value)) for name, value in values.items()}
        for symbol, law in equations.definitions.items():
            self._parameters[symbol] = fraction(exact(law).xreplace(self._parameters))
        time = _time(equations, self._parameters, at) if t is None else _finite("t", t)
        self._point, self._at_rest = _Point(equations, at or {}), at is None
        self._time = {TIME: Rational(time)}

    def with_slopes(self, slopes: Mapping[Symbol, Slope]) -> dict[Symbol, Rational]:
        """The values of parameters, of what is derived from them, and of slopes of laws.

        Raises:
            ParameterError: one has no finite value at the point, or reads what the point does not name.
        """
        numbers = dict(self._parameters)
        for letter, each in slopes.items():
            laws = [each.value, each.by, *([] if each.jumps is None else [each.jumps])]
            read = set[Symbol]().union(*(law.free_symbols for law in laws)) - {*numbers, TIME, VARIED}
            at = {**self._time, **numbers}
            for symbol in sorted(read, key=str):
                value = self._point.value(symbol)
                if value is None and not (self._at_rest or is_rate(symbol)):
                    raise ParameterError(
                        f"at: the law of '{each.part}' reads {symbol}, which is not given. Give it, 0.0 for rest."
                    )
                at[symbol] = Integer(0) if value is None else value
            number = each.value.xreplace(at).evalf(FRACTION_DIGITS)
            if not (number.is_number and number.is_real and number.is_finite) or _jumps(each, at, float(number)):
                raise ParameterError(
                    f"The law of '{each.part}' has no finite slope at this point. Take another in at=."
                )
            numbers[letter] = Rational(number)
        return numbers


def _jumps(slope: Slope, numbers: Mapping[Symbol, Rational], value: float) -> bool:
    """Whether a law jumps at the point itself."""
    if slope.jumps is None:
        return False
    at = float(slope.by.xreplace(dict(numbers)))
    # A law jumps where it changes so near the point by more than this part of itself, beside what its slope tells.
    nearby, jump = 1e-9, 1e-6
    step = nearby * max(abs(at), 1.0)
    below, above = (float(slope.jumps.xreplace({**numbers, VARIED: Float(at + by)})) for by in (-step, step))
    return abs(above - below - 2 * step * value) > jump * max(abs(above), abs(below))


def _finite(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ParameterError(f"{name} = {value!r} is no finite number.")
    return number


def _checked(graph: CircuitGraph, parameters: Values) -> Values:
    """Values that parameters may have.

    Raises:
        ParameterError: there is no such parameter, or its part has an objection.
    """
    for name, value in parameters.items():
        if name not in graph.parameters:
            raise ParameterError(f"There is no parameter '{name}'. There are: {', '.join(graph.parameters)}.")
        owner, _, parameter = name.rpartition(".")
        component = next(part.component for part in graph.parts if part.name == owner)
        _finite(name, value)
        if parameter in component.declared:
            _, objection = component.declared[parameter].magnitude(value)
            if objection:
                raise ParameterError(f"{name} {objection}.")
            component.changed(**{parameter: value})  # which looks at it beside the others
    return parameters


def _time(equations: Equations, values: Mapping[Symbol, Rational], at: Values | None) -> float:
    """A time in s after which no law switches any more; at rest, where parts change their mode, none has yet."""
    if any(part.modes for part in equations.form.graph.parts) and at is None:
        return 0.0
    kinds = (Kind.LAW, Kind.ACROSS_SOURCE, Kind.THROUGH_SOURCE)
    branches = (branch for branch in equations.form.graph.branches if branch.template.kind in kinds)
    laws = (equations.assembly.quantities.law(branch.index) for branch in branches)
    return max((0.0, *(time for law in laws for time in breakpoints(law, values)))) + 1.0


class _Point:
    """Speeds and other quantities at a point, by the symbols that laws read.

    Raises:
        ParameterError: there is no such quantity, or it is a product of others.
    """

    def __init__(self, equations: Equations, at: Values) -> None:
        names, quantities = Names(equations.form), equations.assembly.quantities
        states = {state.name for state in equations.form.states}
        self._nodes, self._others = {GROUND: Rational(0)}, dict[Symbol, Rational]()
        if not isinstance(at, Mapping):
            raise ParameterError(f"at = {at!r} must be values by name, as {{'J1.omega': 8.0}}.")
        for name, number in at.items():
            value = Rational(_finite(f"at: {name}", number))
            if name in names.signals and names.signals[name][1].kind == "across":
                part, signal = names.signals[name]
                plus, minus = map(part.node_at, signal.ends)
                sign, symbol = (signal.sign * quantities.across((plus, minus))).as_coeff_Mul()
                if minus == GROUND:
                    self._set(plus, signal.sign * value, name)
                elif symbol.is_Symbol:
                    self._others[symbol] = value / sign
            elif name in names.nodes:
                self._set(names.nodes[name], value, name)
            elif name not in {*names.units, *states}:
                raise ParameterError(f"at: {no_quantity(name, equations.form.graph.name, names.units)}")
            elif name.endswith((".power", ".energy")):
                raise ParameterError(f"at: '{name}' is a product of speeds and torques. Give these.")
            else:
                self._others[Symbol(name, real=True)] = value
        numbers = range(len(equations.form.graph.nodes))
        self._symbols = {quantities.node(number): (number, GROUND) for number in numbers}
        self._symbols |= {pair.symbol: ends for ends, pair in quantities.pairs.items()}

    def _set(self, node: int, value: Rational, name: str) -> None:
        if self._nodes.setdefault(node, value) != value:
            raise ParameterError(f"at: {name} contradicts another speed at the same node.")

    def value(self, symbol: Symbol) -> Rational | None:
        """What a law reads; None where the point does not tell it."""
        if symbol in self._others:
            return self._others[symbol]
        if symbol not in self._symbols:
            return None
        plus, minus = (self._nodes.get(number) for number in self._symbols[symbol])
        return None if plus is None or minus is None else plus - minus
