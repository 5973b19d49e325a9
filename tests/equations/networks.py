"""Networks that the tests of the equations share."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from shaftwork.components.base import REGISTRY
from shaftwork.components.electrical import DCMachine, VoltageSource
from shaftwork.components.laws import omega, phi, t
from shaftwork.components.loads import CoulombLoad, ViscousLoad
from shaftwork.components.mechanics import (
    Damper,
    Drum,
    Gear,
    Ground,
    Inertia,
    Mass,
    PlanetaryGear,
    Spring,
    TranslationalDamper,
    TranslationalSpring,
    Wheel,
)
from shaftwork.components.motors import KlossMotor
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import ForceSource, SpeedSource, TorqueSource
from shaftwork.equations.kirchhoff import kirchhoff
from shaftwork.equations.records import Equations
from shaftwork.formulation.form import state_form
from shaftwork.network.graph import CircuitGraph, build_graph
from shaftwork.network.netlist import NetworkBuilder
from tests.reference.mna import Piece


def graph_of(net: NetworkBuilder) -> CircuitGraph:
    return build_graph(net.netlist())


def equations_of(net: NetworkBuilder) -> Equations:
    return kirchhoff(state_form(graph_of(net)))


def from_pieces(pieces: Iterable[Piece]) -> NetworkBuilder:
    net = NetworkBuilder("random network")
    for piece in pieces:
        net.add(REGISTRY[piece.type](piece.name, **piece.values), *piece.nodes)
    return net


def crane() -> NetworkBuilder:
    net = NetworkBuilder("crane travel")
    net.add(KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
    net.add(Inertia("J1", J=27.35), "rotor")
    net.add(Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(Inertia("J2", J=62.5), "wheel")
    net.add(CoulombLoad("load", tau=22.4), "wheel")
    return net


def shaft(model: ShaftModel, **values: float) -> NetworkBuilder:
    net = NetworkBuilder("shaft")
    net.add(TorqueSource("motor", tau=12.7), "motor end")
    net.add(Inertia("Je", J=0.025), "motor end")
    steel = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
    net.add(Shaft("line", **steel, **values, model=model, symbol=""), "motor end", "load end")
    net.add(Inertia("Jm", J=0.11), "load end")
    return net


def train(inertias: int = 50) -> NetworkBuilder:
    net = NetworkBuilder("train")
    for k in range(1, inertias + 1):
        net.add(Inertia(f"J{k}", J=0.1), f"n{k}")
        if k > 1:
            net.add(Spring(f"s{k - 1}", c=1e4, d=0.1), f"n{k - 1}", f"n{k}")
    net.add(TorqueSource("T", tau=1.0), "n1")
    net.add(ViscousLoad("load", d=0.3), f"n{inertias}")
    return net


def mixed_train(cells: int = 12) -> NetworkBuilder:
    """Some 50 different parts: motor, gears, bearings, a drum with its rope."""
    net = NetworkBuilder("hoist with 50 parts")
    net.add(KlossMotor("motor", tau_k=90.0, s_k=0.2, n_sync=1500), "n0")
    net.add(Inertia("rotor", J=0.4), "n0")
    for k in range(1, cells + 1):
        net.add(Spring(f"shaft{k}", c=1e4 * k, d=0.1 if k % 2 else 0.0), f"n{k - 1}", f"m{k}")
        net.add(Gear(f"gear{k}", ratio=1.0 + 0.25 * k), f"m{k}", f"n{k}")
        net.add(Inertia(f"wheel{k}", J=0.1 * k), f"n{k}")
        net.add(Damper(f"bearing{k}", d=0.01), f"n{k}")
    net.add(Drum("drum", radius=0.2), f"n{cells}", "rope")
    net.add(TranslationalSpring("rope", c=1e6, d=200.0), "rope", "hook")
    net.add(Mass("load", m=800.0), "hook")
    net.add(ForceSource("weight", f=-7848.0), "hook")
    return net


def hoist() -> NetworkBuilder:
    """Planetary gear with three inertias, springs in series, a massless node, a prescribed speed behind a gear."""
    net = NetworkBuilder("planetary hoist")
    for name, value, node in (("Jm", 0.1, "sun"), ("Jc", 0.4, "carrier"), ("Jr", 0.7, "ring"), ("Je", 2.0, "end")):
        net.add(Inertia(name, J=value), node)
    net.add(PlanetaryGear("planetary", ratio=3.0), "sun", "carrier", "ring")
    net.add(TorqueSource("motor", tau=10.0), "sun")
    net.add(Spring("s1", c=100.0), "carrier", "middle")
    net.add(Spring("s2", c=200.0), "middle", "end")
    net.add(Spring("a", c=100.0, d=1.0), "end", "x")
    net.add(Damper("b", d=5.0), "x", "wall")
    net.add(Ground("frame"), "wall")
    net.add(SpeedSource("drive", omega=3.0 * t), "drive")
    net.add(Gear("g2", ratio=2.0), "drive", "input")
    net.add(Inertia("Jd", J=1.0), "input")
    net.add(Spring("s3", c=50.0, d=0.5), "input", "ring")
    return net


def dc_drive() -> NetworkBuilder:
    net = NetworkBuilder("DC drive")
    net.add(VoltageSource("supply", u=24.0), "p", "ground")
    net.add(DCMachine("M", k=0.05, R=0.3, L=1e-3), "p", "ground", "rotor")
    net.add(Inertia("J", J=1e-3), "rotor")
    net.add(Gear("gear", ratio=10.0), "rotor", "out")
    net.add(Inertia("table", J=0.2), "out")
    net.add(Damper("bearing", d=1e-3), "rotor")
    return net


def _two_inertias(*between: tuple[object, str, str]) -> NetworkBuilder:
    net = NetworkBuilder("two inertias")
    net.add(Inertia("J1", J=1.0), "a")
    net.add(Inertia("J2", J=2.0), "b")
    net.add(TorqueSource("motor", tau=5.0), "a")
    for part, *nodes in between:
        net.add(part, *nodes)
    return net


def _lifted_mass() -> NetworkBuilder:
    net = NetworkBuilder("lifted mass")
    net.add(Inertia("J", J=0.5), "shaft")
    net.add(Drum("drum", radius=0.1), "shaft", "rope")
    net.add(TranslationalSpring("rope", c=1e4, d=3.0), "rope", "hook")
    net.add(Mass("load", m=50.0), "hook")
    net.add(ForceSource("weight", f=-490.5), "hook")
    net.add(TorqueSource("motor", tau=60.0 - 0.1 * omega), "shaft")
    return net


def _rolling() -> NetworkBuilder:
    net = NetworkBuilder("rolling")
    net.add(Inertia("J", J=0.5), "axle")
    net.add(Wheel("wheel", radius=0.3), "axle", "body")
    net.add(Mass("body", m=900.0), "body")
    net.add(TranslationalDamper("air", d=4.0), "body")
    net.add(KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500, ratio=8.0), "axle")
    return net


def _pendulum() -> NetworkBuilder:
    net = _two_inertias((Spring("s", c=10.0), "a", "b"))
    net.add(TorqueSource("gravity", tau=-9.81 * phi - 0.2 * omega * abs(omega)), "b")
    return net


def _driven_behind_gear() -> NetworkBuilder:
    net = _two_inertias((Spring("s", c=10.0, d=0.1), "a", "b"))
    net.add(SpeedSource("drive", omega=2.0 * t**2), "d")
    net.add(Gear("g", ratio=3.0), "d", "e")
    net.add(Inertia("J3", J=0.3), "e")
    net.add(PlanetaryGear("p", ratio=2.0), "e", "a", "r")
    net.add(Inertia("J4", J=0.4), "r")
    return net


def _redundant_gears() -> NetworkBuilder:
    net = _two_inertias((Gear("g1", ratio=2.0), "a", "b"), (Gear("g2", ratio=3.0), "b", "c"))
    net.add(Inertia("J3", J=0.3), "c")
    net.add(Gear("g3", ratio=6.0), "a", "c")
    net.add(Spring("s", c=10.0), "c", "ground")
    return net


MECHANICAL: dict[str, Callable[[], NetworkBuilder]] = {
    "crane": crane,
    "short train": lambda: train(5),
    "planetary hoist": hoist,
    "gear and spring": lambda: _two_inertias((Gear("g", ratio=3.0), "a", "m"), (Spring("s", c=9.0, d=1.0), "m", "b")),
    "geared inertias": lambda: _two_inertias((Gear("g", ratio=-3.0), "a", "b"), (Damper("d", d=1.0), "b", "ground")),
    "springs in series": lambda: _two_inertias((Spring("s1", c=9.0), "a", "m"), (Spring("s2", c=3.0), "m", "b")),
    "three springs meet": lambda: _two_inertias(
        (Spring("s1", c=9.0), "a", "m"), (Spring("s2", c=3.0, d=1.0), "m", "b"), (Spring("s3", c=1.0), "m", "ground")
    ),
    "spring and damper in series": lambda: _two_inertias(
        (Spring("s1", c=9.0), "a", "m"), (Damper("d1", d=3.0), "m", "b")
    ),
    "ring of springs": lambda: _two_inertias((Spring("s1", c=9.0), "a", "b"), (Spring("s2", c=3.0), "b", "a")),
    "spring to the frame": lambda: _two_inertias(
        (Spring("s1", c=9.0), "a", "b"), (Spring("s2", c=3.0), "b", "w"), (Ground("frame"), "w")
    ),
    "inertias in parallel": lambda: _two_inertias((Inertia("J3", J=4.0), "a"), (Spring("s", c=9.0), "a", "b")),
    "torque between two nodes": lambda: _two_inertias((TorqueSource("T", tau=3.0 * t), "a", "b")),
    "prescribed speed": lambda: _two_inertias(
        (Spring("s", c=9.0, d=1.0), "b", "d"), (SpeedSource("w", omega=7.0), "d")
    ),
    "prescribed difference": lambda: _two_inertias((SpeedSource("w", omega=2.0 * t), "a", "b")),
    "prescribed speed behind gears": _driven_behind_gear,
    "planetary with held ring": lambda: _two_inertias(
        (PlanetaryGear("p", ratio=2.5), "a", "b", "r"), (Ground("frame"), "r")
    ),
    "differential": lambda: _two_inertias(
        (PlanetaryGear("p", ratio=2.5), "a", "m", "b"), (Spring("s", c=3.0), "m", "ground")
    ),
    "redundant gears": _redundant_gears,
    "lifted mass": _lifted_mass,
    "rolling body": _rolling,
    "torque of angle and speed": _pendulum,
}
"""Networks without electrical parts, each with something of its own."""
