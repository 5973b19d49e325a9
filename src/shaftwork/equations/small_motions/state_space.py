"""The state equations about a point as matrices of parameters' symbols."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sympy import Dummy, Expr, ImmutableMatrix, Integer, Symbol, cancel

from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError, SignalError, no_quantity
from shaftwork.equations.small_motions.point_slopes import LawSlopes, Slope
from shaftwork.equations.small_motions.tableau import linear_form, with_laws
from shaftwork.formulation.explicit_rows import BlockTooLargeError, explicit_rows
from shaftwork.formulation.form import Names, StateForm
from shaftwork.formulation.observables import Observables
from shaftwork.formulation.source_inputs import places_of, source_inputs, with_inputs

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations


@dataclass(frozen=True, eq=False)
class StateSpace:
    """Small motions about a point in symbols.

    Law: z' = A z + B v,  y = C z + D v + D1 v', with z = x - B1 v of the states x, as of `LinearModel`.

    Args:
        states: n names.
        inputs: m names.
        outputs: k names.
        A: (n, n).
        B: (n, m).
        C: (k, n).
        D: (k, m).
        B1: (n, m); zero unless a derivative of an input acts on a state.
        D1: (k, m); zero unless one acts on an output.
        slopes: what the letters of slopes of laws stand for.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: ImmutableMatrix
    B: ImmutableMatrix
    C: ImmutableMatrix
    D: ImmutableMatrix
    B1: ImmutableMatrix
    D1: ImmutableMatrix
    slopes: Mapping[Symbol, Slope]


def state_space(
    equations: Equations, inputs: str | Sequence[str] | None, outputs: str | Sequence[str] | None
) -> StateSpace:
    """The matrices.

    Args:
        equations: of the network.
        inputs: names; None for all sources.
        outputs: names; None for the states.

    Raises:
        SignalError: there is no such input or quantity.
        CompileError: a shaft is a travelling wave, or more rates are coupled than are solved in symbols.
    """
    named = source_inputs(equations.form.graph) if inputs is None else _listed(inputs)
    slopes = LawSlopes(equations.assembly.quantities)
    places = places_of(equations.form.graph, named)
    form, branches = with_inputs(linear_form(equations, slopes), places)
    values = [(Dummy(real=True), Dummy(real=True)) for _ in places]
    laws = {
        branch: place.signal.sign * (value + TIME * rate)
        for branch, place, (value, rate) in zip(branches, places, values, strict=True)
    }
    form = with_laws(form, laws)
    try:
        rows = explicit_rows(form)
    except BlockTooLargeError:
        raise CompileError(
            f"Of '{form.graph.name}' more rates are coupled than are solved in symbols. Take transfer_function, which "
            "solves any, or compile().linearize() for numbers."
        ) from None
    wanted = tuple(state.name for state in form.states) if outputs is None else _listed(outputs)
    read = Observables(form, rows)
    groups = rows.states, [value for value, _ in values], [rate for _, rate in values]
    A, B, B1 = (_slopes(rows.rates, group) for group in groups)
    C, D, D1 = (_slopes([_quantity(form, read, name) for name in wanted], group) for group in groups)
    states = tuple(state.name for state in form.states)
    B, D = ((whole + by @ B1).applyfunc(cancel) for whole, by in ((B, A), (D, C)))
    return StateSpace(states, named, wanted, A, B, C, D, B1, D1, dict(slopes.letters))


def _listed(names: str | Sequence[str]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _quantity(form: StateForm, read: Observables, name: str) -> Expr:
    """A quantity in states, inputs and their rates.

    Raises:
        SignalError: there is none of this name, or it is no sum of states.
    """
    names = Names(form)
    quantity = Symbol(name, real=True) if any(state.name == name for state in form.states) else read.quantity(name)
    if quantity is None:
        if name in names.units:
            raise SignalError(f"'{name}' is a product of speeds and torques, and no sum of states.")
        raise no_quantity(name, form.graph.name, names.units)
    return quantity


def _slopes(rows: Sequence[Expr], by: Sequence[Symbol]) -> ImmutableMatrix:
    at_once = [row.xreplace({TIME: Integer(0)}) for row in rows]
    return ImmutableMatrix(len(rows), len(by), [cancel(row.diff(symbol)) for row in at_once for symbol in by])
