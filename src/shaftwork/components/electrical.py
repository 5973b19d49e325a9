"""Electrical parts, as far as motors and their supplies need them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import And, Heaviside, Not

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import (
    ACROSS,
    INTEGRAL,
    AcrossLaw,
    AcrossStore,
    Branch,
    ThroughLaw,
    ThroughStore,
    rigid,
)
from shaftwork.components.friction import STUCK, conducting
from shaftwork.components.modes import ANEW, Leave, Mode, Modes
from shaftwork.components.timing import ends, is_past, onset, refuse_no_time_on
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.parameters import parameter

TERMINALS = (Port("p", ELECTRICAL), Port("n", ELECTRICAL))


@component
class Resistor(Component):
    """A resistor. Law: i = u / R."""

    R: float = parameter("ohm", "resistance", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(ACROSS / p.R)


@component
class Inductor(Component):
    """An inductor. Law: u = L di/dt. Mechanical analogue: a shaft of compliance L."""

    L: float = parameter("H", "inductance", at_least=0)

    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(1 / p.L)


@component
class Capacitor(Component):
    """A capacitor. Law: i = C du/dt. Mechanical analogue: an inertia C."""

    C: float = parameter("F", "capacitance", at_least=0)

    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.C)


@component
class VoltageSource(Component):
    """A voltage from n to p. Law: u_p - u_n = u(t). The signal i is the current delivered at p."""

    u: Any = parameter("V", "voltage", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossLaw(p.u)


@component
class CurrentSource(Component):
    """A current delivered at p and taken from n. Law: i(t, u)."""

    i: Any = parameter("A", "current", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-p.i)


@component
class Switch(Component):
    """An ideal switch between two nodes of a circuit.

    Law: u = 0 while closed, i = 0 while open. It closes at t_on; with `on`, a law of time alone, it is closed while
    that is above zero, from t_on on; with one that reads u, from when that rises above zero. It opens for good at
    t_off, which must be later than t_on. Modes: open, closed. A current that an inductance drives and that finds no
    other way is cut off at once, with its energy lost in the switch; a diode, or a switch that closes at the same
    instant, lets it flow on.
    """

    t_on: float = parameter("s", "time at which it closes", default=0.0, latex=r"t_{on}")
    t_off: float | None = parameter("s", "time at which it opens", default=None, latex=r"t_{off}")
    on: Any = parameter(
        "1", "closed while this law of t is above zero, or from when one of u is", law=True, default=None
    )

    role: ClassVar[Role] = "loss"
    ports: ClassVar = TERMINALS

    def __post_init__(self) -> None:
        refuse_no_time_on(self, "closes")

    def modes(self, p: Any) -> Iterator[Modes]:
        timed = p.on is not None and not p.on.free_symbols & {ACROSS, INTEGRAL}
        law = 2 * Heaviside(p.on, 0) - 1 if timed else p.on  # of a law that is zero for a while too
        begins, past = onset(p, law), is_past(p)
        on = And(begins >= 0 if p.on is None else begins > 0, Not(past))
        opens = (Leave(-law, "open"),) if timed else ()
        yield Modes(
            (
                Mode("open", (Leave(begins, ANEW),), starts=And(Not(on), Not(past))),
                Mode("closed", (*ends(p, "over"), *opens), 1.0, STUCK, starts=on),
                Mode("over", starts=past, says="open"),
            )
        )

    def branches(self, p: Any) -> Iterator[Branch]:
        if p.form == STUCK:
            yield rigid(("p", "n"))


@component
class Diode(Component):
    """An ideal diode from p to n.

    Law: u = 0 and i >= 0 while it conducts, i = 0 and u <= 0 while it blocks. Modes: blocking, conducting.
    Mechanical analogue: a freewheel.
    """

    role: ClassVar[Role] = "loss"
    ports: ClassVar = TERMINALS

    def modes(self, p: Any) -> Iterator[Modes]:  # noqa: ARG002
        yield conducting("blocking", "conducting")

    def branches(self, p: Any) -> Iterator[Branch]:
        if p.form == STUCK:
            yield rigid(("p", "n"))
