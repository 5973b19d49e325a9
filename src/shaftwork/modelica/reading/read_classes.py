"""The classes of the Modelica Standard Library that are read, and what each is here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from shaftwork.components.base import Component
from shaftwork.components.contacts import Backlash
from shaftwork.components.electrical import (
    Capacitor,
    CurrentSource,
    DCMachine,
    Diode,
    Inductor,
    Resistor,
    Transformer,
    VoltageSource,
)
from shaftwork.components.friction import Brake, Clutch, DryFriction
from shaftwork.components.laws import Ramp, Step, omega, phi, v
from shaftwork.components.laws import t as TIME
from shaftwork.components.mechanics import (
    Damper,
    Drum,
    Gear,
    Ground,
    Inertia,
    LossyGear,
    Mass,
    PlanetaryGear,
    Spring,
    TranslationalDamper,
    TranslationalSpring,
)
from shaftwork.components.sources import ForceSource, SpeedSource, TorqueSource
from shaftwork.modelica.standard_classes import ANALOG, ROTATIONAL, TRANSLATIONAL

SPRINGS_BELOW = 1e-10
"""A gap up to this, rad, is none in the library: bEps there."""
REQUIRED = None
"""In place of a default."""
Parts = Iterator[tuple[Component, tuple[str, ...]]]
"""Parts, each with the connectors of the class at which its ports are."""


class UnreadError(Exception):
    """A value that is not read; says why."""


@dataclass(frozen=True)
class ReadClass:
    """A class that is read.

    Args:
        connectors: of its physical ports, in the order in which `make` is given their nodes.
        values: by parameter its default, or REQUIRED.
        make: from its name, values and connectors the parts, with their connectors.
        rigid: connectors that are one node with the first.
        signal: the name of its input signal, which is among the values then.
        compliant: whether it has a twist: the connectors a and b.
        support: whether its connector `support` must be at the frame.
        shift: by connector how far it is ahead of the position, as a parameter and a factor.
    """

    connectors: tuple[str, ...]
    values: Mapping[str, Any]
    make: Callable[[str, Mapping[str, Any]], Parts]
    rigid: tuple[str, ...] = ()
    signal: str = ""
    compliant: bool = False
    support: bool = False
    shift: Mapping[str, tuple[str, float]] = ()  # type: ignore[assignment]


FLANGES, PINS = ("flange_a", "flange_b"), ("p", "n")


def _one(kind: Callable[..., Component], ports: Sequence[str], **names: str) -> Any:
    """What makes one part whose parameters have the given names in the class."""

    def make(name: str, values: Mapping[str, Any]) -> Parts:
        yield kind(name, **{ours: values[theirs] for ours, theirs in names.items()}), tuple(ports)

    return make


def _none(_name: str, _values: Mapping[str, Any]) -> Parts:
    yield from ()


def _sign(torque: Callable[[Mapping[str, Any]], Any]) -> Any:
    def make(name: str, values: Mapping[str, Any]) -> Parts:
        yield TorqueSource(name, tau=torque(values)), ("flange",)

    return make


def _follows_speed(part: Any, speed: Any, words: tuple[str, str, str], power: int) -> ReadClass:
    """A torque or force that is the nominal one times a power of the speed over the nominal one."""
    through, across, direction = words

    def make(name: str, values: Mapping[str, Any]) -> Parts:
        share = speed / values[f"{across}_nominal"]
        same = values[f"{direction}Direction"]  # in both directions of motion
        shape = sympy.Abs(share) ** power if same else share * sympy.Abs(share) ** (power - 1)
        yield part(name, **{through: values[f"{through}_nominal"] * shape}), ("flange",)

    names = {f"{through}_nominal": REQUIRED, f"{across}_nominal": REQUIRED, f"{direction}Direction": True}
    return ReadClass(("flange",), names, make, support=True)


def _backlash(name: str, values: Mapping[str, Any]) -> Parts:
    """A gap; the damping of the library's first one never exceeds the torque of its spring."""
    stiffness, damping, gap = values["c"], values["d"], values["b"]
    if not damping:
        yield Backlash(name, gap=gap, c=stiffness), FLANGES
        return
    if gap <= SPRINGS_BELOW:
        yield Spring(name, c=stiffness, d=damping), FLANGES
        return
    pieces = []
    for side, ahead in ((1, phi > gap / 2), (-1, phi < -gap / 2)):
        spring, damper = side * stiffness * (phi - side * gap / 2), side * damping * omega
        push = sympy.Piecewise((0, spring + damper <= 0), (spring + sympy.Min(spring, damper), True))
        pieces.append((-side * push, ahead))
    yield TorqueSource(name, tau=sympy.Piecewise(*pieces, (0, True))), FLANGES


