"""Loads: torques that oppose the motion of their node."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import tanh

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, Branch, ThroughLaw
from shaftwork.core.parameters import parameter


@component
class CoulombLoad(Component):
    """A travel resistance of constant size, always against the motion, rounded near standstill.

    Law: torque on the node -tau tanh(omega / omega_s). Source: Marinkovic 2012, (7), (8).
    """

    tau: float = parameter("N*m", "size of the resistance", at_least=0, latex=r"\tau_0")
    omega_s: float = parameter(
        "rad/s", "speed below which it is rounded", at_least=1e-6, default=0.01, latex=r"\omega_s"
    )

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.tau * tanh(ACROSS / p.omega_s))


@component
class ViscousLoad(Component):
    """A resistance proportional to speed. Law: torque on the node -d omega. Analogue: a conductance d to ground."""

    d: float = parameter("N*m*s/rad", "resistance per speed", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)
