"""Long shafts with distributed inertia and compliance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

from sympy import Expr, Float, Rational, pi, sqrt

from shaftwork.components.base import Component, Derived, Port, Profile, Signal, component, number_of
from shaftwork.components.branches import (
    ACROSS,
    AcrossLaw,
    AcrossStore,
    Branch,
    DelayLine,
    End,
    IdealCoupling,
    ThroughLaw,
    ThroughStore,
    across_of,
    rigid,
    through_of,
)
from shaftwork.components.shaft_meshes import Mesh, Row
from shaftwork.components.shaft_models import Auto, CentralDifference, Lumped, OneSpring, Rigid, ShaftModel, Wave
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter

_ENDS = ("a", "b")
_Sum = tuple[tuple[float, str], ...]


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
        super().__post_init__()
        if (objection := self.declared["model"].magnitude(self.model)[1]) is not None:
            raise ParameterError(f"Shaft '{self.name}': model {objection}.")
        if self._value("inner_diameter") >= self._value("diameter"):
            raise ParameterError(
                f"Shaft '{self.name}': inner_diameter = {self.inner_diameter!r} must be smaller than the diameter "
                f"{self.diameter!r}."
            )
        if isinstance(self.model, Wave) and self._value("damping") != 0:
            raise ParameterError(
                f"Shaft '{self.name}': damping = {self.damping!r} with model=Wave(), whose waves travel without "
                "internal damping. Take Spectral(16) or Lumped(100), or leave the damping out."
            )

    def _value(self, name: str) -> float:
        """A parameter in SI; for one that is not admissible, which the checks of the network report, some number."""
        value = number_of(self, name)
        return float(name not in ("inner_diameter", "damping")) if value is None else value

    @property
    def resolved(self) -> ShaftModel:
        """The model, with `Auto` replaced by what it chooses for this shaft."""
        if not isinstance(self.model, Auto):
            return self.model
        return self.model.chosen(
            self._value("length") * math.sqrt(self._value("density") / self._value("shear_modulus"))
        )

    def inner_ports(self) -> tuple[Port, ...]:
        """The speeds between the ends, and the rates of twist that are no difference of two speeds."""
        if isinstance(self.resolved, Rigid | OneSpring):
            return ()
        if isinstance(self.resolved, Wave):
            return (Port("middle"),) if self.friction else ()
        mesh = self.resolved.mesh()
        twists = (
            f"twist{k}"
            for k, row in enumerate(mesh.weights, mesh.first)
            if not _is_difference(row) or _is_in_letters(self.resolved)
        )
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
        if isinstance(self.resolved, Wave):
            places = tuple(k / (self.resolved.places - 1) for k in range(self.resolved.places))
            lines = tuple(_on_a_line(share, halves=bool(self.friction)) for share in places)
            return {
                "tau": Profile("through", places, "length", (), ROTATION, lines),
                "omega": Profile("across", places, "length", (), ROTATION, lines),
            }
        speeds: list[tuple[float, _Sum]] = [(0.0, ((1.0, "a"),)), (1.0, ((1.0, "b"),))]
        inside: list[tuple[float, _Sum]] = []
        if not isinstance(self.resolved, Rigid | OneSpring):
            mesh = self.resolved.mesh()
            speeds = [(x, ((1.0, name),)) for x, name in zip(mesh.nodes, _names(mesh), strict=True)]
            inside = [
                (y, ((1.0, f"tau_{k}"),) if _is_in_letters(self.resolved) else _torque(mesh, k))
                for k, y in enumerate(mesh.stations, mesh.first)
                if 0 < y < 1
            ]
        torques = ((0.0, ((1.0, "a"),)), *inside, (1.0, ((-1.0, "b"),)))
        return {
            "tau": Profile("through", *_columns(torques), ROTATION),
            "omega": Profile("across", *_columns(speeds), ROTATION),
        }

    def derived(self, p: Any) -> Iterator[Derived]:
        """What Popenda 2019 writes the equations in: J', C' = 1 / S'_c, Delta x; and the impedance of waves."""
        area = pi * (p.diameter**4 - p.inner_diameter**4) / 32
        yield Derived("area_moment", area, "m^4", "polar moment of area", "I_p")
        yield Derived("line_inertia", p.density * p.area_moment, "kg*m", "inertia per length", "J'")
        yield Derived("line_stiffness", p.shear_modulus * p.area_moment, "N*m^2/rad", "stiffness of unit length", "C'")
        yield Derived(
            "impedance", sqrt(p.density * p.shear_modulus) * p.area_moment, "N*m*s/rad", "wave impedance", "Z"
        )
        yield Derived("delay", p.length * sqrt(p.density / p.shear_modulus), "s", "travel time of a wave", "T")
        if not isinstance(self.resolved, Rigid | OneSpring | Wave):
            yield Derived(
                "interval", p.length / self.resolved.mesh().intervals, "m", "length of an interval", r"\Delta x"
            )

    def branches(self, p: Any) -> Iterator[Branch]:
        match self.resolved:
            case Rigid():
                yield AcrossStore(p.line_inertia * p.length, ("a", None))
                yield rigid(_ENDS)
            case OneSpring():
                yield ThroughStore(p.line_stiffness / p.length, _ENDS, "tau_c")
                yield ThroughLaw(p.damping / p.length * ACROSS, _ENDS)
            case Wave():
                yield from self._waves(p)
            case CentralDifference(form="paper", m=m):
                yield from _as_printed(m, p)
            case _:
                yield from self._distributed(p)

    def _waves(self, p: Any) -> Iterator[Branch]:
        if p.friction == 0:
            yield DelayLine(p.impedance, p.delay, _ENDS)
            return
        friction = p.friction * p.length
        for name, share in (("a", Rational(1, 4)), ("middle", Rational(1, 2)), ("b", Rational(1, 4))):
            yield ThroughLaw(friction * share * ACROSS, (name, None), f"tau_{name}")
        yield DelayLine(p.impedance, p.delay / 2, ("a", "middle"), "h1")
        yield DelayLine(p.impedance, p.delay / 2, ("middle", "b"), "h2")

    def _distributed(self, p: Any) -> Iterator[Branch]:
        mesh = self.resolved.mesh()
        names = _names(mesh)
        unit = p.interval if mesh.intervals > 1 else p.length
        at_node = {
            share: (p.line_inertia * unit * _number(share), p.friction * unit * _number(share) * ACROSS)
            for share in dict.fromkeys(mesh.inertias)
        }
        for name, share in zip(names, mesh.inertias, strict=True):
            capacity, bearing = at_node[share]
            yield AcrossStore(capacity, (name, None), f"omega_{name}")
            yield ThroughLaw(bearing, (name, None))
        between = {
            share: (p.line_stiffness / (unit * _number(share)), p.damping / (unit * _number(share)) * ACROSS)
            for share in dict.fromkeys((*mesh.lengths, *mesh.dampers))
        }
        for k, (row, share) in enumerate(zip(mesh.weights, mesh.lengths, strict=True), mesh.first):
            ends: tuple[End, End] = (f"twist{k}", None)
            if _is_difference(row):
                ends = (names[row[0][0]], names[row[1][0]])
            else:
                terms = tuple((_number(weight), names[j], None) for j, weight in row)
                yield IdealCoupling(((_number(-1.0), *ends), *terms), f"twist_{k}")
            store, damper = between[share]
            yield ThroughStore(store, ends, f"tau_c_{k}")
            if not mesh.dampers:
                yield ThroughLaw(damper, ends, f"tau_d_{k}")
        for k, share in enumerate(mesh.dampers):
            _, damper = between[share]
            yield ThroughLaw(damper, (names[k], names[k + 1]), f"tau_d_{k}")


