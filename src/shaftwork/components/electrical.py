"""Electrical parts, as far as motors and their supplies need them, and machines as circuits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import And, Expr, Heaviside, Integer, Not, Piecewise, Rational, cos, pi, sin, sqrt

from shaftwork.components.base import Component, Port, Role, Signal, component
from shaftwork.components.branches import (
    ACROSS,
    INTEGRAL,
    AcrossLaw,
    AcrossStore,
    Branch,
    IdealCoupling,
    ThroughLaw,
    ThroughStore,
    across_of,
    readings_in,
    rigid,
    through_of,
)
from shaftwork.components.friction import STUCK, conducting, ends, is_past, onset
from shaftwork.components.laws import as_expression, i, q, t
from shaftwork.components.modes import ANEW, Leave, Mode, Modes
from shaftwork.components.motors import on_time
from shaftwork.components.switch_times import refuse_no_time_on
from shaftwork.core.domains import ELECTRICAL, ROTATION
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
class Transformer(Component):
    """An ideal transformer between the pairs of nodes p1, n1 and p2, n2.

    Law: u_1 = ratio u_2, i_2 = -ratio i_1, with u_1 from p1 to n1 and i_1 what p1 gives to it. Mechanical analogue: a
    gear.
    """

    ratio: float = parameter("1", "voltage u_1 over voltage u_2", nonzero=True, latex="n")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = tuple(Port(name, ELECTRICAL) for name in ("p1", "n1", "p2", "n2"))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((Integer(1), "p1", "n1"), (-p.ratio, "p2", "n2")))

    def signals(self) -> dict[str, Signal]:
        """Voltages and currents of both sides."""
        return {
            "u_1": Signal("across", ("p1", "n1"), ELECTRICAL),
            "i_1": Signal("through", ("p1", None), ELECTRICAL),
            "u_2": Signal("across", ("p2", "n2"), ELECTRICAL),
            "i_2": Signal("through", ("p2", None), ELECTRICAL),
        }


@component
class VoltageSource(Component):
    """A voltage from n to p. Law: u_p - u_n = u(t, i, q). The signal i is the current delivered at p.

    q is the charge that it has delivered since the start of the motion. A law that reads i or q needs an inductor in
    series with the source, whose current is a state: a motor in the dual of a drive train has that of its inertia.
    """

    u: Any = parameter("V", "voltage, also over its own current and charge", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = TERMINALS
    signal_ports: ClassVar[frozenset[str]] = frozenset({"charge"})
    letters: ClassVar = {i: -through_of("i"), q: across_of("charge")}

    def inner_ports(self) -> tuple[Port, ...]:
        """The charge, where the law reads it: the voltage of a capacitor of 1 F that carries the current."""
        return (Port("charge", ELECTRICAL),) if isinstance(self.u, Expr) and self.u.has(q) else ()

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossLaw(p.u, label="i" if readings_in(as_expression(p.u)) else "")
        if self.inner_ports():
            yield ThroughLaw(through_of("i"), ("charge", None), "counted")
            yield AcrossStore(Integer(1), ("charge", None), "q")


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
    t_off, which must be later than t_on. Modes: open, closed. A current of an inductance that has no other path is cut
    off at once, with its energy lost in the switch; a diode, or a switch that closes at the same instant, lets it flow
    on.
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


ROTOR = {
    "omega": Signal("across", ("rotor", None), ROTATION),
    "tau": Signal("through", ("rotor", None), ROTATION, -1),
}
"""Speed of the rotor, and the torque that the machine gives to it."""
AXES = ("alpha", "beta")
PHASES = Rational(3, 2)
"""How many phases an axis stands for."""


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
            **ROTOR,
        }


@component
class InductionMachine(Component):
    """A three-phase induction machine at a balanced sinusoidal supply, in stationary axes alpha and beta.

    Law: in each axis u = R_s i + d psi_s/dt, 0 = R_r i_r + d psi_r/dt - j p omega psi_r with alpha + j beta,
    psi_s = L_s_sigma i + L_m (i + i_r), psi_r = L_r_sigma i_r + L_m (i + i_r), and
    tau = 3/2 p L_m (i_m_alpha i_beta - i_m_beta i_alpha) with i_m = i + i_r. From t_on the phase voltage is
    sqrt(2/3) U (cos, sin)(2 pi f t); before it the windings are short-circuited. Rotor quantities are referred to the
    stator. Source: Park 1929; the axes are those of Clarke 1943, with the amplitude kept: i_alpha is the current of
    phase a. In the circuit an axis has 3/2 times the impedance and voltage of a phase, so that its power is that of the
    machine. With R_s = 0 its steady torque is exactly Kloss' curve.
    Analogue: a transformer whose secondary carries a back EMF.
    """

    U: float = parameter("V", "voltage between two lines, effective", above=0)
    f: float = parameter("Hz", "frequency of the supply", above=0)
    L_m: float = parameter("H", "magnetising inductance", above=0)
    L_s_sigma: float = parameter("H", "leakage inductance of the stator", above=0, latex=r"L_{s\sigma}")
    L_r_sigma: float = parameter("H", "leakage inductance of the rotor", at_least=0, latex=r"L_{r\sigma}")
    R_r: float = parameter("ohm", "rotor resistance", above=0)
    R_s: float = parameter("ohm", "stator resistance", at_least=0, default=0.0)
    pole_pairs: float = parameter("1", "number of pole pairs", above=0, whole=True, default=1.0, latex="p")
    t_on: float | None = on_time()

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("rotor"),)
    inner: ClassVar = tuple(
        Port(f"{place}_{axis}", ELECTRICAL) for axis in AXES for place in ("supply", "stator", "gap", "rotor", "emf")
    )

    def branches(self, p: Any) -> Iterator[Branch]:
        speed, linked = p.pole_pairs * across_of("rotor"), {axis: _rotor_flux(p, axis) for axis in AXES}
        phase = 2 * pi * p.f * t
        yield from self._axis(p, "alpha", cos(phase), -speed * linked["beta"])
        yield from self._axis(p, "beta", sin(phase), speed * linked["alpha"])
        (i_a, i_b), (m_a, m_b) = ([through_of(f"{name}_{axis}") for axis in AXES] for name in ("i", "i_m"))
        yield ThroughLaw(-PHASES * p.pole_pairs * p.L_m * (m_a * i_b - m_b * i_a), ("rotor", None), "e")

    def _axis(self, p: Any, axis: str, supply: Expr, emf: Expr) -> Iterator[Branch]:
        voltage = PHASES * sqrt(Rational(2, 3)) * p.U * supply
        switched = voltage if p.t_on is None else Piecewise((0, t < p.t_on), (voltage, True))
        names = ("supply", "stator", "gap", "rotor", "emf")
        supplied, stator, gap, rotor, moved = (f"{name}_{axis}" for name in names)
        yield AcrossLaw(switched, (supplied, None), f"u_{axis}")
        yield ThroughLaw(ACROSS / (PHASES * p.R_s), (supplied, stator), f"R_{axis}")
        yield AcrossLaw(PHASES * emf, (moved, None), f"u_r_{axis}")
        yield ThroughLaw(ACROSS / (PHASES * p.R_r), (moved, rotor), f"R_r_{axis}")
        yield ThroughStore(1 / (PHASES * p.L_r_sigma), (rotor, gap), f"i_r_{axis}")
        yield ThroughStore(1 / (PHASES * p.L_s_sigma), (stator, gap), f"i_{axis}")
        yield ThroughStore(1 / (PHASES * p.L_m), (gap, None), f"i_m_{axis}")

    def signals(self) -> dict[str, Signal]:
        """Speed and torque of the rotor, the currents of the stator, and those that magnetise."""
        labels = [(f"{name}_{axis}", f"gap_{axis}") for name in ("i", "i_m") for axis in AXES]
        return {
            **ROTOR,
            **{label: Signal("store", (gap, None), ELECTRICAL, 1, label) for label, gap in labels},
        }


def _rotor_flux(p: Any, axis: str) -> Expr:
    """Flux linkage of the rotor winding in the current of the stator and in that which magnetises."""
    stator, magnetising = through_of(f"i_{axis}"), through_of(f"i_m_{axis}")
    return p.L_m * magnetising + p.L_r_sigma * (magnetising - stator)