def _backlash_2(name: str, values: Mapping[str, Any]) -> Parts:
    if values["b"] <= SPRINGS_BELOW:
        yield Spring(name, c=values["c"], d=values["d"]), FLANGES
    else:
        yield Backlash(name, gap=values["b"], c=values["c"], d=values["d"]), FLANGES


def _friction_numbers(table: Any) -> tuple[float, float]:
    """The torque at rest and its slope over the speed, of a table that is a straight line."""
    rows = table if isinstance(table, list) and all(isinstance(r, list) and len(r) == 2 for r in table) else []
    if not rows or len(rows) > 2 or rows[0][0] != 0:
        raise UnreadError("its table is no straight line over the speed: one or two rows, the first at 0, are read")
    slope = (rows[1][1] - rows[0][1]) / (rows[1][0] - rows[0][0]) if len(rows) == 2 else 0.0
    return rows[0][1], slope


def _bearing(name: str, values: Mapping[str, Any]) -> Parts:
    torque, slope = _friction_numbers(values["tau_pos"])
    peak = values["peak"]
    holds = {} if peak == 1 else {"tau_s": peak * torque, "omega_s": 0.0}
    yield DryFriction(name, tau_c=torque, d=slope, **holds), ("flange_a",)


def _pressed(kind: type[Brake], ports: Sequence[str], force: str) -> Any:
    """A brake or clutch whose torque follows the force on its plates."""

    def make(name: str, values: Mapping[str, Any]) -> Parts:
        friction, slope = _friction_numbers(values["mue_pos"])
        if slope or values["peak"] != 1:
            raise UnreadError("its friction changes with the speed, or its peak is not 1")
        torque = friction * values["cgeo"] * values["fn_max"] * values[force]
        yield kind(name, tau=torque), tuple(ports)

    return make


def _lossy(name: str, values: Mapping[str, Any]) -> Parts:
    table = values["lossTable"]
    if not (isinstance(table, list) and len(table) == 1 and len(table[0]) == 5 and not any(table[0][3:])):
        raise UnreadError("its lossTable has more than one row, or friction of bearings")
    _, ahead, back, *_ = table[0]
    if ahead == back == 1:
        yield Gear(name, ratio=values["ratio"]), FLANGES
    else:
        yield LossyGear(name, ratio=values["ratio"], efficiency=ahead, efficiency_back=back), FLANGES


def _exact_speed(name: str, values: Mapping[str, Any]) -> Parts:
    if values["exact"] is not True:
        raise UnreadError("exact = false filters the speed; exact = true is read")
    yield SpeedSource(name, omega=values["w_ref"]), ("flange",)


def _transformer(name: str, values: Mapping[str, Any]) -> Parts:
    if values["considerMagnetization"]:
        raise UnreadError("its magnetization is not read")
    yield Transformer(name, ratio=values["n"]), ("p1", "n1", "p2", "n2")


def _diode(name: str, values: Mapping[str, Any]) -> Parts:
    if values["Ron"] > 1e-5 or values["Goff"] > 1e-5 or values["Vknee"]:
        raise UnreadError(
            "an ideal diode has no Ron, Goff and Vknee beyond the 1e-5 of the library. Write them as parts"
        )
    yield Diode(name), PINS


def _conductor(name: str, values: Mapping[str, Any]) -> Parts:
    yield Resistor(name, R=1 / values["G"]), PINS


def _rolling(radius: Callable[[Mapping[str, Any]], float]) -> Any:
    def make(name: str, values: Mapping[str, Any]) -> Parts:
        yield Drum(name, radius=radius(values)), ("flangeR", "flangeT")

    return make


def _voltage(law: Callable[[Mapping[str, Any]], Any]) -> Any:
    def make(name: str, values: Mapping[str, Any]) -> Parts:
        yield VoltageSource(name, u=law(values)), PINS

    return make


def _sine_current(name: str, values: Mapping[str, Any]) -> Parts:
    yield CurrentSource(name, i=_sine({**values, "amplitude": values["I"]})), PINS[::-1]


