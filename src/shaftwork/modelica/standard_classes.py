"""Which class of the Modelica Standard Library a part is, with what values and at which connectors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from shaftwork.core.domains import ELECTRICAL, ROTATION, TRANSLATION
from shaftwork.network.graph import GROUND, GraphPart

ROTATIONAL, TRANSLATIONAL = "Modelica.Mechanics.Rotational", "Modelica.Mechanics.Translational"
ANALOG = "Modelica.Electrical.Analog"
FLANGES = {"a": "flange_a", "b": "flange_b"}
CONNECTORS = {
    ROTATION: f"{ROTATIONAL}.Interfaces.Flange_a",
    TRANSLATION: f"{TRANSLATIONAL}.Interfaces.Flange_a",
    ELECTRICAL: f"{ANALOG}.Interfaces.PositivePin",
}
"""By domain, the connector of a port."""
FRAMES = {
    ROTATION: (f"{ROTATIONAL}.Components.Fixed", "flange"),
    TRANSLATION: (f"{TRANSLATIONAL}.Components.Fixed", "flange"),
    ELECTRICAL: (f"{ANALOG}.Basic.Ground", "p"),
}
"""By domain, the class of what holds a node at rest, and its connector."""


@dataclass(frozen=True)
class StandardClass:
    """A class of the Modelica Standard Library that a part is an instance of.

    Args:
        name: of the class.
        values: by parameter of the class, that of the part, or a function of the part's values.
        ports: by port of the part, the connector.
        starts: the variables that begin at a value where the part's store is a state.
    """

    name: str
    values: Mapping[str, str | Callable[[Mapping[str, Any]], Any]]
    ports: Mapping[str, str]
    starts: tuple[str, ...] = ()


def _compliant(prefix: str, *, damped: bool) -> StandardClass:
    values = {"c": "c", "d": "d"} if damped else {"c": "c"}
    return StandardClass(f"{prefix}.Components.{'SpringDamper' if damped else 'Spring'}", values, FLANGES)


def _loss_table(values: Mapping[str, Any]) -> str:
    back = values["efficiency"] if values["efficiency_back"] is None else values["efficiency_back"]
    return f"[0, {values['efficiency']!r}, {back!r}, 0, 0]"


_PINS = {"p": "p", "n": "n"}
_ROLLING = StandardClass(
    f"{ROTATIONAL}.Components.IdealRollingWheel", {"radius": "radius"}, {"a": "flangeR", "b": "flangeT"}
)
_CLASSES: dict[str, StandardClass] = {
    "Inertia": StandardClass(f"{ROTATIONAL}.Components.Inertia", {"J": "J"}, {"a": "flange_a"}, ("w", "phi")),
    "Damper": StandardClass(f"{ROTATIONAL}.Components.Damper", {"d": "d"}, FLANGES),
    "Gear": StandardClass(f"{ROTATIONAL}.Components.IdealGear", {"ratio": "ratio"}, FLANGES),
    "PlanetaryGear": StandardClass(
        f"{ROTATIONAL}.Components.IdealPlanetary",
        {"ratio": "ratio"},
        {"sun": "sun", "carrier": "carrier", "ring": "ring"},
    ),
    "LossyGear": StandardClass(
        f"{ROTATIONAL}.Components.LossyGear", {"ratio": "ratio", "lossTable": _loss_table}, FLANGES
    ),
    "Drum": _ROLLING,
    "Wheel": _ROLLING,
    "Mass": StandardClass(f"{TRANSLATIONAL}.Components.Mass", {"m": "m"}, {"a": "flange_a"}, ("v", "s")),
    "TranslationalDamper": StandardClass(f"{TRANSLATIONAL}.Components.Damper", {"d": "d"}, FLANGES),
    "TorqueSource": StandardClass(f"{ROTATIONAL}.Sources.ConstantTorque", {"tau_constant": "tau"}, {"a": "flange"}),
    "ForceSource": StandardClass(f"{TRANSLATIONAL}.Sources.ConstantForce", {"f_constant": "f"}, {"a": "flange"}),
    "SpeedSource": StandardClass(f"{ROTATIONAL}.Sources.ConstantSpeed", {"w_fixed": "omega"}, {"a": "flange"}),
    "Resistor": StandardClass(f"{ANALOG}.Basic.Resistor", {"R": "R"}, _PINS),
    "Inductor": StandardClass(f"{ANALOG}.Basic.Inductor", {"L": "L"}, _PINS, ("i",)),
    "Capacitor": StandardClass(f"{ANALOG}.Basic.Capacitor", {"C": "C"}, _PINS, ("v",)),
    "Transformer": StandardClass(
        f"{ANALOG}.Ideal.IdealTransformer",
        {"n": "ratio", "considerMagnetization": lambda _: False},
        {name: name for name in ("p1", "n1", "p2", "n2")},
    ),
    # with the 1e-5 of the library a circuit of some ohms is off by 1e-4
    "Diode": StandardClass(f"{ANALOG}.Ideal.IdealDiode", {"Ron": lambda _: 1e-6, "Goff": lambda _: 1e-8}, _PINS),
    "VoltageSource": StandardClass(f"{ANALOG}.Sources.ConstantVoltage", {"V": "u"}, _PINS),
    # a current source of the library takes its current in at p, one of ours gives it
    "CurrentSource": StandardClass(f"{ANALOG}.Sources.ConstantCurrent", {"I": "i"}, {"p": "n", "n": "p"}),
}
_SPRINGS = {"Spring": ROTATIONAL, "TranslationalSpring": TRANSLATIONAL}


def standard_class(part: GraphPart, values: Mapping[str, Any]) -> StandardClass | None:
    """The class of a part; None of one that the library has not, or whose values are laws.

    Args:
        part: of the graph.
        values: of its parameters in SI.
    """
    kind = type(part.component).__name__
    if not all(isinstance(value, float | None) for value in values.values()):
        return None
    if kind in _SPRINGS:
        return _compliant(_SPRINGS[kind], damped=values["d"] != 0)
    entry = _CLASSES.get(kind)
    if entry is None or values.get("efficiency_back") == 0:  # the library divides by it
        return None
    between = any(node != GROUND for port, node in part.nodes.items() if port not in entry.ports)
    return None if between else entry  # its sources stand between a flange and the frame
