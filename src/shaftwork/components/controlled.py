"""Sources that follow a voltage or current elsewhere in a circuit, and what netlists of circuits have besides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Integer

from shaftwork.components.base import Component, Port, Role, Signal, component
from shaftwork.components.branches import (
    ACROSS,
    AcrossStore,
    Branch,
    DelayLine,
    LossyCoupling,
    ThroughLaw,
    ThroughStore,
    across_of,
)
from shaftwork.components.contacts import CLOSED
from shaftwork.components.modes import Leave, Mode, Modes
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.parameters import parameter

FOLLOWING = tuple(Port(name, ELECTRICAL) for name in ("p", "n", "cp", "cn"))
"""The two ends of what follows, and the two of what it follows."""
VOLTAGE = across_of("cp") - across_of("cn")
DELIVERED = {
    "u": Signal("across", ("p", "n"), ELECTRICAL),
    "i": Signal("through", ("p", None), ELECTRICAL, -1),
}
"""Voltage from p to n, and the current delivered at p."""
MEASURED = {"i_c": Signal("through", ("cp", None), ELECTRICAL)}
"""The current from cp to cn."""


@component
class VoltageControlledVoltageSource(Component):
    """A voltage from p to n that follows the one from cp to cn, through which no current flows.

    Law: u_p - u_n = gain (u_cp - u_cn), whatever current that takes. SPICE: E.
    """

    gain: float = parameter("1", "voltage over the voltage that it follows")

    role: ClassVar[Role] = "source"
    ports: ClassVar = FOLLOWING

    def branches(self, p: Any) -> Iterator[Branch]:
        yield LossyCoupling(((Integer(1), "p", "n"), (-p.gain, "cp", "cn")), (Integer(1), Integer(0)))

    def signals(self) -> dict[str, Signal]:
        """Its voltage, and the current that it delivers at p."""
        return DELIVERED


@component
class VoltageControlledCurrentSource(Component):
    """A current from p through the source to n that follows the voltage from cp to cn.

    Law: i = g (u_cp - u_cn), taken from p and delivered at n; a resistor 1 / g where p is cp and n is cn. SPICE: G.
    """

    g: float = parameter("S", "current over the voltage that it follows")

    role: ClassVar[Role] = "source"
    ports: ClassVar = FOLLOWING
    inner: ClassVar = (Port("image", ELECTRICAL),)

    def branches(self, p: Any) -> Iterator[Branch]:
        terms = ((Integer(1), "image", None), (Integer(-1), "cp", "cn"), (Integer(0), "p", "n"))
        yield LossyCoupling(terms, (Integer(1), Integer(0), -p.g))
        yield ThroughLaw(ACROSS, ("image", None), "image")

    def signals(self) -> dict[str, Signal]:
        """Its voltage, and the current that it delivers at p: below zero where it takes one there."""
        return DELIVERED


@component
class CurrentControlledCurrentSource(Component):
    """A current from p through the source to n that follows the one from cp to cn, between which is no voltage.

    Law: i = gain i_c, taken from p and delivered at n, and u_cp = u_cn. SPICE: F.
    """

    gain: float = parameter("1", "current over the current that it follows")

    role: ClassVar[Role] = "source"
    ports: ClassVar = FOLLOWING

    def branches(self, p: Any) -> Iterator[Branch]:
        yield LossyCoupling(((Integer(1), "cp", "cn"), (Integer(0), "p", "n")), (Integer(1), p.gain))

    def signals(self) -> dict[str, Signal]:
        """Its voltage, the current that it delivers at p, and the one that it follows."""
        return {**DELIVERED, **MEASURED}


@component
class CurrentControlledVoltageSource(Component):
    """A voltage from p to n that follows the current from cp to cn, between which is no voltage.

    Law: u_p - u_n = r i_c, whatever current that takes, and u_cp = u_cn. SPICE: H.
    """

    r: float = parameter("ohm", "voltage over the current that it follows")

    role: ClassVar[Role] = "source"
    ports: ClassVar = FOLLOWING
    inner: ClassVar = (Port("image", ELECTRICAL),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield LossyCoupling(((Integer(1), "cp", "cn"), (Integer(0), "image", None)), (Integer(1), Integer(-1)))
        yield ThroughLaw(ACROSS, ("image", None), "image")
        yield LossyCoupling(((Integer(1), "p", "n"), (-p.r, "image", None)), (Integer(1), Integer(0)))

    def signals(self) -> dict[str, Signal]:
        """Its voltage, the current that it delivers at p, and the one that it follows."""
        return {**DELIVERED, **MEASURED}


@component
class VoltageControlledSwitch(Component):
    """A switch from p to n with a resistance in either mode, which follows the voltage from cp to cn with hysteresis.

    Law: u_p - u_n = R i with R_on from when u_cp - u_cn rises above u_t + u_h, and with R_off from when it falls below
    u_t - u_h. A motion begins with it open, unless the voltage is above u_t + u_h. Modes: open, closed. SPICE: S.
    """

    R_on: float = parameter("ohm", "resistance while it is closed", above=0, default=1.0, latex=r"R_{on}")
    R_off: float = parameter("ohm", "resistance while it is open", above=0, default=1e12, latex=r"R_{off}")
    u_t: float = parameter("V", "threshold", default=0.0)
    u_h: float = parameter("V", "hysteresis, half of its width", at_least=0, default=0.0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = FOLLOWING

    def modes(self, p: Any) -> Iterator[Modes]:
        yield Modes(
            (
                Mode("open", (Leave(VOLTAGE - p.u_t - p.u_h, "closed"),)),
                Mode("closed", (Leave(p.u_t - p.u_h - VOLTAGE, "open"),), 1.0, CLOSED),
            )
        )

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(ACROSS / (p.R_on if p.form == CLOSED else p.R_off), ("p", "n"))

    def signals(self) -> dict[str, Signal]:
        """Its voltage, and the current from p to n."""
        return {**DELIVERED, "i": Signal("through", ("p", None), ELECTRICAL)}


@component
class TransmissionLine(Component):
    """A lossless line between two nodes of a circuit, whose other conductor is the reference.

    Law: what leaves one end arrives at the other after the delay, u + Z_0 i there = u - Z_0 i here, with i into the
    line. Mechanical analogue: a shaft as a `Wave`. SPICE: T. Source: Bergeron 1949.
    """

    Z_0: float = parameter("ohm", "impedance: voltage over current of a wave", above=0)
    delay: float = parameter("s", "time from one end to the other", above=0, latex="T")

    ports: ClassVar = (Port("a", ELECTRICAL), Port("b", ELECTRICAL))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield DelayLine(1 / p.Z_0, p.delay, ("a", "b"))

    def signals(self) -> dict[str, Signal]:
        """Voltage of each end, and the current into the line there."""
        ends = ("a", "b")
        voltages = {f"u_{end}": Signal("across", (end, None), ELECTRICAL) for end in ends}
        return {**voltages, **{f"i_{end}": Signal("through", (end, None), ELECTRICAL) for end in ends}}


class LineSection(TransmissionLine):
    """One section of a line, an inductor between two capacitors: it stands as the line does, without waves."""

    declared: ClassVar = TransmissionLine.declared

    def branches(self, p: Any) -> Iterator[Branch]:
        for end in ("a", "b"):
            yield AcrossStore(p.delay / p.Z_0 / 2, (end, None), f"u_{end}")
        yield ThroughStore(1 / (p.delay * p.Z_0), ("a", "b"), "i_c")