def _as_printed(m: int, p: Any) -> Iterator[Branch]:
    """Popenda's (20)-(23) as they stand: each row is a law of its own, so what one gives another need not take."""
    names = ["a", *map(str, range(1, m)), "b"]
    torques = [through_of(f"tau_{min(max(k, 1), m - 1)}") for k in range(m + 1)]
    yield ThroughLaw(torques[0], ("a", None), "tau_a")
    for k in range(1, m):
        yield AcrossStore(p.line_inertia * p.interval, (names[k], None), f"omega_{k}")
        yield ThroughLaw(p.friction * p.interval * ACROSS, (names[k], None))
        yield ThroughLaw((torques[k + 1] - torques[k - 1]) / 2, (names[k], None), f"tau_n_{k}")
        slope = (across_of(names[k + 1]) - across_of(names[k - 1])) / 2
        bend = p.damping / p.line_inertia * (torques[k + 1] - 2 * torques[k] + torques[k - 1]) / 2
        twist = -slope + bend / (p.line_stiffness * p.interval)
        yield AcrossLaw(twist, (f"twist{k}", None), f"omega_twist_{k}")
        yield ThroughStore(p.line_stiffness / p.interval, (f"twist{k}", None), f"tau_{k}")
    yield ThroughLaw(-torques[m], ("b", None), "tau_b")


def _columns(entries: Sequence[tuple[float, _Sum]]) -> tuple[tuple[float, ...], str, tuple[_Sum, ...]]:
    """Places, the length that they are shares of, and what is read at each."""
    return tuple(place for place, _ in entries), "length", tuple(terms for _, terms in entries)


def _torque(mesh: Mesh, k: int) -> _Sum:
    """The torque of a number: that of its spring, and of the damper beside it or the mean of those next to it."""
    spring = (1.0, f"tau_c_{k}")
    return (spring, (0.5, f"tau_d_{k - 1}"), (0.5, f"tau_d_{k}")) if mesh.dampers else (spring, (1.0, f"tau_d_{k}"))


def _on_a_line(share: float, *, halves: bool) -> tuple[str, float]:
    """The line of a wave that a share of the way lies on, and the share of the way along that line."""
    if not halves:
        return "h", share
    return ("h1", 2 * share) if share <= 0.5 else ("h2", 2 * share - 1)


def _names(mesh: Mesh) -> list[str]:
    """The speed nodes: a, 1, 2, ..., b."""
    return ["a", *(str(k) for k in range(1, len(mesh.nodes) - 1)), "b"]


def _is_in_letters(model: ShaftModel) -> bool:
    return isinstance(model, CentralDifference) and model.form == "paper"


def _is_difference(row: Row) -> bool:
    return [weight for _, weight in row] == [1.0, -1.0]


@lru_cache(maxsize=1024)
def _number(value: float) -> Expr:
    """A whole number or a short fraction where the float is one, so that equations read well."""
    short = Rational(value).limit_denominator(1000)
    return short if float(short) == value else Float(value)
