"""What the laws of a part read that they may not, first as given, then in the branches that they end in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import sympy
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, HISTORY, INTEGRAL
from shaftwork.components.laws import SYMBOLS, t
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.components.tables import Interpolation, InterpolationSlope, Table
from shaftwork.network.changing import StoreFaultError
from shaftwork.network.controlled import check_readings
from shaftwork.network.declared import check_declared
from shaftwork.network.grammar import FUNCTION_NAMES, FUNCTIONS
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate, make_template, substitution

_READS: Mapping[Kind, frozenset[sympy.Symbol]] = {
    Kind.ACROSS_SOURCE: frozenset({t}),
    Kind.THROUGH_SOURCE: frozenset({t}),
    Kind.LAW: frozenset({t, ACROSS, INTEGRAL}),
}
"""What the laws of a kind may depend on besides parameters; those not listed depend on parameters alone."""

_EVALUATED = (
    *(function.make for function in FUNCTIONS.values() if isinstance(function.make, type)),
    *(sympy.Symbol, sympy.Number, sympy.NumberSymbol, sympy.Add, sympy.Mul, sympy.Pow, sympy.Piecewise, ExprCondPair),
    *(Table, Interpolation, InterpolationSlope, Relational, BooleanFunction, BooleanAtom),
)
"""The nodes of expressions that every engine can evaluate."""


_MOVING = frozenset((t, ACROSS, INTEGRAL, *SYMBOLS))
"""What changes during a motion."""


class Fault(NamedTuple):
    """What is wrong with the law given for a parameter."""

    parameter: str
    what: str
    hint: str


def instead_of(value: Any) -> str:
    """What to give in place of what is no law."""
    if isinstance(value, sympy.logic.boolalg.Boolean):
        return "Give a formula: omega - 3 in place of omega > 3, or Piecewise((1, omega > 3), (0, True))."
    return "Give a number, a Table or a formula."


def law_faults(part: Component, values: Mapping[str, Any]) -> Iterator[Fault]:
    """What the laws of a part read that they may not, first as given, then in the branches that they end in."""
    laws = {name: value for name, value in values.items() if isinstance(value, sympy.Expr)}
    faults = tuple(fault for name, law in laws.items() if (fault := _fault_of_law(part, name, law)))
    yield from faults
    sound = {**values, **dict.fromkeys((fault.parameter for fault in faults), 1.0)}
    try:
        made = make_template(part, sound)
    except StoreFaultError as error:
        moving = [name for name, law in laws.items() if law.free_symbols]
        yield Fault(moving[0] if len(moving) == 1 else "", str(error), error.hint)
        return
    templates = made.branches
    _check_ends(part, templates)
    check_readings(part, templates)
    check_declared(part, made)
    for template in {(x.kind, x.law, x.terms, x.through, x.stored): x for x in templates}.values():
        if unreadable := _unreadable("", template.law) or _unreadable("", template.stored):
            yield unreadable._replace(what=f"a branch law {unreadable.what}")
        elif not (strange := _strange_symbols(template)):
            continue
        elif template.kind is Kind.ACROSS_SOURCE and strange <= {ACROSS, INTEGRAL}:
            for name in (name for name, law in laws.items() if law.free_symbols - {t}):
                read = ", ".join(sorted(symbol.name for symbol in laws[name].free_symbols - {t}))
                hint = (
                    "A source that prescribes it must know it: write the law in t, or use a source of torque or force."
                )
                yield Fault(name, f"reads {read}, but may depend on time t alone", hint)
        else:
            yield Fault("", f"a branch law depends on {min(map(str, strange))}", "Use p.name, ACROSS, INTEGRAL and t.")


def _fault_of_law(part: Component, name: str, law: sympy.Expr) -> Fault | None:
    if law.has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo, sympy.I):
        return Fault(
            name, f"= {str(law)[:60]} is not a finite real law", "Remove what is infinite, undefined or imaginary."
        )
    if unreadable := _unreadable(name, law):
        return unreadable
    readable = (t, *substitution(part))
    strange = sorted(law.free_symbols - set(readable), key=str)
    if not strange:
        return None
    symbol, able = strange[0], f"this part can read {', '.join(str(symbol) for symbol in readable)}"
    if symbol in SYMBOLS:
        return Fault(name, f"reads {symbol}, which belongs to another domain", f"Note that {able}.")
    if symbol.name in {known.name for known in SYMBOLS}:
        what = f"contains a symbol {symbol} of your own, which is not Shaftwork's"
        return Fault(name, what, f"Take the symbols from the package (shaftwork.{symbol}); {able}.")
    return Fault(name, f"contains the symbol {symbol}, which has no value", f"Put its number in; {able}.")


def _unreadable(name: str, law: sympy.Expr) -> Fault | None:
    """The first thing in an expression that no engine can evaluate."""
    for node in sympy.preorder_traversal(law):
        if isinstance(node, sympy.Piecewise) and node.args[-1].cond != sympy.true:
            what = f"has {str(node)[:60]}, without a value where no condition holds"
            return Fault(name, what, "End it with (value, True).")
        if not isinstance(node, _EVALUATED):
            hint = f"Take sums, products, powers and: {FUNCTION_NAMES}."
            return Fault(name, f"contains the unknown function {node.func.__name__}", hint)
        if isinstance(node, HeldNoise | SmoothNoise) and not _MOVING.isdisjoint(node.args[1].free_symbols):
            what = f"has a noise whose seed, {str(node.args[1])[:40]}, changes during the motion"
            return Fault(name, what, "Give it a number: other numbers give independent noise.")
    return None


def _strange_symbols(template: BranchTemplate) -> set[sympy.Symbol]:
    factors = (*(coefficient for coefficient, _, _ in template.terms), *template.through)
    found = template.law.free_symbols.union(*(factor.free_symbols for factor in factors))
    found -= {HISTORY} if template.is_history else set()
    found -= {*template.reads} if template.kind in (Kind.LAW, Kind.ACROSS_SOURCE) else set()
    return set(found - {*template.symbols} - _READS.get(template.kind, frozenset()))


def _check_ends(part: Component, templates: tuple[BranchTemplate, ...]) -> None:
    ports = {None, *(port.name for port in (*part.ports, *part.inner_ports()))}
    couplings = (ends for template in templates for _, *ends in template.terms)
    ends = [end for pair in (*(template.ends for template in templates), *couplings) for end in pair]
    if strange := [end for end in ends if end not in ports]:
        raise ValueError(f"a branch ends at {strange[0]!r}, which is no port")
