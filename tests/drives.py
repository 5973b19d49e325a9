"""Random drives for hypothesis: trains as in `trains`, with the parts that pass impulses on or give them.

These are gears that rub, planetary gears, rigid flanks and prescribed speeds that jump; besides there are loads that
hang and brakes that a speed or an angle switches on. Values are uneven where equal ones would hide a mistake.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from hypothesis import strategies as st
from sympy import sin

import shaftwork as sw
from tests.trains import GROUND, Builder, Choose, Train

DRIVEN = "driven"
"""The node of a prescribed speed."""


class _Drive(Builder):
    def __init__(self, choose: Choose) -> None:
        super().__init__(choose, rigid=True)

    def inertia(self, node: str, speed: float) -> None:
        self.add("Inertia", node, J=self.choose(1.0, 0.37, 0.1, 2.3, 7.0))
        self.speeds[node] = speed

    def rigid_gap(self, a: str, b: str) -> None:
        """With the speed at rest by default, as errors up to that speed may remain."""
        self.add("Backlash", a, b, gap=self.choose(0.1, 0.02), restitution=self.choose(0.0, 0.5, 0.3))

    def between(self, a: str, b: str) -> str:
        """A new node."""
        return f"{a} to {b}"

    def lossy_gear(self, a: str, b: str) -> None:
        """Directly, or to an inertia of its own with a spring behind it."""
        ratio = self.choose(2.0, -1.3, 0.37, 4.1, -0.61)
        values = {"ratio": ratio, "efficiency": self.choose(0.9, 0.67, 0.5, 0.97)}
        back = self.choose(None, 0.42, 0.8, 0.0)
        values |= {} if back is None else {"efficiency_back": back}
        if self.choose(1, 0):
            self.add("LossyGear", a, b, **values)
            self.speeds[b] = self.speeds[a] / ratio
            return
        middle = self.between(a, b)
        self.inertia(middle, self.speeds[a] / ratio)
        self.add("LossyGear", a, middle, **values)
        self.spring(middle, b)

    def planetary(self, a: str, b: str) -> None:
        """A third shaft with an inertia, which is perhaps held."""
        third, ratio = self.between(a, b), self.choose(2.0, 3.3)
        sun, carrier, ring = self.choose((a, third, b), (third, a, b), (b, third, a), (a, b, third))
        speeds = self.speeds
        if third == carrier:
            speed = (speeds[sun] + ratio * speeds[ring]) / (1 + ratio)
        elif third == sun:
            speed = (1 + ratio) * speeds[carrier] - ratio * speeds[ring]
        else:
            speed = ((1 + ratio) * speeds[carrier] - speeds[sun]) / ratio
        self.inertia(third, speed)
        self.add("PlanetaryGear", sun, carrier, ring, ratio=ratio)
        hold = self.choose(self.friction, self.brake, lambda node: self.freewheel(node, GROUND), None)
        if hold is not None:
            hold(third)

    def switched_brake(self, a: str, _: str = "") -> None:
        """What switches it on is a speed or an angle."""
        law = self.choose(sw.omega - 2.0, sw.phi - 0.3, 1.0 - sw.omega)
        self.add("Brake", a, tau=self.choose(5.0, 20.0, 0.5), on=law, **self.choose({}, {"t_off": 0.6}))

    def hoist(self, a: str, _: str = "") -> None:
        values = {"ratio": self.choose(1.0, 5.0), "efficiency": self.choose(0.8, 1.0, 0.55)}
        self.add("Hoist", a, m=self.choose(10.0, 1.0, 50.0), radius=0.1, **values)

    def prescribed(self, a: str) -> None:
        """A speed that is held, jumps or swings, and what leads from it to a node."""
        law = self.choose(2.0, sw.Step(3.0, 0.2) - sw.Step(5.0, 0.4), 3.0 * sin(12.0 * sw.t))
        self.add("SpeedSource", DRIVEN, omega=law)
        start = 2.0 if law == 2.0 else 0.0
        self.speeds[DRIVEN] = start
        joints = (self.spring, self.friction, self.brake, self.gap, self.freewheel, self.rigid_gap)
        if self.choose(0, 1):
            self.inertia(DRIVEN, start)
        self.choose(self.lossy_shaft, self.shaft, *joints)(DRIVEN, a)

    def shaft(self, a: str, b: str) -> None:
        """A gear to an inertia of its own, with a spring behind it."""
        middle, ratio = self.between(a, b), self.choose(2.0, -0.5)
        self.inertia(middle, self.speeds[a] / ratio)
        self.add("Gear", a, middle, ratio=ratio)
        self.spring(middle, b)

    def lossy_shaft(self, a: str, b: str) -> None:
        """The same with a gear that rubs."""
        middle, ratio = self.between(a, b), self.choose(1.7, -0.6)
        self.inertia(middle, self.speeds[a] / ratio)
        self.add("LossyGear", a, middle, ratio=ratio, efficiency=self.choose(0.83, 0.6))
        self.spring(middle, b)

    def joint(self, a: str, b: str) -> None:
        plain = (self.gap, self.spring, self.friction, self.brake, self.freewheel)
        made = self.choose(self.lossy_gear, *plain, self.rigid_gap, self.rigid_gap, self.lossy_gear, self.planetary)
        made(a, b)
        if made in (self.friction, self.brake, self.freewheel) and self.choose(1, 0):
            self.spring(a, b)

    def addition(self, a: str, b: str) -> None:
        if self.choose(0, 1):
            super().addition(a, b)
        else:
            self.choose(self.hoist, self.switched_brake, self.stop, self.stop)(a, b)


@st.composite
def drives(draw: st.DrawFn, most: int = 6) -> Train:
    """A drive of 2 to ``most`` inertias in a row, with others beside them."""

    def choose(*options: Any) -> Any:
        return options[draw(st.integers(0, len(options) - 1))]

    made = _Drive(choose)
    nodes = [f"r{k}" for k in range(draw(st.integers(2, most)))]
    for node in nodes:
        made.inertia(node, choose(0.0, 1.0, -1.0, 5.0, -3.3, 20.0))
    for a, b in pairwise(nodes):
        made.joint(a, b)
    made.torque(choose(*nodes))
    if choose(0, 1):
        made.prescribed(choose(*nodes))
    for _ in range(draw(st.integers(0, 3))):
        a, b = draw(st.permutations(nodes))[:2]
        made.addition(a, b)
    inertias = (part for part in made.parts if part.type == "Inertia")
    initial = {f"{part.name}.omega": made.speeds[part.nodes[0]] for part in inertias}
    return Train(tuple(made.parts), initial, choose(0.3, 0.6))
