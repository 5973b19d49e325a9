"""A part behind a rigid train: the part that does the same at the reference shaft, by the units of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sympy import Abs, Expr, Float, Rational, S, Symbol, signsimp

from shaftwork.components.base import Component
from shaftwork.components.contacts import Backlash, TranslationalBacklash
from shaftwork.components.laws import as_expression, omega, phi, s, v
from shaftwork.components.loads import ViscousLoad
from shaftwork.components.mechanics import Damper, Inertia, Mass, Spring, TranslationalDamper, TranslationalSpring
from shaftwork.components.sources import ForceSource, TorqueSource
from shaftwork.components.tables import Table
from shaftwork.core.domains import ROTATION, TRANSLATION, Domain
from shaftwork.core.errors import NetworkWarning, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.core.parameters import Parameter
from shaftwork.network.netlist import REFERENCE, Placed
from shaftwork.reduce.covariance import does_the_same
from shaftwork.reduce.kinematics import Scale

Exponents = tuple[Expr, Expr]
"""Powers of the ratio and of the share of power by which a parameter is multiplied."""


def _exponents(ratio: Any, power: Any = 0) -> Exponents:
    return Rational(ratio), Rational(power)


BY_UNIT: Mapping[str, Exponents] = {
    **dict.fromkeys(("kg*m^2", "N*m/rad", "N*m*s/rad", "kg", "N/m", "N*s/m"), _exponents(2, 1)),
    **dict.fromkeys(("N*m^2*s/rad", "N*s/rad"), _exponents(2, 1)),
    **dict.fromkeys(("N*m", "N"), _exponents(1, 1)),
    **dict.fromkeys(("rad", "rad/s", "1/min"), _exponents(-1)),
}
"""Equal energies, Abdelkader 2016, (4)-(14): a store or damping goes by the square of the ratio, a torque by the ratio,
a gap or speed by its inverse. What has another unit stays."""

_MOTOR = {"ratio": _exponents(1), "efficiency": _exponents(0, 1)}
OF_CLASS: Mapping[str, Mapping[str, Exponents]] = {
    **dict.fromkeys(
        ("KlossMotor", "CageMotor", "WoundRotorMotor", "TableMotor", "FrequencyDrive", "PullOutDrive"), _MOTOR
    ),
    "DCMachine": {"k": _exponents(1)},
    "BLDCMotor": {"k": _exponents(1), "pole_pairs": _exponents(1)},
    "AveragedBLDC": {"k": _exponents(1), "pole_pairs": _exponents(1)},
    "InductionMachine": {"pole_pairs": _exponents(1)},
    "Hoist": {"m": _exponents(0, 1), "ratio": _exponents(-1), "omega_s": _exponents(-1)},
    "CraneTravel": {"m": _exponents(0, 1), "diameter": _exponents(1), "omega_s": _exponents(-1)},
    "Conveyor": {
        "m": _exponents(0, 1),
        "radius": _exponents(1),
        "d": _exponents(0, 1),
        "omega_s": _exponents(-1),
    },
    "BucketWheelLoad": {"edge": _exponents(0, 1), "ratio": _exponents(-1)},
    "TranslationalBacklash": {
        **dict.fromkeys(("gap", "v_rest"), _exponents(-1)),
        **dict.fromkeys(("c", "d"), _exponents(2, 1)),
    },
    "Shaft": {
        **dict.fromkeys(("diameter", "inner_diameter"), _exponents("1/2", "1/4")),
        **dict.fromkeys(("damping", "friction"), _exponents(2, 1)),
    },
}
"""Parts whose parameters stand for a gear of their own, a lever or a machine, and not for the shaft itself."""

TURNED: Mapping[str, tuple[str, ...]] = {"Conveyor": ("incline",)}
"""Parameters that change their sign where the part turns backwards: what went up goes down."""

LIMITS: Mapping[str, tuple[str, str]] = {"SpeedController": ("tau_max", "tau_min")}
"""The largest and the smallest value of a torque; where the smallest is not given, it is minus the largest."""

COUNTERPARTS: Mapping[type[Component], tuple[type[Component], Mapping[str, str]]] = {
    Mass: (Inertia, {"m": "J"}),
    TranslationalSpring: (Spring, {}),
    TranslationalDamper: (Damper, {}),
    ForceSource: (TorqueSource, {"f": "tau"}),
    Inertia: (Mass, {"J": "m"}),
    Spring: (TranslationalSpring, {}),
    Damper: (TranslationalDamper, {}),
    ViscousLoad: (TranslationalDamper, {}),
    TorqueSource: (ForceSource, {"tau": "f"}),
    Backlash: (TranslationalBacklash, {"omega_rest": "v_rest"}),
    TranslationalBacklash: (Backlash, {"v_rest": "omega_rest"}),
}
"""What a part becomes behind a drum or wheel, and the names of its parameters there."""

MOTIONS: Mapping[Domain, tuple[Symbol, Symbol]] = {ROTATION: (omega, phi), TRANSLATION: (v, s)}


@dataclass(frozen=True)
class Entry:
    """A parameter before and after.

    Args:
        part: its name.
        quantity: name of the parameter.
        value: of the part as it is, in SI; a number, or a law.
        unit: of it.
        ratio: speed of the part over that of the reference shaft.
        power: share of the part's power that arrives there; 1 without lossy gears.
        referred: the value at the reference shaft.
        referred_unit: of it.
        factor: by which it is multiplied, in the symbols of the network.
    """

    part: str
    quantity: str
    value: Any
    unit: str
    ratio: float
    power: float
    referred: Any
    referred_unit: str
    factor: Expr


def symbol_of(entry: Entry) -> Symbol:
    """The symbol of a parameter in the equations."""
    return Symbol(f"{entry.part}.{entry.quantity}", real=True)


def formula_of(entry: Entry) -> str:
    """What became of a parameter, as text."""
    above, below = entry.factor.as_numer_denom()
    text = str(symbol_of(entry)) if above == 1 else f"{symbol_of(entry)} * {_bracketed(above)}"
    return text if below == 1 else f"{text} / {_bracketed(below)}"


def _bracketed(product: Expr) -> str:
    return f"({product})" if product.args and not product.is_Pow else str(product)


@dataclass(frozen=True)
class ReferredPart:
    """A part at the reference shaft, its nodes there, its scale, and what became of its parameters."""

    placed: Placed
    scale: Scale
    entries: tuple[Entry, ...]


def referred_part(item: Placed, nodes: tuple[str, ...], scale: Scale, domain: Domain) -> ReferredPart | str:
    """A part as it is seen from the reference shaft, or why there is none.

    A part that turns backwards is tried as it is, then with its nodes exchanged; either must do exactly the same.

    Args:
        item: the part and its nodes.
        nodes: the nodes where it will be.
        scale: of its speeds and powers to those of the reference shaft.
        domain: of the reference shaft.
    """
    here = next(port.domain for port in item.part.ports if port.domain in MOTIONS)
    assert here is not None  # noqa: S101 (only mechanical parts are referred)
    if here is not domain and type(item.part) not in COUNTERPARTS:
        return f"there is no {domain.name} part that does what it does; refer to a shaft of its own kind"
    attempts = [(scale, nodes)]
    if scale.ratio < 0 and len(item.part.ports) == 2:
        turned = Scale(-scale.ratio, scale.power, -scale.ratio_law, scale.power_law)
        attempts.append((turned, (*nodes, REFERENCE)[1::-1]))
    reason = ""
    for attempt, places in attempts:
        try:
            counterpart, entries = _scaled(item.part, attempt, here, domain)
        except ShaftworkError as error:
            reason = str(error)
            continue
        if does_the_same(item.part, counterpart, attempt):
            return ReferredPart(Placed(counterpart, places), attempt, entries)
    turns = "it has a direction, and turns against the reference shaft" if scale.ratio < 0 else ""
    return reason or turns or "its law is not that of any such part behind a gear"


def _scaled(part: Component, scale: Scale, here: Domain, domain: Domain) -> tuple[Component, tuple[Entry, ...]]:
    kind, names = type(part), dict[str, str]()
    if here is not domain:
        kind, names = COUNTERPARTS[kind][0], dict(COUNTERPARTS[kind][1])
    values: dict[str, Any] = {"symbol": part.symbol}
    entries: list[Entry] = []
    targets = {name: kind.declared[names.get(name, name)] for name in part.declared}
    if scale.ratio < 0:
        targets |= _turned_limits(part)
    for name, declared in part.declared.items():
        target = targets[name]
        value = declared.magnitude(getattr(part, name))[0]
        if scale.ratio < 0 and name in TURNED.get(type(part).__name__, ()):
            referred, factor = -value, S.NegativeOne
        else:
            powers, motions = _powers(part, declared), (MOTIONS[here], MOTIONS[domain])
            referred, factor = _referred(value, target, powers, scale, motions)
        values[target.name] = referred
        if factor is not None and value != 0:
            before = part.name, name, value, declared.unit, scale.ratio, scale.power
            entries.append(Entry(*before, referred, target.unit, signsimp(factor)))
    with muted(NetworkWarning):  # what is odd about the part was said when it was made
        return kind(part.name, **values), tuple(entries)


def _turned_limits(part: Component) -> dict[str, Parameter]:
    """What the limits of a part become where it turns backwards: each other, or one of the same size both ways."""
    if type(part).__name__ not in LIMITS:
        return {}
    most, least = LIMITS[type(part).__name__]
    if getattr(part, least) is None:
        return {most: replace(part.declared[most], above=0.0)}
    return {most: part.declared[least], least: part.declared[most]}


def _powers(part: Component, declared: Parameter) -> Exponents:
    """How a parameter scales: by what its class says, else by what is known of the class, else by its unit."""
    declared_by_class = getattr(type(part), "referred", None) or OF_CLASS.get(type(part).__name__)
    if declared_by_class is not None:
        return declared_by_class.get(declared.name, _exponents(0))
    return BY_UNIT.get(declared.unit, _exponents(0))


Motion = tuple[Symbol, Symbol]


def _referred(
    value: Any, target: Parameter, powers: Exponents, scale: Scale, motions: tuple[Motion, Motion]
) -> tuple[Any, Expr | None]:
    """The value at the reference shaft, and the factor in symbols; None where nothing is to be said of it."""
    if value is None or target.record is not None:
        return value, None
    by_ratio, by_power = powers
    size = abs(scale.ratio) ** float(by_ratio) * scale.power ** float(by_power)
    law = scale.ratio_law**by_ratio * scale.power_law**by_power
    sign = -1.0 if scale.ratio < 0 and by_ratio.is_odd else 1.0
    if isinstance(value, float):
        if by_ratio == 0 and by_power == 0:
            return value, None
        if sign < 0 and target.objection(-value * size) is not None:
            return value * size, Abs(scale.ratio_law) ** by_ratio * scale.power_law**by_power
        return sign * value * size, law
    if isinstance(value, Table):
        return Table(value.xs, [y * sign * size for y in value.ys]), law
    ((speed, angle), (new_speed, new_angle)) = motions
    ratio = scale.ratio if scale.ratio != 1 else S.One  # a law at the reference shaft stays as it was written
    turned = {speed: ratio * new_speed, angle: ratio * new_angle}
    law_there = as_expression(value).xreplace(turned)
    return (law_there if sign * size == 1 else Float(sign * size) * law_there), law
