"""Inertias, springs, dampers and gears; masses on a line; the drum and wheel between the two."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Integer

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import (
    ACROSS,
    AcrossStore,
    Branch,
    IdealCoupling,
    LossyCoupling,
    ThroughLaw,
    ThroughStore,
    rigid,
    through_of,
)
from shaftwork.components.modes import Leave, Mode, Modes
from shaftwork.core.domains import ROTATION, TRANSLATION
from shaftwork.core.parameters import parameter

DRIVING, DRIVEN, STUCK = "driving", "driven", "stuck"
MESH, AT_A, AT_B = "mesh", "a", "b"


@component
class Inertia(Component):
    """A rigid rotating mass: rotor, disc, flywheel; or an arm or mechanism whose inertia changes.

    Law: tau = J d(omega)/dt. Of a law J(phi, t), tau = d(J omega)/dt - J_phi omega^2 / 2, with phi the angle of its
    node from the start, or from `name.phi` among the start values: the momentum is J omega and the energy J
    omega^2 / 2. The mechanism that changes J over time takes the power J_t omega^2 / 2, counted as lost, or gives it
    where that is negative. J must stay above zero and must not jump. Analogue: a capacitor J to the reference.
    Source: Popenda 2019, (1)-(3); of a law: Lagrange's equation.
    """

    J: Any = parameter("kg*m^2", "moment of inertia, also over its angle or time", at_least=0, law=True)

    ports: ClassVar = (Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.J)


@component
class Spring(Component):
    """A massless shaft between two nodes: torsional stiffness with internal damping beside it.

    Law: tau = tau_c + d omega_rel, d(tau_c)/dt = c omega_rel, with tau the torque that node a gives to node b. Of a law
    c(phi, t), tau = c phi + d omega_rel, with phi the twist of a against b: it stores the integral of c phi over the
    twist; energy that a change over time gives or takes counts as lost. Analogue: an inductor 1/c beside a conductance
    d.
    Source: Popenda 2019, (2), (4); Marinkovic 2012, (14), (17).
    """

    c: Any = parameter("N*m/rad", "torsional stiffness, also over its twist or time", at_least=0, law=True)
    d: float = parameter("N*m*s/rad", "internal damping", at_least=0, default=0.0)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(p.c, label="tau_c")
        yield ThroughLaw(p.d * ACROSS)


@component
class Damper(Component):
    """Viscous friction between two nodes, or between a node and the frame (bearing).

    Law: tau = d omega_rel. Analogue: a conductance d. Source: Popenda 2019, (1), (3).
    """

    d: float = parameter("N*m*s/rad", "damping", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)


@component
class Ground(Component):
    """The frame: holds its node at rest (in a circuit: at zero potential).

    Law: omega = 0. Analogue: the reference node. The signal reaction is the torque that the node gives to it.
    """

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", None),)

    def branches(self, p: Any) -> Iterator[Branch]:  # noqa: ARG002
        yield IdealCoupling(((Integer(1), "a", None),))


@component
class Gear(Component):
    """An ideal gear between shafts a and b, without inertia, compliance or loss.

    Law: omega_a = ratio omega_b, tau_b = -ratio tau_a. Analogue: an ideal transformer. Source: Marinkovic 2012, (18).
    """

    ratio: float = parameter(
        "1", "speed of a over speed of b; negative for a pair that reverses", nonzero=True, latex="i"
    )

    role: ClassVar[Role] = "coupling"

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((Integer(1), "a", None), (-p.ratio, "b", None)))


@component
class PlanetaryGear(Component):
    """An ideal planetary gear.

    Law: omega_sun + ratio omega_ring = (1 + ratio) omega_carrier (Willis). Analogue: a three-winding transformer.
    """

    ratio: float = parameter("1", "teeth of the ring over teeth of the sun", above=0, latex="i")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("sun"), Port("carrier"), Port("ring"))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((Integer(1), "sun", None), (p.ratio, "ring", None), (-(1 + p.ratio), "carrier", None)))


@component
class LossyGear(Component):
    """A gear between shafts a and b whose teeth rub: a part of the power is lost, and at rest it may hold.

    Law: omega_a = ratio omega_b. While a drives, tau_b = -ratio efficiency tau_a; while b drives,
    tau_a = -efficiency_back tau_b / ratio. At rest both are held as long as neither side overcomes the loss: it starts
    where efficiency tau_a + tau_b / ratio and tau_a + efficiency_back tau_b / ratio have the same sign, with the
    torques that the held nodes give to it. An efficiency_back of zero or less makes the gear self-locking: b alone
    cannot turn it, and a must drive too before it turns in the direction of b. Modes: driving, driven
    (each forward, where omega_a > 0, or backward), stuck.

    A self-locking gear that would have to brake more inertia than there is on the side of a has no motion with b
    driving: it stops at once. Behind a bare spring, with no inertia at node a, it would stop and start without end; a
    run refuses that. A rigid impact acts on the gear as torques do: it may go on, stop or reverse. The energy lost in
    it is counted as the gear's.
    Analogue: a transformer with different ratios of voltages and currents. Source: Pelchen, Schweiger and Otter 2002.
    """

    ratio: float = parameter(
        "1", "speed of a over speed of b; negative for a pair that reverses", nonzero=True, latex="i"
    )
    efficiency: float = parameter(
        "1", "share of the power that b gets while a drives", above=0, at_most=1, latex=r"\eta"
    )
    efficiency_back: float | None = parameter(
        "1",
        "that share while b drives, by default the same; zero or less where b cannot drive",
        at_most=1,
        default=None,
        latex=r"\eta_b",
    )

    role: ClassVar[Role] = "coupling"

    def modes(self, p: Any) -> Iterator[Modes]:
        at_a, at_b = through_of(AT_A), through_of(AT_B) / p.ratio
        ahead, back = p.efficiency * at_a + at_b, at_a + _back(p) * at_b
        yield Modes((*_moving(1), *_moving(-1), *_held(ahead, back)), ends=("a", None))

    def branches(self, p: Any) -> Iterator[Branch]:
        terms = ((Integer(1), "a", None), (-p.ratio, "b", None))
        if p.form == STUCK:
            yield rigid(("a", None), AT_A)
            yield rigid(("b", None), AT_B)
        elif p.form == DRIVEN:
            yield LossyCoupling(terms, (_back(p), -p.ratio), MESH)
        else:
            yield LossyCoupling(terms, (Integer(1), -p.ratio * p.efficiency), MESH)


def _back(p: Any) -> Any:
    return p.efficiency if p.efficiency_back is None else p.efficiency_back


def _moving(direction: int) -> Iterator[Mode]:
    """Turning one way: power goes from a to b while the torque in the mesh has the sign of the speed."""
    torque, word = direction * through_of(MESH), "forward" if direction > 0 else "backward"
    stops, turns = -direction * ACROSS, direction * ACROSS > 0
    driving, driven = f"{DRIVING} {word}", f"{DRIVEN} {word}"
    yield Mode(driving, (Leave(-torque, driven), Leave(stops, _flank(direction))), direction, DRIVING, turns)
    yield Mode(driven, (Leave(torque, driving), Leave(stops, _flank(-direction))), direction, DRIVEN, turns)


def _flank(side: int) -> str:
    """At rest teeth are pressed on one flank or the other, a pushing forward or backward."""
    return "stuck" if side > 0 else "stuck on the other flank"


def _held(ahead: Any, back: Any) -> Iterator[Mode]:
    """At rest, with the flank that carries the load: from there it turns on, gives way, or the load changes sides.

    The last is beyond both other limits, by more than either.
    """
    for side, (on, off) in ((1, ("forward", "backward")), (-1, ("backward", "forward"))):
        leaves = (
            Leave(side * ahead, f"{DRIVING} {on}"),
            Leave(-side * back, f"{DRIVEN} {off}"),
            Leave(side * (ahead - back), _flank(-side)),
        )
        yield Mode(_flank(side), leaves, float(side), STUCK, says="stuck")


@component
class Mass(Component):
    """A rigid translating mass. Law: f = m dv/dt; of a law m(s, t) as of an `Inertia`. Analogue: a capacitor m.

    Source: Abdelkader 2016, (6).
    """

    m: Any = parameter("kg", "mass, also over its position or time", at_least=0, law=True)

    ports: ClassVar = (Port("a", TRANSLATION),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.m)


@component
class TranslationalSpring(Component):
    """A massless rod or spring with internal damping beside it. It pushes as it pulls; what only pulls is a `Rope`.

    Law: f = f_c + d v_rel, d(f_c)/dt = c v_rel; of a law c(s, t) as of a `Spring`. Analogue: an inductor 1/c beside a
    conductance d.
    """

    c: Any = parameter("N/m", "stiffness, also over its stretch or time", at_least=0, law=True)
    d: float = parameter("N*s/m", "internal damping", at_least=0, default=0.0)

    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(p.c, label="f_c")
        yield ThroughLaw(p.d * ACROSS)


@component
class TranslationalDamper(Component):
    """Viscous friction between two nodes, or a node and the frame. Law: f = d v_rel. Analogue: conductance d."""

    d: float = parameter("N*s/m", "damping", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION, optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)


@component
class Drum(Component):
    """A rope drum, pinion or pulley: node a rotates, node b translates.

    Law: v_b = radius omega_a, tau_a = -radius f_b. Analogue: an ideal transformer. Source: Abdelkader 2016, (6).
    """

    radius: float = parameter("m", "radius", nonzero=True, latex="r")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", ROTATION), Port("b", TRANSLATION))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((p.radius, "a", None), (Integer(-1), "b", None)))


@component
class Wheel(Component):
    """A wheel that rolls without slip: node a rotates, node b translates.

    Law: v_b = radius omega_a. Analogue: an ideal transformer. Source: Marinkovic 2012, (7).
    """

    radius: float = parameter("m", "rolling radius", nonzero=True, latex="r")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", ROTATION), Port("b", TRANSLATION))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((p.radius, "a", None), (Integer(-1), "b", None)))
