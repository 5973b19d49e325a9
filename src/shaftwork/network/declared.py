"""What a part says of itself, checked against its ports, branches and parameters: stores, signals, profiles, modes."""

from __future__ import annotations

from collections.abc import ItemsView, Mapping
from typing import Any

from shaftwork.components.base import Component, Port, Profile, Signal
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, End, named_in
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import ANEW, Modes
from shaftwork.core.domains import ROTATION
from shaftwork.core.parameters import is_label
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate, Template

_STORES = (Kind.ACROSS_STORE, Kind.THROUGH_STORE)


def check_declared(part: Component, template: Template) -> None:
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
    for made in (made for made in branches if made.kind in _STORES):
        domain = next((ports[end].domain for end in made.ends if end is not None), None) or ROTATION
        name = made.label or (domain.across if made.kind is Kind.ACROSS_STORE else domain.through).name
        if name in names:
            raise ValueError(f"two of its stores have the name {name!r}; give each branch a label of its own")
        names.add(name)


def _check_signals(part: Component, ports: Mapping[str, Port], branches: tuple[BranchTemplate, ...]) -> None:
    stores = {made.label for made in branches if made.kind is Kind.THROUGH_STORE}
    for name, signal in _records("signals", part.signals(), Signal):
        _check_ends(f"signal {name!r}", signal.ends, ports)
        if signal.kind in ("twist", "store") and stores and signal.label and signal.label not in stores:
            raise ValueError(f"its signal {name!r} is of a store {signal.label!r}, which it does not have")
    for name, profile in _records("profiles", part.profiles(), Profile):
        if profile.length not in part.declared:
            raise ValueError(f"its profile {name!r} has the length {profile.length!r}, which is no parameter")


def _check_modes(part: Component, ports: Mapping[str, Port], template: Template, element: Modes) -> None:
    _check_ends("element with modes", element.ends or (), ports)
    readable = {str(symbol.name) for symbol in (ACROSS, THROUGH, INTEGRAL, TIME)}
    readable |= {*part.declared, *(made.name for made in template.derived), *template.parameters}
    readable |= {made.symbol for made in template.modes}
    names = [mode.name for mode in element.options]
    for leave in (leave for mode in element.options for leave in mode.leaves):
        if leave.to not in (*names, ANEW):
            raise ValueError(f"a mode leads to {leave.to!r}, which is none of: {', '.join(names)}")
        strange = {symbol.name for symbol in leave.when.free_symbols if not named_in(symbol)[0]} - readable
        if strange:
            raise ValueError(f"what ends a mode reads {min(strange)}; it can read {', '.join(sorted(readable))}")


def _check_ends(what: str, ends: tuple[End, ...], ports: Mapping[str, Port]) -> None:
    if strange := [end for end in ends if end is not None and end not in ports]:
        raise ValueError(f"its {what} is of {strange[0]!r}, which is no port")


def _records(what: str, made: Any, kind: type) -> ItemsView[str, Any]:
    """The pairs of a mapping from names to records of a kind."""
    if not isinstance(made, Mapping):
        raise TypeError(f"{what}() gives {made!r}, not names with a {kind.__name__} each")
    for name, record in made.items():
        if not is_label(name) or not isinstance(record, kind):
            raise TypeError(f"{what}() has {name!r}: {record!r}, not a name without dots with a {kind.__name__}")
    return made.items()