def _disc(_name: str, values: Mapping[str, Any]) -> Parts:
    if values["deltaPhi"]:
        raise UnreadError("deltaPhi other than 0 is not read")
    yield from ()


def _sine(v: Mapping[str, Any]) -> Any:
    wave = v["amplitude"] * sympy.sin(2 * sympy.pi * v["f"] * (TIME - v["startTime"]) + v["phase"])
    return v["offset"] + (wave if not v["startTime"] else sympy.Piecewise((0, v["startTime"] > TIME), (wave, True)))


_AFTER = {"offset": 0.0, "startTime": 0.0}
_WAVE = {"amplitude": 1.0, "f": REQUIRED, "phase": 0.0, **_AFTER}
SIGNALS: Mapping[str, tuple[Mapping[str, Any], Callable[[Mapping[str, Any]], Any]]] = {
    "Constant": ({"k": REQUIRED}, lambda v: v["k"]),
    "Step": ({"height": 1.0, **_AFTER}, lambda v: Step(v["height"], v["startTime"], v["offset"])),
    "Ramp": (
        {"height": 1.0, "duration": REQUIRED, **_AFTER},
        lambda v: Ramp(v["height"], v["duration"], v["startTime"], v["offset"]),
    ),
    "Sine": (_WAVE, _sine),
    "Cosine": (_WAVE, lambda v: _sine({**v, "phase": v["phase"] + sympy.pi / 2})),
    "RealExpression": ({"y": REQUIRED}, lambda v: v["y"]),
}
"""By block of Modelica.Blocks.Sources with the output y: its parameters, and the law that it gives."""

_FRICTION = {"mue_pos": [[0.0, 0.5]], "peak": 1.0, "cgeo": 1.0, "fn_max": REQUIRED, "f_normalized": REQUIRED}
_GAP = {"c": REQUIRED, "d": 0.0, "b": 0.0, "phi_rel0": 0.0}
_HALVES = {"flange_a": ("L", -0.5), "flange_b": ("L", 0.5)}


def _rotational() -> Iterator[tuple[str, ReadClass]]:
    flange = ("flange",)
    yield "Components.Inertia", ReadClass(FLANGES, {"J": REQUIRED}, _one(Inertia, FLANGES[:1], J="J"), FLANGES)
    yield "Components.Disc", ReadClass(FLANGES, {"deltaPhi": 0.0}, _disc, FLANGES)
    yield "Components.Fixed", ReadClass(flange, {"phi0": 0.0}, _one(Ground, flange))
    twist = {"phi_rel0": 0.0}
    yield (
        "Components.Spring",
        ReadClass(FLANGES, {"c": REQUIRED, **twist}, _one(Spring, FLANGES, c="c"), compliant=True),
    )
    yield "Components.Damper", ReadClass(FLANGES, {"d": REQUIRED}, _one(Damper, FLANGES, d="d"))
    yield (
        "Components.SpringDamper",
        ReadClass(
            FLANGES, {"c": REQUIRED, "d": REQUIRED, **twist}, _one(Spring, FLANGES, c="c", d="d"), compliant=True
        ),
    )
    yield "Components.ElastoBacklash", ReadClass(FLANGES, _GAP, _backlash, compliant=True)
    yield "Components.ElastoBacklash2", ReadClass(FLANGES, _GAP, _backlash_2, compliant=True)
    yield (
        "Components.IdealGear",
        ReadClass(FLANGES, {"ratio": REQUIRED}, _one(Gear, FLANGES, ratio="ratio"), support=True),
    )
    sun = ("sun", "carrier", "ring")
    yield "Components.IdealPlanetary", ReadClass(sun, {"ratio": REQUIRED}, _one(PlanetaryGear, sun, ratio="ratio"))
    no_loss = [[0.0, 1.0, 1.0, 0.0, 0.0]]
    yield (
        "Components.LossyGear",
        ReadClass(FLANGES, {"ratio": REQUIRED, "lossTable": no_loss}, _lossy, support=True),
    )
    bearing = {"tau_pos": [[0.0, 1.0]], "peak": 1.0}
    yield "Components.BearingFriction", ReadClass(FLANGES, bearing, _bearing, FLANGES, support=True)
    brake = _pressed(Brake, FLANGES[:1], "f_normalized")
    yield "Components.Brake", ReadClass(FLANGES, _FRICTION, brake, FLANGES, signal="f_normalized", support=True)
    yield (
        "Components.Clutch",
        ReadClass(FLANGES, _FRICTION, _pressed(Clutch, FLANGES, "f_normalized"), signal="f_normalized"),
    )
    both = ("flangeR", "flangeT")
    yield "Components.IdealRollingWheel", ReadClass(both, {"radius": REQUIRED}, _rolling(lambda v: v["radius"]))
    yield "Components.IdealGearR2T", ReadClass(both, {"ratio": REQUIRED}, _rolling(lambda v: 1 / v["ratio"]))
    torque = _one(TorqueSource, flange, tau="tau_constant")
    yield "Sources.ConstantTorque", ReadClass(flange, {"tau_constant": REQUIRED}, torque, support=True)
    step = _sign(lambda v: Step(v["stepTorque"], v["startTime"], v["offsetTorque"]))
    steps = {"stepTorque": REQUIRED, "offsetTorque": REQUIRED, "startTime": 0.0}
    yield "Sources.TorqueStep", ReadClass(flange, steps, step, support=True)
    yield "Sources.Torque", ReadClass(flange, {"tau": REQUIRED}, _sign(lambda v: v["tau"]), signal="tau", support=True)
    torque = _one(TorqueSource, FLANGES[::-1], tau="tau")
    yield "Sources.Torque2", ReadClass(FLANGES, {"tau": REQUIRED}, torque, signal="tau")
    speed = _one(SpeedSource, flange, omega="w_fixed")
    yield "Sources.ConstantSpeed", ReadClass(flange, {"w_fixed": REQUIRED}, speed, support=True)
    speeds = {"exact": False, "w_ref": REQUIRED}
    yield "Sources.Speed", ReadClass(flange, speeds, _exact_speed, signal="w_ref", support=True)
    for power, word in enumerate(("Linear", "Quadratic"), 1):
        law = _follows_speed(TorqueSource, omega, ("tau", "w", "Torque"), power)
        yield f"Sources.{word}SpeedDependentTorque", law


