"""Electrical machines: torque-speed curve and armature circuit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Integer, pi

from shaftwork.components.base import Component, Port, Role, Signal, component
from shaftwork.components.branches import ACROSS, Branch, IdealCoupling, ThroughLaw, ThroughStore
from shaftwork.components.switching import off_time, on_time, refuse_no_time_on, while_on
from shaftwork.components.torque_curves import kloss
from shaftwork.core.domains import ELECTRICAL, ROTATION
from shaftwork.core.parameters import parameter


@component
class KlossMotor(Component):
    """An induction motor by Kloss' formula, seen through a gear of given ratio and efficiency.

    Law: tau = ratio efficiency 2 tau_k s s_k / (s^2 + s_k^2), slip s = 1 - ratio omega / (2 pi n_sync / 60).
    Analogue: a voltage-controlled current source. Source: Marinkovic 2012, (2), (18).
    The efficiency multiplies the torque in both directions of power flow, as the source prints it.
    """

    tau_k: float = parameter("N*m", "pull-out torque at the motor shaft", above=0, latex=r"\tau_k")
    s_k: float = parameter("1", "slip at the pull-out torque", above=0)
    n_sync: float = parameter("1/min", "synchronous speed", above=0, latex=r"n_{sync}")
    ratio: float = parameter("1", "motor speed over node speed", nonzero=True, default=1.0, latex="i")
    efficiency: float = parameter("1", "efficiency of the gear", above=0, at_most=1, default=1.0, latex=r"\eta")
    t_on: float | None = on_time()
    t_off: float | None = off_time()

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"),)

    def __post_init__(self) -> None:
        refuse_no_time_on(self)

    def branches(self, p: Any) -> Iterator[Branch]:
        slip = 1 - p.ratio * ACROSS / (2 * pi * p.n_sync / 60)
        yield ThroughLaw(-while_on(p.ratio * p.efficiency * kloss(p.tau_k, slip, p.s_k), p))


@component
class DCMachine(Component):
    """A direct-current machine: armature circuit between p and n, rotor (without inertia) at node rotor.

    Law: u = k omega + R i + L di/dt, tau = k i; k is both the torque constant and the back-EMF constant.
    Analogue: an ideal transformer between the electrical and the rotational domain.
    """

    k: float = parameter("N*m/A", "torque constant, equal to the back-EMF constant in V*s/rad", nonzero=True)
    R: float = parameter("ohm", "armature resistance", at_least=0, default=0.0)
    L: float = parameter("H", "armature inductance", at_least=0, default=0.0)

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("p", ELECTRICAL), Port("n", ELECTRICAL), Port("rotor", ROTATION))
    inner: ClassVar = (Port("resistor", ELECTRICAL), Port("emf", ELECTRICAL))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(ACROSS / p.R, ("p", "resistor"))
        yield ThroughStore(1 / p.L, ("resistor", "emf"))
        yield IdealCoupling(((Integer(1), "emf", "n"), (-p.k, "rotor", None)))

    def signals(self) -> dict[str, Signal]:
        """Voltage and current of the armature, speed of the rotor and torque that the machine gives to it."""
        return {
            "u": Signal("across", ("p", "n"), ELECTRICAL),
            "i": Signal("through", ("p", None), ELECTRICAL),
            "omega": Signal("across", ("rotor", None), ROTATION),
            "tau": Signal("through", ("rotor", None), ROTATION, -1),
        }
