"""A long shaft before it is divided: partial differential equations along it, and what its ends see of the network.

With x from node a to node b, tau_c the torque without that of the internal damping, and where nothing is lost:

    -d(tau)/dx = J' d(omega)/dt + d' omega,    -d(omega)/dx = d(tau_c)/dt / C',    tau_c = tau + D' d(omega)/dx,
    d2(tau)/dx2 = J' / C' d2(tau)/dt2 = d2(tau)/dt2 / v^2, and the same for omega.

Source: Popenda 2019, (8)-(15); his (14) and (15) have another sign, with which there would be no waves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING

from sympy import Add, Eq, Expr, Function, Integer, Symbol, sqrt

from shaftwork.components.base import Derived
from shaftwork.components.laws import t
from shaftwork.components.shafts import Shaft
from shaftwork.equations.assembly import branches_of
from shaftwork.network.graph import GROUND, GraphPart

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

X = Symbol("x", real=True)
"""The place along a shaft, from its node a."""


@dataclass(frozen=True, eq=False)
class Field:
    """The equations along one shaft in sympy, with true functions of x and t and true derivatives.

    Args:
        equations: of the network.
        part: the shaft.
    """

    equations: Equations
    part: GraphPart

    @cached_property
    def torque(self) -> Expr:
        """The torque along the shaft, a function of x and t."""
        return self._function("tau")

    @cached_property
    def elastic(self) -> Expr:
        """The torque without that of the internal damping."""
        return self._function("tau_c")

    @cached_property
    def speed(self) -> Expr:
        """The speed along the shaft."""
        return self._function("omega")

    def _function(self, name: str) -> Expr:
        return Function(f"{self.part.name}.{name}", real=True)(X, t)

    def symbol(self, name: str) -> Expr:
        """A parameter, zero where its value is, or a quantity that follows from parameters."""
        component = self.part.component
        if name in component.declared and component.declared[name].magnitude(getattr(component, name))[0] == 0:
            return Integer(0)
        return Symbol(f"{self.part.name}.{name}", real=True)

    @cached_property
    def rows(self) -> tuple[Eq, ...]:
        """(8) to (12) with internal damping; without it (13), and, where nothing is lost at all, (14) and (15)."""
        torque, elastic, speed = self.torque, self.elastic, self.speed
        inertia, compliance = self.symbol("line_inertia"), 1 / self.symbol("line_stiffness")
        damping, friction = self.symbol("damping"), self.symbol("friction")
        kinetic = Eq(-torque.diff(X), inertia * speed.diff(t) + friction * speed)
        if damping == 0:
            lossless = (kinetic, Eq(-speed.diff(X), compliance * torque.diff(t)))
            factors = () if friction != 0 else (inertia * compliance, 1 / self.symbol("v") ** 2)
            return (*lossless, *(Eq(f.diff(X, 2), k * f.diff(t, 2)) for k in factors for f in (torque, speed)))
        bent = -(torque.diff(X, 2) + friction * speed.diff(X)) / inertia
        return (
            kinetic,
            Eq(-speed.diff(X), compliance * elastic.diff(t)),
            Eq(elastic, torque + damping * speed.diff(X)),
            Eq(bent, speed.diff(X, t)),
            Eq(-speed.diff(X), compliance * (torque.diff(t) + damping * bent)),
        )

    @cached_property
    def boundary(self) -> tuple[Eq, ...]:
        """Speed and torque at both ends: the speeds of the nodes, and what the other parts there give."""
        conditions, quantities = list[Eq](), self.equations.assembly.quantities
        for end, place, sign in (("a", Integer(0), 1), ("b", self.symbol("length"), -1)):
            node = self.part.nodes[end]
            conditions.append(Eq(self.speed.subs(X, place), quantities.node(node), evaluate=False))
            if node != GROUND:  # the frame takes any torque
                conditions.append(Eq(self.torque.subs(X, place), sign * Add(*self._taken_from(node)), evaluate=False))
        return tuple(conditions)

    def _taken_from(self, node: int) -> Iterator[Expr]:
        """What the other parts at a node give, less what their inertias take."""
        assembly, graph = self.equations.assembly, self.equations.form.graph
        for other in self.equations.fields:
            if other.part is not self.part:
                ends = (("a", -1, Integer(0)), ("b", 1, other.symbol("length")))
                yield from (sign * other.torque.subs(X, x) for end, sign, x in ends if other.part.nodes[end] == node)
        for item in assembly.at_node[node]:
            if not isinstance(graph.part_of(branches_of(item)[0]).component, Shaft):
                yield assembly.received(item, node)

    @cached_property
    def definitions(self) -> Mapping[Symbol, Expr]:
        """The letters in the rows that follow from parameters."""
        definitions = {self.symbol(derived.name): derived.law for derived in self.derived}
        if any(row.has(self.symbol("v")) for row in self.rows):
            definitions[self.symbol("v")] = sqrt(self.symbol("line_stiffness") / self.symbol("line_inertia"))
        return definitions

    @cached_property
    def derived(self) -> tuple[Derived, ...]:
        """What follows from the parameters, but for the speed of waves."""
        names = ("area_moment", "line_inertia", "line_stiffness")
        symbols = SimpleNamespace(**{name: self.symbol(name) for name in (*self.part.component.declared, *names)})
        return tuple(derived for derived in self.part.component.derived(symbols) if derived.name in names)


def fields_of(equations: Equations) -> tuple[Field, ...]:
    """The equations along every shaft of a network."""
    shafts = (part for part in equations.form.graph.parts if isinstance(part.component, Shaft))
    return tuple(Field(equations, part) for part in shafts)
