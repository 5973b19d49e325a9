"""The drive train that a circuit is the force-current analogue of."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

from sympy import Expr, Symbol

from shaftwork.analogues.images import PREFIX
from shaftwork.components.base import REGISTRY, Component
from shaftwork.components.electrical import DCMachine, Inductor, Resistor, Transformer
from shaftwork.components.friction import Freewheel
from shaftwork.components.laws import i, psi, q, u
from shaftwork.components.mechanics import (
    Damper,
    Drum,
    Gear,
    Ground,
    Inertia,
    Mass,
    Spring,
    TranslationalDamper,
    TranslationalSpring,
)
from shaftwork.components.sources import ForceSource, SpeedSource, TorqueSource
from shaftwork.core.domains import ELECTRICAL, ROTATION, TRANSLATION, Domain
from shaftwork.core.errors import Diagnostic, NetworkError
from shaftwork.network.graph import resolve
from shaftwork.network.netlist import REFERENCE, Netlist, Placed, listed, title


class _NoMechanicalPartError(Exception):
    """Why a part has no mechanical counterpart, and the next step."""

    def __init__(self, why: str, hint: str) -> None:
        super().__init__(why)
        self.hint = hint


def mechanical(netlist: Netlist, domains: Mapping[str, Domain]) -> Netlist:
    """The parts of a drive train in place of those of a circuit.

    Args:
        netlist: of the circuit.
        domains: of nodes that do not rotate.

    Raises:
        NetworkError: parts have no counterpart; names all of them.
    """
    placed: list[Placed] = []
    problems: list[Diagnostic] = []
    for item in netlist.placed:
        try:
            placed += _counterparts(item, domains)
        except _NoMechanicalPartError as error:
            message = f"{title(item.part)} {error}."
            problems.append(Diagnostic("no mechanical part", message, error.hint, (item.part.name,), item.nodes))
    if problems:
        raise NetworkError(f"'{netlist.name}' has no mechanical analogue", tuple(problems))
    parts = tuple(_with_armatures([*_joined(placed)]))
    return dataclasses.replace(netlist, name=netlist.name.removeprefix("circuit of "), placed=parts)


def _counterparts(item: Placed, domains: Mapping[str, Domain]) -> Iterator[Placed]:
    part, nodes = item.part, item.nodes
    kind = type(part).__name__
    moving = {domains.get(node, ROTATION) for node in nodes if node != REFERENCE}
    if isinstance(part, Transformer):
        yield _coupling(part, nodes, domains)
    elif moving == {ELECTRICAL} or isinstance(part, Ground):
        yield item
    elif kind.startswith(PREFIX) and kind.removeprefix(PREFIX) in REGISTRY:
        original = REGISTRY[kind.removeprefix(PREFIX)]
        domain = next((port.domain for port in original.ports if port.domain not in (None, ELECTRICAL)), ROTATION)
        values = {name: _in_domain(value, domain) for name, value in part.values.items()}
        yield dataclasses.replace(item, part=original(part.name, symbol=part.symbol, **values))
    elif len(moving) > 1:
        names = listed(nodes)
        raise _NoMechanicalPartError(f"joins nodes {names} of several domains", "Put a Transformer between them.")
    else:
        domain = moving.pop() if moving else ROTATION
        made, places = _element(part, nodes, domain)
        yield Placed(made, places)


def _element(part: Any, nodes: tuple[str, ...], domain: Domain) -> tuple[Component, tuple[str, ...]]:
    """The part that rotates or translates in place of one of a circuit, and its nodes."""
    rotates, name, symbol = domain is ROTATION, part.name, part.symbol
    value = resolve(part)[0].get(_VALUE.get(type(part).__name__, ""))
    match type(part).__name__:
        case "Capacitor":
            free = tuple(node for node in nodes if node != REFERENCE)
            if len(free) != 1:
                why = f"stands between nodes {listed(nodes)}, and an inertia has one node: it is against the frame"
                raise _NoMechanicalPartError(why, f"Join one of its ends to '{REFERENCE}'.")
            return (Inertia(name, symbol=symbol, J=value) if rotates else Mass(name, symbol=symbol, m=value)), free
        case "Inductor" if value:
            return (Spring if rotates else TranslationalSpring)(name, symbol=symbol, c=1 / value), nodes
        case "Resistor" if value:
            return (Damper if rotates else TranslationalDamper)(name, symbol=symbol, d=1 / value), _free(nodes)
        case "Resistor" | "Inductor" if rotates:
            joint = Ground(name) if REFERENCE in nodes else Gear(name, ratio=1.0)
            return joint, tuple(node for node in nodes if node != REFERENCE)
        case "CurrentSource":
            law = _in_domain(value, domain)
            made = TorqueSource(name, symbol=symbol, tau=law) if rotates else ForceSource(name, symbol=symbol, f=law)
            return made, _free(nodes)
        case "VoltageSource" if isinstance(value, Expr) and value.has(i, q):
            why = "prescribes its voltage by its own current, and no source of speed reads its torque"
            raise _NoMechanicalPartError(why, "Where the circuit is a dual, take the network that it is the dual of.")
        case "VoltageSource" if rotates:
            return SpeedSource(name, symbol=symbol, omega=_in_domain(value, domain)), _free(nodes)
        case "Diode" if rotates:
            return Freewheel(name, symbol=symbol), nodes
    raise _NoMechanicalPartError(
        f"has no counterpart that is {'rotating' if rotates else 'translating'}",
        f"Take another at nodes {listed(nodes)}: {', '.join(_VALUE)}, Transformer and Diode have one that rotates.",
    )


_VALUE: Mapping[str, str] = MappingProxyType(
    {"Capacitor": "C", "Inductor": "L", "Resistor": "R", "CurrentSource": "i", "VoltageSource": "u"}
)
"""The parameter of each part of a circuit that has one."""


def _free(nodes: tuple[str, ...]) -> tuple[str, ...]:
    """The nodes without a reference at the end, which may be left out."""
    return nodes[:-1] if nodes[-1] == REFERENCE else nodes


def _coupling(part: Transformer, nodes: tuple[str, ...], domains: Mapping[str, Domain]) -> Placed:
    """A gear, drum or machine in place of a transformer."""
    first, first_foot, second, second_foot = nodes
    sides = domains.get(first, ROTATION), domains.get(second, ROTATION)
    name, symbol, ratio = part.name, part.symbol, float(resolve(part)[0]["ratio"])
    if sides == (ELECTRICAL, ELECTRICAL):
        return Placed(part, nodes)
    if sides == (ELECTRICAL, ROTATION) and second_foot == REFERENCE:
        return Placed(DCMachine(name, symbol=symbol, k=ratio), (first, first_foot, second))
    if first_foot == second_foot == REFERENCE:
        if sides == (ROTATION, ROTATION):
            return Placed(Gear(name, symbol=symbol, ratio=ratio), (first, second))
        if sides == (ROTATION, TRANSLATION):
            return Placed(Drum(name, symbol=symbol, radius=1 / ratio), (first, second))
        if sides == (TRANSLATION, ROTATION):
            return Placed(Drum(name, symbol=symbol, radius=ratio), (second, first))
    raise _NoMechanicalPartError(
        f"joins nodes {listed(nodes)}, which no gear, drum or machine does",
        f"Join n1 and n2 to '{REFERENCE}', or tell the domains of its nodes.",
    )


def _in_domain(value: Any, domain: Domain) -> Any:
    """A law of a circuit in quantities of a domain."""
    names = {u: domain.across.name, psi: domain.integral.name}
    if not isinstance(value, Expr):
        return value
    return value.xreplace({symbol: Symbol(name, real=True) for symbol, name in names.items()})


def _joined(placed: list[Placed]) -> Iterator[Placed]:
    """The parts, where a damper beside a spring that has its name and "d" is the damping of that."""
    dampers = {item.part.name: item for item in placed if isinstance(item.part, Damper | TranslationalDamper)}
    inside: dict[str, Placed] = {}
    for item in placed:
        beside = dampers.get(f"{item.part.name} d")
        is_spring = isinstance(item.part, Spring | TranslationalSpring)
        if is_spring and beside is not None and _free(beside.nodes) == _free(item.nodes):
            inside[beside.part.name] = beside
    for item in placed:
        if (beside := inside.get(f"{item.part.name} d")) is not None and item.part.name not in inside:
            yield dataclasses.replace(item, part=item.part.changed(d=beside.part.values["d"]))
        elif item.part.name not in inside:
            yield item


def _with_armatures(placed: list[Placed]) -> Iterator[Placed]:
    """The parts, where a resistor and a coil that begin with the name of the machine behind them are its armature."""
    inside: dict[str, None] = {}

    def with_armature(machine: Placed) -> Placed:
        node, name = machine.nodes[0], f"{machine.part.name} "
        there = [one for one in placed if node in one.nodes and one.part.name not in (machine.part.name, *inside)]
        if len(there) != 1 or not isinstance(element := there[0].part, Resistor | Inductor):
            return machine
        letter = "L" if isinstance(element, Inductor) else "R"
        if there[0].nodes[1] != node or not element.name.startswith(name) or machine.part.values[letter]:
            return machine
        inside[element.name] = None
        part = machine.part.changed(**{letter: element.values[letter]})
        return with_armature(dataclasses.replace(machine, part=part, nodes=(there[0].nodes[0], *machine.nodes[1:])))

    machines = [with_armature(item) if isinstance(item.part, DCMachine) else item for item in placed]
    return (item for item in machines if item.part.name not in inside)
