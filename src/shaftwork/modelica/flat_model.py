"""The equations of a network as one Modelica model: parameters, states with start values, rates, quantities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sympy import Expr, Symbol

from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import omega, phi, s, v
from shaftwork.components.sources import ForceSource, TorqueSource
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import CompileError
from shaftwork.formulation.coupled_blocks import CoupledBlock, blocks_in
from shaftwork.formulation.explicit_rows import BlockTooLargeError, Rows, explicit_rows
from shaftwork.formulation.form import Names, StateForm
from shaftwork.formulation.observables import Observables
from shaftwork.modelica.component_writer import experiment
from shaftwork.modelica.modelica_expressions import (
    Identifiers,
    ModelicaPrinter,
    functions_in,
    number,
    quoted,
    symbols_of,
    unit,
)
from shaftwork.network.graph import CircuitGraph, GraphPart, resolve
from shaftwork.network.netlist import Netlist, title

_COMPONENT_FORM = "The form 'component' has it."


def in_one_mode(netlist: Netlist, graph: CircuitGraph) -> Netlist:
    """The netlist with gaps that spring as sources of the torque that they give, which one law has in all modes.

    Raises:
        CompileError: other parts change their mode; names all of them.
    """
    changing = {part.name: part for part in graph.parts if part.modes}
    if rigid := [part for part in changing.values() if any(modes.law is None for modes in part.modes)]:
        names = ", ".join(title(part.component) for part in rigid)
        raise CompileError(
            f"'{netlist.name}' in one set of equations: {names} would change them during the motion. {_COMPONENT_FORM}"
        )
    return netlist.with_parts(lambda part: _as_source(changing[part.name]) if part.name in changing else part)


def _as_source(part: GraphPart) -> Component:
    """What gives its nodes the torque of a gap."""
    values = {Symbol(name, real=True): value for name, value in resolve(part.component)[0].items()}
    numbers = {symbol: value for symbol, value in values.items() if isinstance(value, float)}
    rotates = part.component.ports[0].domain is ROTATION
    (speed, twist) = (omega, phi) if rotates else (v, s)
    (law,) = (modes.law for modes in part.modes)
    torque = -law.xreplace({**numbers, ACROSS: speed, INTEGRAL: twist}) if law is not None else 0
    return TorqueSource(part.name, tau=torque) if rotates else ForceSource(part.name, f=torque)


def flat_text(form: StateForm, start: Mapping[str, float], t_end: float, turned: tuple[str, ...]) -> str:
    """The model of a network whose parts are in one mode each.

    Args:
        form: its state form.
        start: of each state by name.
        t_end: end of the experiment, s.
        turned: quantities that sources of `in_one_mode` show with the other sign.

    Raises:
        CompileError: a shaft is a travelling wave, laws determine each other, or a law has no counterpart.
    """
    graph = form.graph
    if form.waves:
        raise CompileError(f"'{graph.name}' in one set of equations: a shaft is a travelling wave. {_COMPONENT_FORM}")
    try:
        rows = explicit_rows(form, in_numbers=True)
    except BlockTooLargeError:
        raise CompileError(
            f"'{graph.name}' has no explicit equations in symbols: laws determine each other. {_COMPONENT_FORM}"
        ) from None
    lines, name = list(_Flat(form, rows, start, turned).lines(t_end)), Identifiers()[graph.name]
    head = "  // Written by Shaftwork, in SI units: parameters, states, quantities; then the rates of the states"
    text = "\n".join([f"model {name} {quoted(graph.name)}", head, *lines, f"end {name};", ""])
    return text.replace("\n", f"\n{functions_in(text)}", 1)


class _Flat:
    """The lines of a flat model."""

    def __init__(self, form: StateForm, rows: Rows, start: Mapping[str, float], turned: tuple[str, ...]) -> None:
        self._form, self._rows, self._start, self._turned = form, rows, start, turned
        self._names = Identifiers()
        self._parameters = {name: self._names[name] for name in form.graph.parameters}
        self._states = {state.name: self._names[state.name] for state in form.states}
        values = {Symbol(name, real=True): value for name, value in form.graph.parameters.items()}
        self._printer = ModelicaPrinter(
            symbols_of({**self._parameters, **self._states}), f"'{form.graph.name}'", values
        )

    def lines(self, t_end: float) -> Iterator[str]:
        """Declarations, equations and the experiment."""
        shown = dict(self._quantities())
        names = {name: self._names.unused(name) for name in shown}  # a parameter may have the same one
        shown = self._with_names(shown, names)
        yield from map(self._parameter, self._parameters)
        for state in self._form.states:
            start = number(self._start.get(state.name, 0.0))
            yield (
                f"  Real {self._states[state.name]}(start = {start}, fixed = true, "
                f'unit = "{unit(state.unit)}") {quoted(state.name)};'
            )
        units = Names(self._form).units
        for name in shown:
            yield f'  output Real {names[name]}(unit = "{unit(units[name])}") {quoted(name)};'
        systems = blocks_in((*self._rows.rates, *shown.values()))
        for system in systems:
            array = self._names.unused("solved")
            self._printer.names |= {unknown: f"{array}[{k}]" for k, unknown in enumerate(system.unknowns, 1)}
            yield f'  Real {array}[{len(system.right)}] "Speeds, torques or rates that determine each other";'
        yield "equation"
        for system in systems:
            yield from self._coupled(system)
        for state, rate in zip(self._form.states, self._rows.rates, strict=True):
            yield f"  der({self._states[state.name]}) = {self._printer.doprint(rate)};"
        for name, expression in shown.items():
            yield f"  {names[name]} = {self._printer.doprint(expression)};"
        yield f"  {experiment(t_end)}"

    def _coupled(self, system: CoupledBlock) -> Iterator[str]:
        for k, side in enumerate(system.right):
            row = (entry * system.unknowns[j] for (i, j), entry in system.matrix.items() if i == k)
            yield f"  {' + '.join(map(self._printer.doprint, row))} = {self._printer.doprint(side)};"

    def _with_names(self, shown: dict[str, Expr], names: Mapping[str, str]) -> dict[str, Expr]:
        """The quantities, and the rates in place, with the names of quantities where their laws would stand again."""
        laws = {
            expression: Symbol(names[name])
            for name, expression in shown.items()
            if expression.args and (-expression).args and not (expression.is_Add or expression.is_number)
        }
        self._printer.names |= {symbol: symbol.name for symbol in laws.values()}
        laws = {-expression: -symbol for expression, symbol in laws.items()} | laws
        self._rows = replace(self._rows, rates=tuple(rate.xreplace(laws) for rate in self._rows.rates))
        return {
            name: expression.func(*(arg.xreplace({**laws, -expression: -expression}) for arg in expression.args))
            if laws.get(expression) == Symbol(names[name])
            else expression.xreplace(laws)
            for name, expression in shown.items()
        }

    def _parameter(self, name: str) -> str:
        owner, _, parameter = name.rpartition(".")
        part = next(part for part in self._form.graph.parts if part.name == owner)
        declared = part.component.declared[parameter]
        value = number(self._form.graph.parameters[name])
        return (
            f'  parameter Real {self._parameters[name]}(unit = "{unit(declared.unit)}") = {value} '
            f"{quoted(f'{name}, {declared.meaning}')};"
        )

    def _quantities(self) -> Iterator[tuple[str, Expr]]:
        """What parts show, but for states and what needs the slope of a table."""
        observables = Observables(self._form, self._rows)
        for name in Names(self._form).signals:
            expression = observables.quantity(name)
            if name not in self._states and expression not in (None, Symbol(name, real=True)):
                yield name, -expression if name in self._turned else expression
