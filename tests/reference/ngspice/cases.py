"""Five drive trains, each typed twice by hand: as an equivalent circuit for ngspice and as a list of parts.

Mobility analogy: speed is voltage, torque and force are current; an inertia or mass is a capacitor to ground, a spring
an inductor of 1/c, a damper a resistor of 1/d, a gear or drum an ideal transformer made of controlled sources. The
circuit starts at rest (all voltages and currents zero). A current source `I from to` takes its current from `from` and
gives it to `to`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """A part as neutral data: component type, name, nodes and parameter values in SI units."""

    type: str
    name: str
    nodes: tuple[str, ...]
    values: dict[str, float]


@dataclass(frozen=True)
class Case:
    """One drive train in both forms.

    Args:
        name: short name.
        netlist: the circuit, without analysis or output lines.
        parts: the same train as parts.
        signals: pairs of an ngspice expression and the quantity "part.quantity" that it equals.
        t_end: end time in s.
    """

    name: str
    netlist: str
    parts: tuple[Part, ...]
    signals: tuple[tuple[str, str], ...]
    t_end: float


TWO_INERTIAS = Case(
    name="two inertias and a damped spring under a torque step",
    netlist="""
Itorque 0 a 12
CJ1 a 0 2.0
Vshaft a s 0
Lshaft s b {1/800}
Rshaft s b {1/1.5}
CJ2 b 0 3.5
""",
    parts=(
        Part("TorqueSource", "motor", ("a",), {"tau": 12.0}),
        Part("Inertia", "J1", ("a",), {"J": 2.0}),
        Part("Spring", "shaft", ("a", "b"), {"c": 800.0, "d": 1.5}),
        Part("Inertia", "J2", ("b",), {"J": 3.5}),
    ),
    signals=(("v(a)", "J1.omega"), ("v(b)", "J2.omega"), ("i(Vshaft)", "shaft.tau")),
    t_end=1.0,
)

# J2 moves with J1 and J4 with J3: of four inertias two are states. Each gear is a voltage source ratio * v(slow side)
# on its fast side, whose current comes out ratio times larger on the slow side.
GEARED_TRAIN = Case(
    name="geared train with dependent inertias",
    netlist="""
Itorque 0 a 5
CJ1 a 0 0.05
Vgear1 a a1 0
Egear1 a1 0 b 0 4
Fgear1 0 b Vgear1 4
CJ2 b 0 0.6
Vshaft b s 0
Lshaft s c {1/1500}
Rshaft s c {1/2.0}
CJ3 c 0 0.3
Vgear2 c c1 0
Egear2 c1 0 d 0 -2.5
Fgear2 0 d Vgear2 -2.5
CJ4 d 0 8
Rbrake d 0 {1/3.0}
""",
    parts=(
        Part("TorqueSource", "motor", ("a",), {"tau": 5.0}),
        Part("Inertia", "J1", ("a",), {"J": 0.05}),
        Part("Gear", "gear1", ("a", "b"), {"ratio": 4.0}),
        Part("Inertia", "J2", ("b",), {"J": 0.6}),
        Part("Spring", "shaft", ("b", "c"), {"c": 1500.0, "d": 2.0}),
        Part("Inertia", "J3", ("c",), {"J": 0.3}),
        Part("Gear", "gear2", ("c", "d"), {"ratio": -2.5}),
        Part("Inertia", "J4", ("d",), {"J": 8.0}),
        Part("Ground", "frame", ("frame",), {}),
        Part("Damper", "brake", ("d", "frame"), {"d": 3.0}),
    ),
    signals=(
        ("v(a)", "J1.omega"),
        ("v(b)", "J2.omega"),
        ("v(c)", "J3.omega"),
        ("v(d)", "J4.omega"),
        ("i(Vshaft)", "shaft.tau"),
    ),
    t_end=1.0,
)

# The load hangs on a rope that is straight but unloaded at the start.
HOIST = Case(
    name="drum hoisting a mass on an elastic rope",
    netlist="""
