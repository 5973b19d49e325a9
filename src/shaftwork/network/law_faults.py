"""What is wrong with the laws of a part, and with what it says of itself: ports, stores, signals, profiles, modes."""

from __future__ import annotations

from collections.abc import ItemsView, Iterator, Mapping
from typing import Any, NamedTuple

import sympy
from sympy.core.relational import Relational
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from shaftwork.components.base import Component, Port, Profile, Signal
from shaftwork.components.branches import ACROSS, HISTORY, INTEGRAL, THROUGH, End, named_in
from shaftwork.components.external import External, Handle
from shaftwork.components.laws import SYMBOLS, t
from shaftwork.components.modes import ANEW, Modes
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.components.tables import Interpolation, InterpolationSlope, Table
from shaftwork.core.domains import ROTATION
from shaftwork.core.parameters import is_label
from shaftwork.network.grammar import FUNCTION_NAMES, FUNCTIONS
from shaftwork.network.graph import check_readings
from shaftwork.network.kinds import Kind, StoreFaultError
from shaftwork.network.templates import BranchTemplate, Template, make_template, substitution

_READS: Mapping[Kind, frozenset[sympy.Symbol]] = {
    Kind.ACROSS_SOURCE: frozenset({t}),
    Kind.THROUGH_SOURCE: frozenset({t}),
    Kind.LAW: frozenset({t, ACROSS, INTEGRAL}),
}
"""What the laws of a kind may depend on besides parameters; those not listed depend on parameters alone."""

_EVALUATED = (
    *(function.make for function in FUNCTIONS.values() if isinstance(function.make, type)),
    *(sympy.Symbol, sympy.Number, sympy.NumberSymbol, sympy.Add, sympy.Mul, sympy.Pow, sympy.Piecewise, ExprCondPair),
    *(Table, Interpolation, InterpolationSlope, Relational, BooleanFunction, BooleanAtom, External, Handle),
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
        part_template = make_template(part, sound)
    except StoreFaultError as error:
        moving = [name for name, law in laws.items() if law.free_symbols]
        yield Fault(moving[0] if len(moving) == 1 else "", str(error), error.hint)
        return
    templates = part_template.branches
    _check_branch_ends(part, templates)
    check_readings(part, templates)
    _check_declared(part, part_template)
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
    if symbol.name in {other.name for other in SYMBOLS}:
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
    symbols = template.law.free_symbols.union(*(factor.free_symbols for factor in factors))
    symbols -= {HISTORY} if template.is_history else set()
    symbols -= {*template.reads} if template.kind in (Kind.LAW, Kind.ACROSS_SOURCE) else set()
    return set(symbols - {*template.symbols} - _READS.get(template.kind, frozenset()))


def _check_declared(part: Component, template: Template) -> None:
    """That a part's stores can be told apart, and that its signals, profiles and modes are of what it has.

    Raises:
        TypeError, ValueError: one is not; says which.
    """
    inner: Any = part.inner_ports()
    if not isinstance(inner, tuple) or not all(isinstance(port, Port) for port in inner):
        raise TypeError(f"inner_ports() gives {inner!r}, not a tuple such as (Port('middle'),)")
    ports = {port.name: port for port in (*part.ports, *inner)}
    _check_stores(ports, template.branches)
    _check_signals(part, ports, template.branches)
    for element in template.modes:
        _check_modes(part, ports, template, element)


def _check_stores(ports: Mapping[str, Port], branches: tuple[BranchTemplate, ...]) -> None:
    """No two stores of a part have one name: it is that of a state."""
    names: set[str] = set()  # only asked for membership
    for branch in (branch for branch in branches if branch.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE)):
        domain = next((ports[end].domain for end in branch.ends if end is not None), None) or ROTATION
        name = branch.label or (domain.across if branch.kind is Kind.ACROSS_STORE else domain.through).name
        if name in names:
            raise ValueError(f"two of its stores have the name {name!r}; give each branch a label of its own")
        names.add(name)


def _check_signals(part: Component, ports: Mapping[str, Port], branches: tuple[BranchTemplate, ...]) -> None:
    stores = {branch.label for branch in branches if branch.kind is Kind.THROUGH_STORE}
    for name, signal in _records("signals", part.signals(), Signal):
        _check_ends(f"signal {name!r}", signal.ends, ports)
        if signal.kind in ("twist", "store") and stores and signal.label and signal.label not in stores:
            raise ValueError(f"its signal {name!r} is of a store {signal.label!r}, which it does not have")
    for name, profile in _records("profiles", part.profiles(), Profile):
        if profile.length not in part.declared:
            raise ValueError(f"its profile {name!r} has the length {profile.length!r}, which is no parameter")


def _check_modes(part: Component, ports: Mapping[str, Port], template: Template, element: Modes) -> None:
    _check_ends("element with modes", element.ends or (), ports)
    readable = {str(symbol.name) for symbol in (ACROSS, THROUGH, INTEGRAL, t)}
    readable |= {*part.declared, *(item.name for item in template.derived), *template.parameters}
    readable |= {item.symbol for item in template.modes}
    names = [mode.name for mode in element.options]
    for leave in (leave for mode in element.options for leave in mode.leaves):
        if leave.to not in (*names, ANEW):
            raise ValueError(f"a mode leads to {leave.to!r}, which is none of: {', '.join(names)}")
        strange = {symbol.name for symbol in leave.when.free_symbols if not named_in(symbol)[0]} - readable
        if strange:
            raise ValueError(f"what ends a mode reads {min(strange)}; it can read {', '.join(sorted(readable))}")
    ends = {*(element.ends or (part.ports[0].name, part.ports[1].name if len(part.ports) > 1 else None))}
    joints = (branch.terms for branch in template.branches if branch.kind is Kind.COUPLING)
    if any(len(terms) == 1 and {*terms[0][1:]} == ends for terms in joints):
        raise ValueError(
            f"its first mode, {names[0]!r}, joins its ends rigidly, and the others are told from it; put one that does "
            "not first, with starts=sw.NEVER where no motion begins in it"
        )


def _check_ends(what: str, ends: tuple[End, ...], ports: Mapping[str, Port]) -> None:
    if strange := [end for end in ends if end is not None and end not in ports]:
        raise ValueError(f"its {what} is of {strange[0]!r}, which is no port")


def _records(what: str, records: Any, kind: type) -> ItemsView[str, Any]:
    """The pairs of a mapping from names to records of a kind."""
    if not isinstance(records, Mapping):
        raise TypeError(f"{what}() gives {records!r}, not names with a {kind.__name__} each")
    for name, record in records.items():
        if not is_label(name) or not isinstance(record, kind):
            raise TypeError(f"{what}() has {name!r}: {record!r}, not a name without dots with a {kind.__name__}")
    return records.items()


def _check_branch_ends(part: Component, templates: tuple[BranchTemplate, ...]) -> None:
    ports = {None, *(port.name for port in (*part.ports, *part.inner_ports()))}
    couplings = (ends for template in templates for _, *ends in template.terms)
    ends = [end for pair in (*(template.ends for template in templates), *couplings) for end in pair]
    if strange := [end for end in ends if end not in ports]:
        raise ValueError(f"a branch ends at {strange[0]!r}, which is no port")
