"""Brushless direct-current motors: the three phases at a six-step inverter, and their average as one circuit."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, ClassVar

from sympy import Abs, Expr, Integer, Max, Min, Rational, asin, cos, pi, sin

from shaftwork.components.base import Component, Port, Role, Signal, component
from shaftwork.components.branches import (
    ACROSS,
    INTEGRAL,
    AcrossLaw,
    AcrossStore,
    Branch,
    ThroughLaw,
    ThroughStore,
    across_of,
    integral_of,
    through_of,
)
from shaftwork.components.electrical import ROTOR
from shaftwork.components.laws import PWM, as_expression, larger, no_less, smaller
from shaftwork.components.modes import ANEW, Leave, Mode, Modes
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter

PHASES = {"a": Integer(0), "b": 2 * pi / 3, "c": -2 * pi / 3}
"""By how much the electrical angle of each phase lags that of phase a."""
OPEN = "open"
EDGE = Rational(1, 2)
"""Sine of the angle at which a switch closes or opens: 30 degrees."""


@lru_cache(maxsize=64)
def _shape(angle: Expr, flat: Any) -> Expr:
    """A trapezoid of amplitude one over the electrical angle, in phase with its sine."""
    edge = cos(flat / 2)
    return 2 * asin(Max(-edge, Min(edge, sin(angle)))) / (pi - flat)


@component
class BLDCMotor(Component):
    """A brushless DC motor fed with voltage by a six-step inverter that the angle of its rotor commutates.

    Law: in each phase u = R i + L di/dt + k f(theta) omega + u_n, the sum of the currents zero, and
    tau = k (f_a i_a + f_b i_b + f_c i_c); f is a trapezoid whose flat tops are `flat` wide, theta_a = pole_pairs phi,
    b and c lag by 120 and 240 degrees. Each leg of the inverter puts its phase to +U/2 for 30 < theta < 150 degrees, to
    -U/2 for 210 < theta < 330, whatever the current's sign; between them the current goes on through a diode to the
    other side until it is zero, and the phase is open until a diode conducts again. After `dead_time` a switch follows
    the one before it, at the speed of that instant. The inductance of a phase has its share of the mutual ones in it,
    L = L_mu + L_sigma. U may be a law, of pulses of a chopper before the inverter for one, 540 * PWM(0.3, 8e3): at zero
    and below the legs of the inverter short the motor.

    With i_ref a PI controller with limits holds i = (|i_a| + |i_b| + |i_c|) / 2 by such pulses: u = k_p (i_ref - i) +
    u_i, du_i/dt = k_p / t_i (i_ref - i) + (min(U, max(0, u)) - u) / t_i, and U is on while u / U is above the carrier
    of f_c; without t_i there is no u_i. Below zero i_ref counts as zero: no pulses brake.

    Rotor inertia is a part of its own. Modes of each leg: high, low, freewheeling high, freewheeling low, open.
    Analogue: three transformers whose ratios turn with the rotor. Source: Popenda 2019, figs 4-13.
    """

    U: Any = parameter("V", "direct voltage of the inverter, also over time or the rotor's speed", at_least=0, law=True)
    R: float = parameter("ohm", "resistance of a phase", at_least=0)
    L: float = parameter("H", "inductance of a phase", above=0)
    k: float = parameter("V*s/rad", "flat back EMF of a phase over speed; its torque over current", above=0)
    pole_pairs: float = parameter("1", "number of pole pairs", above=0, whole=True, default=1.0, latex="p")
    flat: float = parameter(
        "rad", "electrical angle of the flat top", above=0, at_most=3, default=2 * 3.141592653589793 / 3, latex=r"\beta"
    )
    dead_time: float = parameter("s", "delay of every switch that closes", at_least=0, default=0.0, latex=r"t_d")
    i_ref: Any = parameter(
        "A",
        "current to be held, over time or the rotor's speed; by default none",
        at_least=0,
        law=True,
        default=None,
        latex="i_{ref}",
    )
    k_p: float | None = parameter("V/A", "gain of the current controller", above=0, default=None)
    t_i: float | None = parameter("s", "integral time of the current controller", above=0, default=None)
    f_c: float | None = parameter("Hz", "frequency of the chopper's carrier", above=0, default=None)

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("rotor"),)
    signal_ports: ClassVar = frozenset({"control"})
    inner: ClassVar = (
        *(Port(f"{place}_{phase}", ELECTRICAL) for phase in PHASES for place in ("leg", "winding", "emf")),
        Port("star", ELECTRICAL),
    )

    def branches(self, p: Any) -> Iterator[Branch]:
        shapes = {phase: _shape(_angle(p, phase), p.flat) for phase in PHASES}
        for phase, shape in shapes.items():
            leg, winding, emf = (f"{place}_{phase}" for place in ("leg", "winding", "emf"))
            if getattr(p, f"form_{phase}") != OPEN:
                yield AcrossLaw(getattr(p, f"mode_{phase}") * _bus(p) / 2, (leg, None), f"u_{phase}")
            yield ThroughLaw(ACROSS / p.R, (leg, winding), f"R_{phase}")
            yield ThroughStore(1 / p.L, (winding, emf), f"i_{phase}")
            yield AcrossLaw(p.k * shape * across_of("rotor"), (emf, "star"), f"u_e_{phase}")
        torque = p.k * sum(shape * through_of(f"i_{phase}") for phase, shape in shapes.items())
        yield ThroughLaw(-torque, ("rotor", None), "e")
        if all(getattr(p, f"form_{phase}") == OPEN for phase in PHASES):  # then nothing else holds the star point
            yield AcrossLaw(Integer(0), ("star", None), "u_star")
        if p.i_ref is not None and p.t_i is not None:
            wanted = _wanted(p)
            wound = (larger(0, smaller(_supply(p), wanted)) - wanted) / p.k_p
            yield AcrossStore(p.t_i / p.k_p, ("control", None), "u_i")
            yield ThroughLaw(-(_lag(p) + wound), ("control", None), "lag")

    def modes(self, p: Any) -> Iterator[Modes]:
        for phase in PHASES:
            yield _leg(p, phase)

    def inner_ports(self) -> tuple[Port, ...]:
        """Those of the circuit, and the integrator of the current controller where there is one."""
        integrates = self.i_ref is not None and self.t_i is not None
        return (*self.inner, Port("control", ELECTRICAL)) if integrates else self.inner

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.i_ref is None and self.t_i is not None:
            raise ParameterError(
                f"BLDCMotor '{self.name}': t_i controls nothing without i_ref. Give both, or leave it out."
            )
        for name in ("k_p", "f_c"):
            if (getattr(self, name) is None) != (self.i_ref is None):
                says = "controls nothing without i_ref" if self.i_ref is None else "is missing beside i_ref"
                raise ParameterError(
                    f"BLDCMotor '{self.name}': {name} {says}. Give i_ref, k_p and f_c, or none of them."
                )

    def signals(self) -> dict[str, Signal]:
        """Speed and torque of the rotor, currents into the phases and their voltages against the star point."""
        signals = dict(ROTOR)
        for phase in PHASES:
            signals[f"i_{phase}"] = Signal("store", (f"winding_{phase}", "star"), ELECTRICAL, 1, f"i_{phase}")
            signals[f"u_{phase}"] = Signal("across", (f"leg_{phase}", "star"), ELECTRICAL)
        return signals


def _angle(p: Any, phase: str) -> Expr:
    """The electrical angle of a phase."""
    return p.pole_pairs * integral_of("e") - PHASES[phase]


def _of_rotor(law: Any) -> Expr:
    """A law in which speed and angle are those of the rotor."""
    return as_expression(law).xreplace({ACROSS: across_of("rotor"), INTEGRAL: integral_of("e")})


def _supply(p: Any) -> Expr:
    """The direct voltage before the chopper."""
    return _of_rotor(no_less(p, "U", 0))


def _bus(p: Any) -> Expr:
    """The direct voltage of the inverter, behind the chopper where there is one."""
    if p.i_ref is None:
        return _supply(p)
    supply = _supply(p)
    # Below 1e-6 V the share of pulses stays as it is there: such a supply drives no current.
    divisor = supply if supply.is_Symbol else larger(supply, 1e-6)
    return supply * PWM(_wanted(p) / divisor, p.f_c)


def _lag(p: Any) -> Expr:
    """By how much the current in the phases that conduct is less than it is to be."""
    return _of_rotor(no_less(p, "i_ref", 0)) - sum(Abs(through_of(f"i_{phase}")) for phase in PHASES) / 2


def _wanted(p: Any) -> Expr:
    """The voltage that the current controller asks for."""
    return p.k_p * _lag(p) + (0 if p.t_i is None else across_of("control"))


def _leg(p: Any, phase: str) -> Modes:
    """A leg of the inverter: two switches, a diode beside each, and the mode in which none of them conducts."""
    angle, current, voltage = _angle(p, phase), through_of(f"i_{phase}"), across_of(f"leg_{phase}")
    turned = p.pole_pairs * across_of("rotor") * p.dead_time
    before = angle if turned == 0 else angle - turned
    above = sin(angle) - EDGE if turned == 0 else Min(sin(angle), sin(before)) - EDGE
    below = -sin(angle) - EDGE if turned == 0 else Min(-sin(angle), -sin(before)) - EDGE
    closes = (Leave(above, "high"), Leave(below, "low"))
    opens, half = ("upper diode", "lower diode"), _bus(p) / 2
    return Modes(
        (
            Mode("high", (Leave(EDGE - sin(angle), ANEW),), 1.0, starts=above > 0),
            Mode("low", (Leave(EDGE + sin(angle), ANEW),), -1.0, starts=below > 0),
            Mode(opens[0], (Leave(current, OPEN), *closes), 1.0, starts=current < 0, says="freewheeling high"),
            Mode(opens[1], (Leave(-current, OPEN), *closes), -1.0, starts=current > 0, says="freewheeling low"),
            Mode(OPEN, (Leave(voltage - half, opens[0]), Leave(-voltage - half, opens[1]), *closes), form=OPEN),
        ),
        label=phase,
    )


@component
class AveragedBLDC(Component):
    """The mean of a `BLDCMotor` over its commutations: two phases in series, as a direct-current machine.

    Law: U = 2 k omega + 2 R i + 2 L di/dt + u_c with u_c = (2 / pi) (1 + 2 k omega / U) pole_pairs L |omega| i, and
    tau = 2 k i. The phase that conducts on loses L i_0 / 2 at each of the six commutations in a turn, with
    i_0 = 2 i (U + 2 k omega) / (3 U) the current before them: it falls by i_0 (4 k omega - U) / (U + 2 k omega) while
    the others commutate, and rises again evenly. The diodes give the power of u_c back to the supply. It holds for flat
    tops of 120 degrees and more, little resistance, and a commutation that ends before the next begins.
    Analogue: a transformer. Source: Popenda 2019, figs 4-13; the term of commutation follows from its circuit.
    """

    U: float = parameter("V", "direct voltage of the inverter", above=0)
    R: float = parameter("ohm", "resistance of a phase", at_least=0)
    L: float = parameter("H", "inductance of a phase", above=0)
    k: float = parameter("V*s/rad", "flat back EMF of a phase over speed; its torque over current", above=0)
    pole_pairs: float = parameter("1", "number of pole pairs", above=0, whole=True, default=1.0, latex="p")

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("rotor"),)
    inner: ClassVar = tuple(Port(name, ELECTRICAL) for name in ("supply", "winding", "commutation", "emf"))

    def branches(self, p: Any) -> Iterator[Branch]:
        current, speed = through_of("i"), across_of("rotor")
        yield AcrossLaw(p.U, ("supply", None), "u")
        yield ThroughLaw(ACROSS / (2 * p.R), ("supply", "winding"), "R")
        yield ThroughStore(1 / (2 * p.L), ("winding", "commutation"), "i")
        impedes = 2 / pi * (1 + 2 * p.k * speed / p.U) * p.pole_pairs * p.L * Abs(speed)
        yield AcrossLaw(impedes * current, ("commutation", "emf"), "u_c")
        yield AcrossLaw(2 * p.k * speed, ("emf", None), "u_e")
        yield ThroughLaw(-2 * p.k * current, ("rotor", None), "e")

    def signals(self) -> dict[str, Signal]:
        """Speed and torque of the rotor, and the current of the two phases that conduct."""
        return {**ROTOR, "i": Signal("store", ("winding", "commutation"), ELECTRICAL, 1, "i")}
