"""Long shafts with distributed inertia and compliance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from sympy import Expr, Float, Rational, pi, sqrt

from shaftwork.components.base import Component, Port, Profile, Signal, component
from shaftwork.components.branches import (
    ACROSS,
    AcrossStore,
    Branch,
    DelayLine,
    End,
    IdealCoupling,
    ThroughLaw,
    ThroughStore,
    rigid,
)
from shaftwork.components.shaft_models import Auto, Lumped, Mesh, OneSpring, Rigid, ShaftModel, Wave
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter

_ENDS = ("a", "b")


@component
class Shaft(Component):
    """A uniform shaft between two nodes, whose inertia and compliance are distributed along it.

    Law: -d(tau)/dx = J' d(omega)/dt + d' omega, -d(omega)/dx = d(tau_c)/dt / C', tau = tau_c - D' d(omega)/dx, with
    J' = density I_p, C' = shear_modulus I_p, I_p = pi (diameter^4 - inner_diameter^4) / 32, D' the internal damping and
    d' the bearing friction. Analogue: a transmission line. Stepped shafts are shafts in a row, discs are inertias at
    the nodes between them. Source: Popenda 2019, (8)-(12), with the sign of (14), (15) put right.
    """

    length: float = parameter("m", "length", above=0, latex="L")
    diameter: float = parameter("m", "outer diameter", above=0, latex="d")
    inner_diameter: float = parameter("m", "diameter of the bore", at_least=0, default=0.0, latex="d_i")
    density: float = parameter("kg/m^3", "density", above=0, default=7850.0, latex=r"\rho")
    shear_modulus: float = parameter("Pa", "shear modulus", above=0, default=79.3e9, latex="G")
    damping: float = parameter("N*m^2*s/rad", "internal damping D'", at_least=0, default=0.0, latex="D'")
    friction: float = parameter("N*s/rad", "bearing friction along the shaft", at_least=0, default=0.0, latex="d'")
    model: ShaftModel = parameter("1", "how it becomes equations", default=Lumped(20), record=ShaftModel)

    def __post_init__(self) -> None:
        made, objection = self.declared["model"].magnitude(self.model)
        if objection is not None:
            raise ParameterError(f"Shaft '{self.name}': model {objection}.")
        object.__setattr__(self, "model", made)
        if self._value("inner_diameter") >= self._value("diameter"):
            raise ParameterError(
                f"Shaft '{self.name}': inner_diameter = {self.inner_diameter!r} must be smaller than the diameter "
                f"{self.diameter!r}."
            )
        if isinstance(made, Wave) and self._value("damping") != 0:
            raise ParameterError(
                f"Shaft '{self.name}': damping = {self.damping!r} with model=Wave(), whose waves travel without "
                "internal damping. Take Spectral(16) or Lumped(100), or leave the damping out."
            )

    def _value(self, name: str) -> float:
        """A parameter in SI; for one that is not admissible, which the checks of the network report, some number."""
        value, objection = self.declared[name].magnitude(getattr(self, name))
        return float(value) if objection is None else float(name not in ("inner_diameter", "damping"))

    @property
    def resolved(self) -> ShaftModel:
        """The model, with `Auto` replaced by what it chooses for this shaft."""
        if not isinstance(self.model, Auto):
            return self.model
        return self.model.chosen(
            self._value("length") * math.sqrt(self._value("density") / self._value("shear_modulus"))
        )

    def inner_ports(self) -> tuple[Port, ...]:
        """The speeds between the ends, and the rates of twist that more than two speeds make up."""
        if isinstance(self.resolved, Rigid | OneSpring):
            return ()
        if isinstance(self.resolved, Wave):
            return (Port("middle"),) if self.friction else ()
        mesh = self.resolved.mesh()
        twists = (f"twist{k}" for k, row in enumerate(mesh.weights) if not _is_difference(row))
        return tuple(Port(name) for name in (*_names(mesh)[1:-1], *twists))

    def signals(self) -> dict[str, Signal]:
        """Speeds and torques at both ends."""
        return {
            "tau_a": Signal("through", ("a", None), ROTATION),
            "tau_b": Signal("through", ("b", None), ROTATION, -1),
            "omega_a": Signal("across", ("a", None), ROTATION),
            "omega_b": Signal("across", ("b", None), ROTATION),
            "omega_rel": Signal("across", _ENDS, ROTATION),
        }

    def profiles(self) -> dict[str, Profile]:
        """Speed and torque along the shaft."""
        ends = (0.0, self.length)
        if isinstance(self.resolved, Rigid | OneSpring):
            return {
                "tau": Profile("through", ends, (("a",), ("-b",)), ROTATION),
                "omega": Profile("across", ends, (("a",), ("b",)), ROTATION),
            }
        if isinstance(self.resolved, Wave):
            shares = [k / (self.resolved.places - 1) for k in range(self.resolved.places)]
            lines = (("h", 0.0, 1.0),) if not self.friction else (("h1", 0.0, 0.5), ("h2", 0.5, 1.0))
            label = {share: next(line for line in lines if share <= line[2]) for share in shares}
            of = tuple((label[share][0],) for share in shares)
            within = tuple((share - label[share][1]) / (label[share][2] - label[share][1]) for share in shares)
            places = tuple(share * self.length for share in shares)
            return {
                "tau": Profile("through", places, of, ROTATION, within),
                "omega": Profile("across", places, of, ROTATION, within),
            }
        mesh = self.resolved.mesh()
        inside = [(y * self.length, (f"tau_c_{k}", f"tau_d_{k}")) for k, y in enumerate(mesh.stations) if 0 < y < 1]
        places, of = zip((0.0, ("a",)), *inside, (self.length, ("-b",)), strict=True)
        nodes = tuple((name,) for name in _names(mesh))
        return {
            "tau": Profile("through", places, of, ROTATION),
            "omega": Profile("across", tuple(x * self.length for x in mesh.nodes), nodes, ROTATION),
        }

    def branches(self, p: Any) -> Iterator[Branch]:
        area = pi * (p.diameter**4 - p.inner_diameter**4) / 32
        inertia, stiffness = p.density * area * p.length, p.shear_modulus * area / p.length
        match self.resolved:
            case Rigid():
                yield AcrossStore(inertia, ("a", None))
                yield rigid(_ENDS)
            case OneSpring():
                yield ThroughStore(stiffness, _ENDS, "tau_c")
                yield ThroughLaw(p.damping / p.length * ACROSS, _ENDS)
            case Wave():
                yield from self._waves(p, area)
            case _:
                yield from self._distributed(p, inertia, stiffness)

    def _waves(self, p: Any, area: Expr) -> Iterator[Branch]:
        impedance, delay = area * sqrt(p.density * p.shear_modulus), p.length * sqrt(p.density / p.shear_modulus)
        if p.friction == 0:
            yield DelayLine(impedance, delay, _ENDS)
            return
        friction = p.friction * p.length
        for name, share in (("a", Rational(1, 4)), ("middle", Rational(1, 2)), ("b", Rational(1, 4))):
            yield ThroughLaw(friction * share * ACROSS, (name, None), f"tau_d_{name}")
        yield DelayLine(impedance, delay / 2, ("a", "middle"), "h1")
        yield DelayLine(impedance, delay / 2, ("middle", "b"), "h2")

    def _distributed(self, p: Any, inertia: Expr, stiffness: Expr) -> Iterator[Branch]:
        mesh = self.resolved.mesh()
        names = _names(mesh)
        friction, damping = p.friction * p.length, p.damping / p.length
        at_nodes = {
            share: (inertia * _number(share), friction * _number(share)) for share in dict.fromkeys(mesh.inertias)
        }
        for name, share in zip(names, mesh.inertias, strict=True):
            capacity, bearing = at_nodes[share]
            yield AcrossStore(capacity, (name, None), f"omega_{name}")
            yield ThroughLaw(bearing * ACROSS, (name, None))
        between = {
            share: (stiffness / _number(share), damping / _number(share) * ACROSS)
            for share in dict.fromkeys(mesh.lengths)
        }
        for k, (row, share) in enumerate(zip(mesh.weights, mesh.lengths, strict=True)):
            ends: tuple[End, End] = (f"twist{k}", None)
            if _is_difference(row):
                ends = (names[row[0][0]], names[row[1][0]])
            else:
                terms = tuple((_number(weight), names[j], None) for j, weight in row)
                yield IdealCoupling(((_number(-1.0), *ends), *terms), f"twist_{k}")
            store, law = between[share]
            yield ThroughStore(store, ends, f"tau_c_{k}")
            yield ThroughLaw(law, ends, f"tau_d_{k}")


def _names(mesh: Mesh) -> list[str]:
    """The speed nodes: a, 1, 2, ..., b."""
    return ["a", *(str(k) for k in range(1, len(mesh.nodes) - 1)), "b"]


def _is_difference(row: tuple[tuple[int, float], ...]) -> bool:
    return [weight for _, weight in row] == [1.0, -1.0]


@lru_cache(maxsize=1024)
def _number(value: float) -> Expr:
    """A whole number or a short fraction where the float is one, so that equations read well."""
    short = Rational(value).limit_denominator(1000)
    return short if float(short) == value else Float(value)
