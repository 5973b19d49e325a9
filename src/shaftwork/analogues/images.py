"""The electrical image of a class of parts: the same laws, modes and parameters between nodes of a circuit."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from sympy import Expr

from shaftwork.components.base import REGISTRY, Component, Port, Profile, Signal
from shaftwork.components.laws import omega, phi, psi, s, u, v
from shaftwork.core.domains import DOMAINS, ELECTRICAL
from shaftwork.core.errors import NetworkWarning
from shaftwork.core.notices import muted
from shaftwork.network.graph import resolve

PREFIX = "Electrical"
"""What the name of an image has before that of its class."""
IN_LAWS = {omega: u, v: u, phi: psi, s: psi}
"""What laws of a user read, and what they read in a circuit."""
IN_NAMES: Mapping[str, str] = MappingProxyType(
    {
        getattr(domain, kind).name: getattr(ELECTRICAL, kind).name
        for domain in DOMAINS
        for kind in ("across", "through", "integral")
    }
)
"""Quantities of all domains, and what they are in a circuit."""
IN_UNITS = {
    **dict.fromkeys(("N*m", "N"), "A"),
    **dict.fromkeys(("rad/s", "m/s"), "V"),
    **dict.fromkeys(("kg*m^2", "kg"), "F"),
    **dict.fromkeys(("N*m/rad", "N/m"), "1/H"),
    **dict.fromkeys(("N*m*s/rad", "N*s/m"), "S"),
    "rad": "V*s",
}
"""Units of parameters, and what they are in a circuit; others, such as lengths and shares, stay."""


SAME = {"Freewheel": "Diode"}
"""Classes whose image is a part of circuits that exists."""


def in_circuit(quantity: str) -> str:
    """The name of a quantity of a part or node in a circuit: u for omega, i_a for tau_a, psi for phi."""
    letter, *rest = quantity.split("_", 1)
    return "_".join((IN_NAMES.get(letter, letter), *rest))


def image_of(part: Component) -> Component:
    """A part with the laws of another one, between nodes of a circuit."""
    with muted(NetworkWarning):
        return image_class(type(part))(part.name, symbol=part.symbol, **image_values(part))


def image_values(part: Component) -> dict[str, Any]:
    """The values of a part in SI, with laws in quantities of a circuit."""
    values = resolve(part)[0]
    return {name: value.xreplace(IN_LAWS) if isinstance(value, Expr) else value for name, value in values.items()}


IMAGES: dict[type[Component], type[Component]] = {}
"""Images that have been made: one for each class."""


def image_class(kind: type[Component]) -> type[Component]:
    """The class of parts of a circuit that have the laws of a class; that itself where all its ports are electrical."""
    if kind not in IMAGES:
        IMAGES[kind] = _image_class(kind)
    return IMAGES[kind]


def _image_class(kind: type[Component]) -> type[Component]:
    if all(port.domain in (ELECTRICAL, None) for port in kind.ports):
        return kind
    if kind.__name__ in SAME:
        return REGISTRY[SAME[kind.__name__]]

    def inner_ports(self: Component) -> tuple[Port, ...]:
        return _moved(kind.inner_ports(self))

    def signals(self: Component) -> dict[str, Signal]:
        mechanical = kind.signals(self)
        renamed: dict[str, Signal] = {}
        for name, signal in mechanical.items():
            if signal.domain in (ELECTRICAL, None):
                renamed[name] = signal
                continue
            other = in_circuit(name)  # the current of a machine's rotor is not that of its winding
            renamed[f"{other}_{signal.ends[0]}" if other in mechanical else other] = dataclasses.replace(
                signal, domain=ELECTRICAL
            )
        return renamed

    def profiles(self: Component) -> dict[str, Profile]:
        items = kind.profiles(self).items()
        return {in_circuit(name): dataclasses.replace(profile, domain=ELECTRICAL) for name, profile in items}

    members = {
        "__doc__": f"What a {kind.__name__} is in a circuit. Law: that of a {kind.__name__}, of voltage and current.",
        "__module__": __name__,
        "ports": _moved(kind.ports),
        "inner": _moved(kind.inner),
        "declared": {name: _renamed(declared) for name, declared in kind.declared.items()},
        "inner_ports": inner_ports,
        "signals": signals,
        "profiles": profiles,
    }
    return type(PREFIX + kind.__name__, (kind,), members)


def _moved(ports: tuple[Port, ...]) -> tuple[Port, ...]:
    return tuple(port if port.domain is None else dataclasses.replace(port, domain=ELECTRICAL) for port in ports)


def _renamed(declared: Any) -> Any:
    return dataclasses.replace(declared, unit=IN_UNITS.get(declared.unit, declared.unit))


def __getattr__(name: str) -> Any:
    """The image of a class of the registry by its name, as pickle asks for it."""
    kind = REGISTRY.get(name.removeprefix(PREFIX)) if name.startswith(PREFIX) else None
    if kind is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return image_class(kind)
