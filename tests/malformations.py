"""Well-posed networks, each broken in one way: what the library must refuse in its own words."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

from hypothesis import strategies as st

from tests.reference.mna import GROUND, Piece
from tests.strategies import Network, networks

Breaker = Callable[[Network, int], Network]


def _with_value(net: Network, index: int, value: Any) -> Network:
    """Another value for one parameter; sources and laws may be negative or zero, so only parts with bounds count."""
    bounded = ("Inertia", "Mass", "Spring", "Gear", "Damper", "Drum", "Wheel", "Resistor", "Inductor", "Capacitor")
    places = [(k, key) for k, p in enumerate(net) if p.type in bounded for key in p.values]
    k, key = places[index % len(places)]
    return _replace(net, k, values={**net[k].values, key: value})


def _replace(net: Network, k: int, **changes: Any) -> Network:
    old = net[k]
    fields = {"type": old.type, "name": old.name, "nodes": old.nodes, "values": old.values} | changes
    return (*net[:k], Piece(**fields), *net[k + 1 :])


def _rotor(net: Network, index: int) -> str:
    rotors = [p.nodes[0] for p in net if p.type == "Inertia"]
    return rotors[index % len(rotors)]


def _plus(*pieces: Callable[[str], Piece]) -> Breaker:
    """The network with further parts, made for one of its rotors."""
    return lambda net, index: (*net, *(piece(_rotor(net, index)) for piece in pieces))


def _part(kind: str, name: str, *nodes: str, **values: Any) -> Callable[[str], Piece]:
    """A part; the node ``at`` stands for the rotor."""
    return lambda rotor: Piece(kind, name, tuple(rotor if n == "at" else n for n in nodes), values)


def _nodes_of_many(net: Network, index: int, change: Callable[[tuple[str, ...]], tuple[str, ...]]) -> Network:
    places = [k for k, p in enumerate(net) if len(p.nodes) > 1]
    k = places[index % len(places)]
    return _replace(net, k, nodes=change(net[k].nodes))


def _duplicate_name(net: Network, index: int) -> Network:
    k = 1 + index % (len(net) - 1)
    return _replace(net, k, name=net[0].name)


def _missing_parameter(net: Network, index: int) -> Network:
    key = {"Inertia": "J", "Gear": "ratio", "Spring": "c", "Resistor": "R", "TorqueSource": "tau"}
    places = [k for k, p in enumerate(net) if p.type in key]
    k = places[index % len(places)]
    return _replace(net, k, values={n: v for n, v in net[k].values.items() if n != key[net[k].type]})


def _unknown_parameter(net: Network, index: int) -> Network:
    k = index % len(net)
    return _replace(net, k, values={**net[k].values, "stiffnes": 1.0})


BREAKERS: dict[str, Breaker] = {
    "dangling_end": _plus(_part("Spring", "loose", "at", "nowhere", c=100.0)),
    "floating_part": _plus(_part("Spring", "adrift", "island_a", "island_b", c=100.0, d=1.0)),
    "floating_circuit": _plus(
        _part("Resistor", "adrift", "f1", "f2", R=1.0), _part("Inductor", "adrift_too", "f1", "f2", L=1.0)
    ),
    "contradictory_speeds": _plus(
        _part("SpeedSource", "first_speed", "at", omega=1.0), _part("SpeedSource", "second_speed", "at", omega=2.0)
    ),
    "contradictory_speeds_through_a_gear": _plus(
        _part("SpeedSource", "first_speed", "at", omega=1.0),
        _part("Gear", "between", "at", "output", ratio=2.0),
        _part("SpeedSource", "second_speed", "output", omega=2.0),
    ),
    "speed_against_ground": _plus(_part("SpeedSource", "speed", "at", omega=1.0), _part("Ground", "wall", "at")),
    "speed_against_a_locked_gear_loop": _plus(
        _part("Gear", "fast", "at", "output", ratio=2.0),
        _part("Gear", "slow", "at", "output", ratio=3.0),
        _part("SpeedSource", "speed", "at", omega=1.0),
    ),
    "locked_gear_loop": _plus(
        _part("Gear", "fast", "at", "output", ratio=2.0), _part("Gear", "slow", "at", "output", ratio=3.0)
    ),
    "torque_on_a_massless_node": _plus(_part("TorqueSource", "torque", "alone", tau=1.0)),
    "torque_on_a_massless_gear": _plus(
        _part("Gear", "between", "alone", "output", ratio=2.0), _part("TorqueSource", "torque", "output", tau=1.0)
    ),
    "contradictory_voltages": _plus(
        _part("VoltageSource", "u1", "f1", GROUND, u=1.0),
        _part("VoltageSource", "u2", "f1", GROUND, u=2.0),
        _part("Resistor", "load", "f1", GROUND, R=1.0),
    ),
    "current_into_an_open_node": _plus(_part("CurrentSource", "i", "f1", GROUND, i=1.0)),
    "shorted_voltage": _plus(_part("VoltageSource", "u", GROUND, GROUND, u=1.0)),
    "duplicate_name": _duplicate_name,
    "missing_node": lambda net, index: _nodes_of_many(net, index, lambda nodes: nodes[:-1]),
    "too_many_nodes": lambda net, index: _nodes_of_many(net, index, lambda nodes: (*nodes, "one_more")),
    "empty_node_name": lambda net, index: _nodes_of_many(net, index, lambda nodes: (*nodes[:-1], "")),
    "both_ends_on_one_node": lambda net, index: _nodes_of_many(net, index, lambda nodes: nodes[:1] * len(nodes)),
    "wrong_domain": _plus(_part("Resistor", "stray", "at", GROUND, R=1.0)),
    "negative_parameter": lambda net, index: _with_value(net, index, -1.0),
    "nan_parameter": lambda net, index: _with_value(net, index, nan),
    "infinite_parameter": lambda net, index: _with_value(net, index, inf),
    "text_parameter": lambda net, index: _with_value(net, index, "heavy"),
    "no_parameter_value": lambda net, index: _with_value(net, index, None),
    "complex_parameter": lambda net, index: _with_value(net, index, 1j),
    "list_parameter": lambda net, index: _with_value(net, index, [1.0, 2.0]),
    "zero_ratio": _plus(_part("Gear", "flat", "at", "output", ratio=0.0), _part("Inertia", "end", "output", J=1.0)),
    "zero_radius": _plus(_part("Drum", "flat", "at", "rope", radius=0.0), _part("Mass", "end", "rope", m=1.0)),
    "missing_parameter": _missing_parameter,
    "unknown_parameter": _unknown_parameter,
    "empty_network": lambda _net, _index: (),
}


@st.composite
def malformed_networks(draw: st.DrawFn, max_inertias: int = 6) -> tuple[Network, str]:
    """A network broken in one way, and the name of the way (a key of ``BREAKERS``)."""
    net = draw(networks(max_inertias=max_inertias))
    kind = draw(st.sampled_from(tuple(BREAKERS)))
    return BREAKERS[kind](net, draw(st.integers(0, 63))), kind
