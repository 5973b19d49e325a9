"""A stepped ship line: three sections of shaft with two discs between engine and propeller."""

from __future__ import annotations

import sympy

from shaftwork.components.laws import t
from shaftwork.components.rotation import Damper, Inertia
from shaftwork.components.shaft_models import ShaftModel, Spectral
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene

SECTIONS = ((4.5, 0.42), (9.0, 0.38), (6.0, 0.46))  # length and diameter in m
FLYWHEEL, COUPLING, PROPELLER = 2800.0, 160.0, 5200.0  # kg m2
MEAN, SWING = 180e3, 45e3  # N m
PROPELLER_DAMPING = 9e3  # N m s
ORDER, SPEED = 5, 12.5  # excitation order of a five-cylinder engine, rad/s


def ship_line(model: ShaftModel | str = Spectral(8)) -> Network:  # noqa: B008 (a frozen record)
    """Engine flywheel, three sections, a flange disc between the first two, propeller with water damping.

    Args:
        model: of all three sections.
    """
    net = Network("ship line")
    torque = MEAN + SWING * sympy.sin(ORDER * SPEED * t)
    net.add(TorqueSource("engine", tau=torque), "engine end")
    net.add(Inertia("flywheel", J=FLYWHEEL), "engine end")
    nodes = ("engine end", "flange", "tube", "propeller end")
    for k, (length, diameter) in enumerate(SECTIONS, 1):
        shaft = Shaft(f"shaft{k}", length=length, diameter=diameter, model=model)  # type: ignore[arg-type]
        net.add(shaft, nodes[k - 1], nodes[k])
    net.add(Inertia("disc1", J=COUPLING), "flange")
    net.add(Inertia("disc2", J=COUPLING), "tube")
    net.add(Inertia("propeller", J=PROPELLER), "propeller end")
    net.add(Damper("water", d=PROPELLER_DAMPING), "propeller end")
    return net


SHIP_LINE = Scene(
    name="ship-line",
    title="stepped ship line of three sections and two discs, engine torque with its fifth order",
    source="typical of a two-stroke main engine of 2 MW; not from one paper",
    build=ship_line,
    t_end=4.0,
    signals=("shaft1.tau_a", "shaft2.tau_a", "shaft3.tau_b", "propeller.omega"),
    chosen=("all dimensions, inertias and torques are chosen as typical",),
)