def _translational() -> Iterator[tuple[str, ReadClass]]:
    flange, length = ("flange",), {"L": 0.0}
    mass = _one(Mass, FLANGES[:1], m="m")
    yield "Components.Mass", ReadClass(FLANGES, {"m": REQUIRED, **length}, mass, FLANGES, shift=_HALVES)
    yield "Components.Rod", ReadClass(FLANGES, length, _none, FLANGES, shift=_HALVES)
    yield "Components.Fixed", ReadClass(flange, {"s0": 0.0}, _one(Ground, flange))
    stretch = {"s_rel0": 0.0}
    spring = _one(TranslationalSpring, FLANGES, c="c")
    yield "Components.Spring", ReadClass(FLANGES, {"c": REQUIRED, **stretch}, spring, compliant=True)
    yield "Components.Damper", ReadClass(FLANGES, {"d": REQUIRED}, _one(TranslationalDamper, FLANGES, d="d"))
    spring = _one(TranslationalSpring, FLANGES, c="c", d="d")
    values = {"c": REQUIRED, "d": REQUIRED, **stretch}
    yield "Components.SpringDamper", ReadClass(FLANGES, values, spring, compliant=True)
    force = _one(ForceSource, flange, f="f_constant")
    yield "Sources.ConstantForce", ReadClass(flange, {"f_constant": REQUIRED}, force, support=True)
    force = _one(ForceSource, flange, f="f")
    yield "Sources.Force", ReadClass(flange, {"f": REQUIRED}, force, signal="f", support=True)
    force = _one(ForceSource, FLANGES[::-1], f="f")
    yield "Sources.Force2", ReadClass(FLANGES, {"f": REQUIRED}, force, signal="f")
    for power, word in enumerate(("Linear", "Quadratic"), 1):
        yield f"Sources.{word}SpeedDependentForce", _follows_speed(ForceSource, v, ("f", "v", "Force"), power)


def _sensors() -> Iterator[tuple[str, ReadClass]]:
    """Sensors change nothing, and those of torques are rigid."""
    for name in ("SpeedSensor", "AngleSensor", "PositionSensor", "AccSensor"):
        yield f"Sensors.{name}", ReadClass(("flange",), {}, _none)
    for name in ("RelSpeedSensor", "RelAngleSensor", "RelPositionSensor", "RelAccSensor"):
        yield f"Sensors.{name}", ReadClass(FLANGES, {}, _none)
    for name in ("TorqueSensor", "ForceSensor", "PowerSensor", "MultiSensor"):
        yield f"Sensors.{name}", ReadClass(FLANGES, {}, _none, FLANGES)


