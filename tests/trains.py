"""Random drive trains for hypothesis with parts that change their mode: gaps, frictions, brakes, clutches, freewheels.

A train is a chain of 2 to 8 inertias; a joint leads from each to the next, and further parts sit on some of them.
Every node has an inertia or hangs on one by a gear. All values are round, and runs are short: an error grows with every
event, so a long run of such a train tells nothing about another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import sympy
from hypothesis import strategies as st

import shaftwork as sw

GROUND = "ground"
Choose = Callable[..., Any]
"""One of some options; hypothesis shrinks to the first."""


@dataclass(frozen=True)
class Part:
    """A part and where it is: its type, name, nodes and values."""

    type: str
    name: str
    nodes: tuple[str, ...]
    values: dict[str, Any]

    @property
    def ends(self) -> tuple[str, str]:
        """Its nodes, with the frame where there is one node."""
        return (*self.nodes, GROUND)[:2]

    @property
    def is_rigid(self) -> bool:
        """Whether it is a contact between rigid flanks."""
        return self.type in ("Backlash", "HardStop") and "c" not in self.values


@dataclass(frozen=True)
class Train:
    """Parts, the start speeds of inertias by name, and how long the motion goes on, s."""

    parts: tuple[Part, ...]
    initial: dict[str, float]
    t_end: float

    def compiled(self) -> sw.Model:
        """Ready to be simulated."""
        net = sw.Network("train")
        for part in self.parts:
            net.add(getattr(sw, part.type)(part.name, **part.values), *part.nodes)
        return net.compile()


class Builder:
    """A train on its way: its parts so far, and the start speeds of its nodes."""

    def __init__(self, choose: Choose, *, rigid: bool) -> None:
        self.choose, self.rigid = choose, rigid
        self.parts: list[Part] = []
        self.speeds: dict[str, float] = {}
        self._count: dict[str, int] = {}

    def add(self, kind: str, *nodes: str, **values: Any) -> None:
        self._count[kind] = self._count.get(kind, 0) + 1
        self.parts.append(Part(kind, f"{kind.lower()}{self._count[kind]}", nodes, values))

    def spring(self, a: str, b: str) -> None:
        self.add("Spring", a, b, c=self.choose(100.0, 1000.0, 20.0), d=self.choose(0.5, 0.0, 2.0))

    def gap(self, a: str, b: str) -> None:
        stiffness = {"c": self.choose(1000.0, 100.0, 5000.0), "d": self.choose(0.5, 0.0, 5.0)}
        self.add("Backlash", a, b, gap=self.choose(0.02, 0.1, 0.005), **stiffness)

    def rigid_gap(self, a: str, b: str) -> None:
        if not self.rigid:
            return self.gap(a, b)
        values = {"restitution": self.choose(0.0, 0.5, 0.3), "omega_rest": self.choose(1e-3, 1e-6)}
        return self.add("Backlash", a, b, gap=self.choose(0.1, 0.02), **values)

    def stop(self, a: str, _: str) -> None:
        limits = self.choose({"upper": 0.1}, {"lower": -0.2, "upper": 0.3})
        soft = not self.rigid or self.choose(1, 0)
        self.add("HardStop", a, **limits, **({"c": 500.0, "d": 1.0} if soft else {}))

    def friction(self, *nodes: str) -> None:
        values = {"tau_c": self.choose(1.0, 5.0, 0.2, 20.0)}
        if self.choose(0, 1):
            values |= {"tau_s": 1.25 * values["tau_c"], "omega_s": self.choose(0.1, 1.0), "d": self.choose(0.0, 0.1)}
        self.add("DryFriction", *nodes, **values)

    def brake(self, *nodes: str) -> None:
        """Between two nodes it is a clutch."""
        values = {"tau": self.choose(5.0, 20.0, 2.0, 0.5), "t_on": self.choose(0.0, 0.1, 0.3, -1.0)}
        values |= self.choose({}, {"t_rise": 0.2}, {"t_lag": 0.1})
        values |= self.choose({}, {"t_off": 0.35}, {"t_off": 0.6})
        self.add("Clutch" if len(nodes) == 2 else "Brake", *nodes, **values)

    def freewheel(self, a: str, b: str) -> None:
        if not self.rigid:
            return self.friction(a, b) if b != GROUND else self.friction(a)
        if self.choose(1, 0):
            a, b = b, a
        return self.add("Freewheel", a, b)

    def gear(self, a: str, b: str) -> None:
        ratio = self.choose(2.0, 3.0, -0.5, 0.3)
        if self.choose(1, 0):
            self.speeds[b] = self.speeds[a] / ratio
            return self.add("Gear", a, b, ratio=ratio)
        self.add("Gear", a, f"{a} geared", ratio=ratio)
        return self.spring(f"{a} geared", b)

    def torque(self, a: str, _: str = "") -> None:
        tau, t = self.choose(10.0, 3.0, -7.0, 30.0), sw.t
        steady, swings = sympy.Float(tau), tau * sympy.sin(self.choose(10.0, 25.0, 4.0) * t)
        law = self.choose(steady, swings, sw.Step(tau, 0.2) - sw.Step(tau, 0.5), tau * t, None)
        if law is None:
            self.add("KlossMotor", a, tau_k=abs(tau), s_k=0.25, n_sync=self.choose(300.0, 3000.0), ratio=2.0)
        else:
            self.add("TorqueSource", a, tau=law)

    def joint(self, a: str, b: str) -> None:
        plain = (self.spring, self.gear) if self.parts[-1].type != "Inertia" else ()
        made = self.choose(self.gap, self.friction, self.brake, *plain, self.gap, self.rigid_gap, self.freewheel)
        made(a, b)
        if made in (self.friction, self.brake, self.freewheel) and self.choose(1, 0):
            self.spring(a, b)

    def addition(self, a: str, b: str) -> None:
        made = self.choose(
            lambda a, _: self.friction(a),
            lambda a, _: self.brake(a),
            lambda a, _: self.add("CoulombLoad", a, tau=self.choose(1.0, 5.0, 0.2)),
            lambda a, _: self.add("Damper", a, d=self.choose(0.1, 1.0)),
            self.torque,
            self.stop,
            self.friction,
            self.spring,
            lambda a, _: self.freewheel(a, GROUND),
        )
        made(a, b)


@st.composite
def trains(draw: st.DrawFn, most: int = 8, *, rigid: bool = True) -> Train:
    """A train of 2 to ``most`` inertias; with ``rigid`` also impacts of rigid flanks and freewheels."""

    def choose(*options: Any) -> Any:
        return options[draw(st.integers(0, len(options) - 1))]

    made = Builder(choose, rigid=rigid)
    nodes = [f"r{k}" for k in range(draw(st.integers(2, most)))]
    for node in nodes:
        made.add("Inertia", node, J=choose(1.0, 0.5, 0.1, 2.0))
        made.speeds[node] = choose(0.0, 1.0, -1.0, 5.0, -3.3, 20.0)
    for a, b in pairwise(nodes):
        made.joint(a, b)
    made.torque(choose(*nodes))
    for _ in range(draw(st.integers(0, 4))):
        a, b = draw(st.permutations(nodes))[:2]
        made.addition(a, b)
    initial = {f"inertia{k}.omega": made.speeds[node] for k, node in enumerate(nodes, start=1)}
    return Train(tuple(made.parts), initial, choose(0.5, 1.0))
