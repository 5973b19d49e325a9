"""Numbers for all symbols of the equations near a point: parameters, and slopes of laws there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sympy import Expr, Float, Integer, Rational, Symbol

from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError, no_quantity
from shaftwork.equations.quantities import is_rate
from shaftwork.equations.slopes import VARIED, Slope
from shaftwork.network.graph import GROUND, CircuitGraph
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import Names

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

DIGITS = 40
"""Decimal digits with which numbers that are no fractions, as pi, become fractions: far more than floats have."""
NEARBY, JUMP = 1e-9, 1e-6
"""A law jumps where it changes so near a point by more than this part of itself, beside what its slope tells."""

Values = Mapping[str, float]


def exact(expression: Expr) -> Expr:
    """Floats as the fractions that they are written as, 0.05 as 1/20, which is within their rounding."""
    return expression.xreplace({number: Rational(repr(float(number))) for number in expression.atoms(Float)})


def fraction(number: Expr) -> Rational:
    """A number as a fraction, to `DIGITS` digits where it is none."""
    return number if number.is_Rational else Rational(number.evalf(DIGITS))


class Numbers:
    """The values of all symbols.

    Raises:
        ParameterError: there is no such parameter or quantity.
    """

    def __init__(self, equations: Equations, parameters: Values | None, at: Values | None, t: float | None) -> None:
        graph = equations.form.graph
        values = {**graph.parameters, **_checked(graph, parameters or {})}
        self.known = {Symbol(name, real=True): Rational(float(value)) for name, value in values.items()}
        for symbol, law in equations.definitions.items():
            self.known[symbol] = fraction(exact(law).xreplace(self.known))
        time = _time(equations, self.known, at) if t is None else _finite("t", t)
        self._point, self._at_rest = _Point(equations, at or {}), at is None
        self._time = {TIME: Rational(time)}

    def add(self, slopes: Mapping[Symbol, Slope]) -> None:
        """The values of slopes of laws.

        Raises:
            ParameterError: one has no finite value at the point, or reads what the point does not name.
        """
        for letter, slope in slopes.items():
            laws = [slope.value, slope.by, *([] if slope.jumps is None else [slope.jumps])]
            read = set[Symbol]().union(*(law.free_symbols for law in laws)) - {*self.known, TIME, VARIED}
            known = {**self._time, **self.known}
            for symbol in sorted(read, key=str):
                value = self._point.value(symbol)
                if value is None and not (self._at_rest or is_rate(symbol)):
                    raise ParameterError(
                        f"at: the law of '{slope.part}' reads {symbol}, which is not given. Give it, 0.0 for rest."
                    )
                known[symbol] = Integer(0) if value is None else value
            found = slope.value.xreplace(known).evalf(DIGITS)
            if not (found.is_number and found.is_real and found.is_finite) or _jumps(slope, known, float(found)):
                raise ParameterError(
                    f"The law of '{slope.part}' has no finite slope at this point. Take another in at=."
                )
            self.known[letter] = Rational(found)


def _jumps(slope: Slope, known: Mapping[Symbol, Rational], value: float) -> bool:
    """Whether a law jumps at the point itself."""
    if slope.jumps is None:
        return False
    at = float(slope.by.xreplace(dict(known)))
    step = NEARBY * max(abs(at), 1.0)
    below, above = (float(slope.jumps.xreplace({**known, VARIED: Float(at + way)})) for way in (-step, step))
    return abs(above - below - 2 * step * value) > JUMP * max(abs(above), abs(below))


def _finite(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ParameterError(f"{name} = {value!r} is no finite number.")
    return number


def _checked(graph: CircuitGraph, given: Values) -> Values:
    """Values that parameters may have.

    Raises:
        ParameterError: there is no such parameter, or its part has an objection.
    """
    for name, value in given.items():
        if name not in graph.parameters:
            raise ParameterError(f"There is no parameter '{name}'. There are: {', '.join(graph.parameters)}.")
        owner, _, own = name.rpartition(".")
        component = next(part.component for part in graph.parts if part.name == owner)
        _finite(name, value)
        if own in component.declared:
            _, objection = component.declared[own].magnitude(value)
            if objection:
                raise ParameterError(f"{name} {objection}.")
            component.changed(**{own: value})  # which looks at it beside the others
    return given


def _time(equations: Equations, known: Mapping[Symbol, Rational], at: Values | None) -> float:
    """A time in s after which no law switches any more; at rest, where parts change their mode, none has yet."""
    if any(part.modes for part in equations.form.graph.parts) and at is None:
        return 0.0
    kinds = (Kind.LAW, Kind.ACROSS_SOURCE, Kind.THROUGH_SOURCE)
    branches = (branch for branch in equations.form.graph.branches if branch.template.kind in kinds)
    laws = (equations.assembly.quantities.law(branch.index) for branch in branches)
    return max((0.0, *(time for law in laws for time in breakpoints(law, known)))) + 1.0


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
        for name, given in at.items():
            value = Rational(_finite(f"at: {name}", given))
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
