"""Extreme drives of one shaft: light, heavy, stiff, soft, short, long, hit and held."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import sympy

from shaftwork.components.laws import Ramp, Step
from shaftwork.components.laws import t as TIME
from shaftwork.components.mechanics import Damper, Gear, Ground, Inertia, Spring
from shaftwork.components.shaft_models import CentralDifference, Lumped, OneSpring, Rigid, ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array

DENSITY, SHEAR_MODULUS = (float(Shaft.declared[name].default) for name in ("density", "shear_modulus"))
"""Of a shaft where nothing is said of them, kg/m^3 and Pa."""
TORQUE = 10.0
"""Height of the torque in N m; every case is linear."""
POINTS = 100
"""Output times, in the middle of as many equal intervals: no wave front passes there."""
MODELS: tuple[ShaftModel, ...] = (Rigid(), OneSpring(), Lumped(10), CentralDifference(10), Spectral(8), Wave(3))
"""The models of a case, where it names none."""

Form = Literal["step", "pulse", "ramp", "sine"]


@dataclass(frozen=True)
class Case:
    """A torque source and an inertia, a shaft, a gear, a spring, and a load with a damper or a wall.

    Args:
        name: what is extreme.
        form: "step"; "pulse" of `rise` delays; "ramp" of `rise` delays; "sine", 1 - cos, of `rise` delays a period.
        rise: in delays of the shaft.
        delays: end of the motion, in delays.
        drive: inertia of the motor, of that of the shaft; 0 for none.
        load: inertia of the load seen from the shaft, of that of the shaft; 0 for none.
        damper: of the load seen from the shaft, of the impedance of the shaft; 0 for none.
        clamped: whether the far end is held; nothing else is there then.
        ratio: of a gear behind the shaft; 1 for none.
        spring: stiffness between gear and load, of that of the shaft; 0 for none.
        damping: damping ratio of the shaft as one spring between two inertias of its own size.
        length: of the shaft in m.
        diameter: in m.
        models: that are compared.
        engines: that are compared, of those asked for; empty for all.
        periods: the outputs are in the last of so many periods of two delays; 0 for all over the motion.
        steps: bound on the steps of a run.

    Raises:
        ParameterError: there is no such form, or a size is not above 0.
    """

    name: str
    form: Form = "step"
    rise: float = 1.0
    delays: float = 12.0
    drive: float = 1.0
    load: float = 1.0
    damper: float = 0.0
    clamped: bool = False
    ratio: float = 1.0
    spring: float = 0.0
    damping: float = 0.0
    length: float = 1.0
    diameter: float = 0.02
    models: tuple[ShaftModel, ...] = MODELS
    engines: tuple[str, ...] = ()
    periods: int = 0
    steps: int = 3600  # no run of these drives ends within 3 % of it: its verdict would hang on the processor

    def __post_init__(self) -> None:
        if self.form not in get_args(Form):
            raise ParameterError(
                f"Case {self.name!r}: form = {self.form!r} must be one of: {', '.join(get_args(Form))}."
            )
        for name in ("rise", "delays", "ratio", "length", "diameter"):
            in_si(name, getattr(self, name), above=0)

    @property
    def area_moment(self) -> float:
        """Of the shaft, m^4."""
        return math.pi / 32 * self.diameter**4

    @property
    def inertia(self) -> float:
        """Of the whole shaft, kg m^2."""
        return DENSITY * self.area_moment * self.length

    @property
    def stiffness(self) -> float:
        """Of the whole shaft as one spring, N m/rad."""
        return SHEAR_MODULUS * self.area_moment / self.length

    @property
    def delay(self) -> float:
        """Time that a wave takes through the shaft, s."""
        return self.length * math.sqrt(DENSITY / SHEAR_MODULUS)

    @property
    def impedance(self) -> float:
        """Torque over speed of a wave, N m s/rad."""
        return self.area_moment * math.sqrt(DENSITY * SHEAR_MODULUS)

    @property
    def dashpot(self) -> float:
        """Damping of the whole shaft as one dashpot, N m s/rad."""
        # two inertias of the shaft's own at this spring turn against each other at sqrt(2)/delay
        return math.sqrt(2) * self.damping * self.stiffness * self.delay

    @property
    def t_end(self) -> float:
        """End of the motion, s."""
        return self.delay * (2 * self.periods or self.delays)

    @property
    def times(self) -> Array:
        """(POINTS,) output times, s."""
        span = 2 * self.delay if self.periods else self.t_end
        return self.t_end - span * (np.arange(POINTS, 0, -1) - 0.5) / POINTS

    @property
    def torque(self) -> sympy.Expr:
        """Of the motor, as a law of time in N m."""
        rise = self.rise * self.delay
        return {
            "step": sympy.Float(TORQUE),
            "pulse": Step(TORQUE) - Step(TORQUE, start=rise),
            "ramp": Ramp(TORQUE, rise),
            "sine": TORQUE * (1 - sympy.cos(2 * np.pi / rise * TIME)),
        }[self.form]

    def network(self, model: ShaftModel) -> Network:
        """The drive with a model of its shaft."""
        net = Network(self.name)
        net.add(TorqueSource("motor", tau=self.torque), "a")
        if self.drive:
            net.add(Inertia("drive", J=self.drive * self.inertia), "a")
        shaft = Shaft(
            "line",
            length=self.length,
            diameter=self.diameter,
            damping=self.dashpot * self.length,
            model=model,
        )
        net.add(shaft, "a", "b")
        end = "b"
        if self.ratio != 1:
            net.add(Gear("gear", ratio=self.ratio), "b", "c")
            end = "c"
        if self.spring:
            net.add(Spring("spring", c=self.spring * self.ratio**2 * self.stiffness), end, "d")
            end = "d"
        if self.clamped:
            net.add(Ground("wall"), end)
        if self.load and not self.clamped:
            net.add(Inertia("load", J=self.load * self.ratio**2 * self.inertia), end)
        if self.damper and not self.clamped:
            net.add(Damper("brake", d=self.damper * self.ratio**2 * self.impedance), end)
        return net


_SIZES = ("auto", "exact", "sundials", "banded")

CASES: tuple[Case, ...] = (
    *(Case(f"stiffness ratio {r:g}", form="ramp", rise=4.0, spring=r) for r in (1e-9, 1e-4, 1.0, 1e4, 1e8, 1e12)),
    Case("inertia ratio 1e-09", form="ramp", rise=4.0, load=1e-9, steps=2600),  # away from a run of 3435 steps
    *(Case(f"inertia ratio {r:g}", form="ramp", rise=4.0, load=r) for r in (1e-4, 1.0, 1e4, 1e9)),
    *(Case(f"damping ratio {z:g}", form="ramp", rise=4.0, damping=z) for z in (1e-6, 0.05, 1.0, 100.0, 1e4)),
    # explicit engines only run these to their end where there is but one spring and they may take many steps
    *(
        Case(
            f"one spring, damping ratio {z:g}",
            form="ramp",
            rise=1.0,
            delays=3.0,
            damping=z,
            models=(OneSpring(),),
            steps=100_000,
        )
        for z in (10.0, 100.0, 1e3, 1e4)
    ),
    Case("m = 2", models=(Lumped(2), CentralDifference(2), Spectral(2))),
    Case("m = 100", models=(Lumped(100), CentralDifference(100), Spectral(32)), engines=_SIZES, delays=8.0),
    Case("m = 1000", form="ramp", models=(Lumped(1000),), engines=("auto", "banded"), delays=4.0),
    Case("m = 10000", models=(Lumped(10000),), engines=("auto", "banded"), damping=0.01, form="ramp", delays=4.0),
    *(Case(f"gear ratio {r:g}", form="ramp", rise=4.0, ratio=r) for r in (1e-4, 1e-2, 1e2, 1e4)),
    Case("1 mm", form="ramp", rise=4.0, length=1e-3, diameter=1e-3),
    Case("10 km", form="ramp", rise=4.0, length=1e4, diameter=0.2),
    Case("impulse", form="pulse", rise=0.01),
    Case("smooth torque", form="sine", rise=5.0),
    Case("light ends, wave fronts", drive=0.0, load=0.0),
    Case("light ends, dispersion", form="pulse", rise=0.2, drive=0.0, load=0.0, delays=6.0),
    Case("matched end, step", drive=0.0, load=0.0, damper=1.0, delays=6.0),
    Case("matched end, pulse", form="pulse", rise=0.5, drive=0.0, load=0.0, damper=1.0, delays=6.0),
    Case("free end", load=0.0),
    Case("clamped end", clamped=True),
    Case(
        "100000 periods",
        form="pulse",
        rise=0.5,
        drive=0.0,
        load=0.0,
        periods=100_000,
        models=MODELS[2:],
        engines=("auto", "exact", "wave"),
        steps=10_000_000,
    ),
)
"""What is tried where no cases are named."""