def _electrical() -> Iterator[tuple[str, ReadClass]]:
    yield "Basic.Ground", ReadClass(("p",), {}, _one(Ground, ("p",)))
    yield "Basic.Resistor", ReadClass(PINS, {"R": REQUIRED}, _one(Resistor, PINS, R="R"))
    yield "Basic.Conductor", ReadClass(PINS, {"G": REQUIRED}, _conductor)
    yield "Basic.Capacitor", ReadClass(PINS, {"C": REQUIRED}, _one(Capacitor, PINS, C="C"))
    yield "Basic.Inductor", ReadClass(PINS, {"L": REQUIRED}, _one(Inductor, PINS, L="L"))
    emf = _one(DCMachine, (*PINS, "flange"), k="k")
    yield "Basic.RotationalEMF", ReadClass((*PINS, "flange"), {"k": REQUIRED}, emf, support=True)
    pairs = ("p1", "n1", "p2", "n2")
    transformer = {"n": REQUIRED, "considerMagnetization": REQUIRED}
    yield "Ideal.IdealTransformer", ReadClass(pairs, transformer, _transformer)
    yield "Ideal.IdealDiode", ReadClass(PINS, {"Ron": 1e-5, "Goff": 1e-5, "Vknee": 0.0}, _diode)
    yield "Sources.ConstantVoltage", ReadClass(PINS, {"V": REQUIRED}, _one(VoltageSource, PINS, u="V"))
    current = _one(CurrentSource, PINS[::-1], i="I")
    yield "Sources.ConstantCurrent", ReadClass(PINS, {"I": REQUIRED}, current)
    wave = {"V": REQUIRED, "f": REQUIRED, "phase": 0.0, **_AFTER}
    yield "Sources.SineVoltage", ReadClass(PINS, wave, _voltage(lambda v: _sine({**v, "amplitude": v["V"]})))
    current = {"I": REQUIRED, "f": REQUIRED, "phase": 0.0, **_AFTER}
    yield "Sources.SineCurrent", ReadClass(PINS, current, _sine_current)
    step = _voltage(lambda v: Step(v["V"], v["startTime"], v["offset"]))
    yield "Sources.StepVoltage", ReadClass(PINS, {"V": REQUIRED, **_AFTER}, step)
    signal = _one(VoltageSource, PINS, u="v")
    yield "Sources.SignalVoltage", ReadClass(PINS, {"v": REQUIRED}, signal, signal="v")


CLASSES: Mapping[str, ReadClass] = {
    **{f"{ROTATIONAL}.{name}": entry for name, entry in (*_rotational(), *_sensors())},
    **{f"{TRANSLATIONAL}.{name}": entry for name, entry in (*_translational(), *_sensors())},
    **{f"{ANALOG}.{name}": entry for name, entry in _electrical()},
}
"""Every class with physical ports that is read, by its full name."""
BLOCKS = "Modelica.Blocks.Sources"


def can_be_supported(placed: tuple[Component, tuple[str, ...]]) -> bool:
    """Whether a part can stand on another node than the frame."""
    part, ports = placed
    return isinstance(part, Gear) or len(ports) < len(part.ports)


def supported(part: Component, ports: tuple[str, ...]) -> tuple[Component, tuple[str, ...]]:
    """A part on a support that moves.

    A source or brake acts between its flange and the support. A gear is planetary, with
    omega_a - omega_s = ratio (omega_b - omega_s): the fastest and the slowest of the three are its sun and ring.
    """
    if not isinstance(part, Gear):
        return part, (*ports, "support")
    (a, b), ratio = ports, float(part.ratio)
    if ratio < 0:
        return PlanetaryGear(part.name, ratio=-ratio), (a, "support", b)
    if ratio == 1:
        raise UnreadError("a gear of ratio 1 on a support that moves is a rigid joint. Join its flanges")
    if ratio < 1:
        return PlanetaryGear(part.name, ratio=1 / ratio - 1), (b, a, "support")
    return PlanetaryGear(part.name, ratio=ratio - 1), (a, b, "support")