Itorque 0 a 60
CJ1 a 0 0.8
Rbearing a 0 {1/0.2}
Vdrum1 a a1 0
Edrum1 a1 0 x 0 {1/0.15}
Fdrum1 0 x Vdrum1 {1/0.15}
Vrope x s 0
Lrope s y {1/40000}
Rrope s y {1/120}
Cload y 0 25
Rguide y 0 {1/8.0}
Iweight y 0 245.25
""",
    parts=(
        Part("TorqueSource", "motor", ("a",), {"tau": 60.0}),
        Part("Inertia", "J1", ("a",), {"J": 0.8}),
        Part("Ground", "frame", ("frame",), {}),
        Part("Damper", "bearing", ("a", "frame"), {"d": 0.2}),
        Part("Drum", "drum", ("a", "x"), {"radius": 0.15}),
        Part("TranslationalSpring", "rope", ("x", "y"), {"c": 40000.0, "d": 120.0}),
        Part("Mass", "load", ("y",), {"m": 25.0}),
        Part("Ground", "wall", ("wall",), {}),
        Part("TranslationalDamper", "guide", ("y", "wall"), {"d": 8.0}),
        Part("ForceSource", "weight", ("y",), {"f": -245.25}),
    ),
    signals=(("v(a)", "J1.omega"), ("v(y)", "load.v"), ("i(Vrope)", "rope.f")),
    t_end=1.0,
)

DC_MOTOR = Case(
    name="DC motor behind a filter, driving an inertia with viscous load",
    netlist="""
Vsupply p1 0 48
Rcable p1 p2 0.2
Lchoke p2 p 1m
Cfilter p 0 5m
Vmotor p r 0
Rarmature r l 0.4
Larmature l e 2m
Eemf e 0 w 0 0.35
Ftorque 0 w Vmotor 0.35
CJ1 w 0 0.02
Rfan w 0 {1/0.004}
""",
    parts=(
        Part("Ground", "earth", ("n",), {}),
        Part("VoltageSource", "supply", ("p1", "n"), {"u": 48.0}),
        Part("Resistor", "cable", ("p1", "p2"), {"R": 0.2}),
        Part("Inductor", "choke", ("p2", "p"), {"L": 1e-3}),
        Part("Capacitor", "filter", ("p", "n"), {"C": 5e-3}),
        Part("DCMachine", "motor", ("p", "n", "rotor"), {"k": 0.35, "R": 0.4, "L": 2e-3}),
        Part("Inertia", "J1", ("rotor",), {"J": 0.02}),
        Part("Ground", "frame", ("frame",), {}),
        Part("Damper", "fan", ("rotor", "frame"), {"d": 0.004}),
    ),
    signals=(("v(w)", "J1.omega"), ("v(p)", "filter.u"), ("i(Vmotor)", "motor.i"), ("0.35*i(Vmotor)", "motor.tau")),
    t_end=0.4,
)

# v(sun) = 4 v(carrier) - 3 v(ring): of the current that the sun gives to the gear, 4 times as much comes out at the
# carrier and 3 times as much is drawn from the ring.
PLANETARY = Case(
    name="planetary gear with its ring held by a spring and a damper",
    netlist="""
Imotor 0 sun 8
Csun sun 0 0.03
Vgear sun g1 0
Ecarrier g1 g2 carrier 0 4
Ering g2 0 0 ring 3
Fcarrier 0 carrier Vgear 4
Fring ring 0 Vgear 3
Ccarrier carrier 0 1.2
Rload carrier 0 {1/5.0}
Iload carrier 0 6
Cring ring 0 0.15
Vhold ring h 0
Lhold h 0 {1/2500}
Rhold h 0 {1/4.0}
""",
    parts=(
        Part("TorqueSource", "motor", ("sun",), {"tau": 8.0}),
        Part("Inertia", "J_sun", ("sun",), {"J": 0.03}),
        Part("PlanetaryGear", "gear", ("sun", "carrier", "ring"), {"ratio": 3.0}),
        Part("Inertia", "J_carrier", ("carrier",), {"J": 1.2}),
        Part("Ground", "frame", ("frame",), {}),
        Part("Damper", "bearing", ("carrier", "frame"), {"d": 5.0}),
        Part("TorqueSource", "load", ("carrier",), {"tau": -6.0}),
        Part("Inertia", "J_ring", ("ring",), {"J": 0.15}),
        Part("Spring", "hold", ("ring", "frame"), {"c": 2500.0, "d": 4.0}),
    ),
    signals=(
        ("v(sun)", "J_sun.omega"),
        ("v(carrier)", "J_carrier.omega"),
        ("v(ring)", "J_ring.omega"),
        ("i(Vhold)", "hold.tau"),
    ),
    t_end=1.0,
)

CASES = (TWO_INERTIAS, GEARED_TRAIN, HOIST, DC_MOTOR, PLANETARY)
