"""Long shafts: the steel shaft of Popenda 2019 as a chain, with a model to choose and behind a motor; a ship line."""

from __future__ import annotations

import math

import sympy

from shaftwork.components.base import Component
from shaftwork.components.bldc import BLDCMotor
from shaftwork.components.laws import t
from shaftwork.components.loads import CoulombLoad
from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.components.shaft_models import Lumped, ShaftModel, Spectral
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene

LENGTH, DIAMETER, DENSITY = 1.0, 0.02, 7900.0  # m, m, kg/m3
SHEAR_MODULUS = 77.5e9  # Pa: steel; the source prints 7750 MN/m2, ten times too small
MOTOR_INERTIA, LOAD_INERTIA = 0.025, 0.11  # kg m2
RATED_TORQUE = 12.7  # N m: 4 kW at 3000 1/min

VOLTAGE = 540.0  # V, chosen: mains of 400 V, rectified
BACK_EMF, RATED_SPEED = 212.0, 3000.0  # V, taken as the flat top of a phase; 1/min
MOTOR = {
    "R": 0.5,
    "L": 7.4e-3 + 1.6e-3,
    "k": BACK_EMF / (math.pi / 30 * RATED_SPEED),
    "pole_pairs": 2.0,  # chosen
}
DAMPING = 0.02  # N m2 s/rad, chosen: 0.002 of critical at the lowest frequency with J_m = 0.11

SECTIONS = ((4.5, 0.42), (9.0, 0.38), (6.0, 0.46))  # length and diameter in m
FLYWHEEL, COUPLING, PROPELLER = 2800.0, 160.0, 5200.0  # kg m2
MEAN, SWING = 180e3, 45e3  # N m
PROPELLER_DAMPING = 9e3  # N m s
ORDER, SPEED = 5, 12.5  # excitation order of a five-cylinder engine, rad/s

_STEEL = "shear modulus 77.5 GPa (steel) instead of the printed 7750 MN/m2"
_OF_A_STEP = (_STEEL, "torque step 12.7 N m (4 kW at 3000 1/min) instead of the BLDC motor", "no damping")


def shaft_chain(
    m: int = 20,
    *,
    load_inertia: float = LOAD_INERTIA,
    shear_modulus: float = SHEAR_MODULUS,
    damping: float = 0.0,
    torque: float = RATED_TORQUE,
) -> Network:
    """The shaft as m equal inertias with m - 1 springs between motor and load, under a torque step at the motor.

    Args:
        m: number of elements, 2 or more.
        load_inertia: inertia at the far end, kg m2 (the source has 0.11 and 0.025).
        shear_modulus: Pa.
        damping: of each spring, N m s/rad.
        torque: the step, N m.

    Raises:
        ParameterError: m is less than 2.
    """
    if m < 2:
        raise ParameterError(f"shaft_chain: m = {m} elements make no shaft; give 2 or more.")
    polar = math.pi * DIAMETER**4 / 32
    stiffness = shear_modulus * polar / (LENGTH / (m - 1))
    net = Network("shaft chain")
    net.add(TorqueSource("motor", tau=torque, symbol="e"), "n1")
    net.add(Inertia("Je", J=MOTOR_INERTIA, symbol="e"), "n1")
    for k in range(1, m + 1):
        net.add(Inertia(f"J{k}", J=DENSITY * polar * LENGTH / m), f"n{k}")
        if k < m:
            net.add(Spring(f"c{k}", c=stiffness, d=damping), f"n{k}", f"n{k + 1}")
    net.add(Inertia("Jm", J=load_inertia, symbol="m"), f"n{m}")
    return net


SHAFT_CHAIN = Scene(
    name="shaft-chain",
    title="steel shaft as 20 explicit elements between motor and load, torque step",
    source="Popenda 2019, (1)-(4), data of section Results",
    build=shaft_chain,
    t_end=0.2,
    signals=("c1.tau", "c10.tau", "c19.tau", "Je.omega", "Jm.omega"),
    chosen=_OF_A_STEP,
)


def shaft_step(
    model: ShaftModel | str = Lumped(20),  # noqa: B008 (a frozen record)
    *,
    load_inertia: float = LOAD_INERTIA,
    shear_modulus: float = SHEAR_MODULUS,
    damping: float = 0.0,
    torque: float = RATED_TORQUE,
) -> Network:
    """Motor, shaft and rotating mass under a torque step at the motor.

    Args:
        model: of the shaft.
        load_inertia: inertia at the far end, kg m2 (the source has 0.11 and 0.025).
        shear_modulus: Pa; the source prints 7.75e9, ten times too small for steel.
        damping: internal damping D', N m2 s/rad.
        torque: the step, N m.
    """
    motor = TorqueSource("motor", tau=torque, symbol="e")
    return _two_masses("shaft step", motor, model, load_inertia, shear_modulus, damping)


SHAFT_STEP = Scene(
    name="shaft-step",
    title="steel shaft between motor and load, torque step, model to choose",
    source="Popenda 2019, (8)-(23), data of section Results",
    build=shaft_step,
    t_end=0.2,
    signals=("line.tau_a", "line.tau_b", "Je.omega", "Jm.omega"),
    chosen=_OF_A_STEP,
)


def bldc_shaft(
    J_m: float = LOAD_INERTIA,
    model: ShaftModel | str = Spectral(8),  # noqa: B008 (a frozen record)
    *,
    shear_modulus: float = SHEAR_MODULUS,
    damping: float = DAMPING,
    voltage: float = VOLTAGE,
    torque: float = RATED_TORQUE,
) -> Network:
    """Motor on its inverter from rest, without current control; shaft, rotating mass and rated load.

    Args:
        J_m: the rotating mass, kg m2 (the source has 0.11 and 0.025).
        model: of the shaft: lumped, such as OneSpring() and Lumped(20), or distributed.
        shear_modulus: Pa; the source prints 7.75e9, ten times too small for steel.
        damping: internal damping D', N m2 s/rad.
        voltage: of the inverter, V.
        torque: of the load, N m, against the motion.
    """
    motor = BLDCMotor("motor", U=voltage, symbol="M", **MOTOR)
    net = _two_masses("bldc shaft", motor, model, J_m, shear_modulus, damping)
    net.add(CoulombLoad("load", tau=torque, symbol="w"), "load end")
    return net


BLDC_SHAFT = Scene(
    name="bldc-shaft",
    title="brushless motor, steel shaft and rotating mass, start on full voltage",
    source="Popenda 2019, figures 4 to 13, data of section Results",
    build=bldc_shaft,
    t_end=0.5,
    signals=("motor.tau", "motor.i_a", "line.tau_a", "line.tau_b", "Je.omega", "Jm.omega"),
    chosen=(
        "direct voltage 540 V (400 V mains, rectified), two pole pairs, flat tops of 120 degrees; 212 V are the "
        "flat top of a phase at 3000 1/min, and L_mu and L_sigma together are the inductance of a phase",
        "load of 12.7 N m (4 kW at 3000 1/min), against the motion from standstill on",
        _STEEL,
        "internal damping of the shaft 0.02 N m2 s/rad, 0.002 of critical at the lowest frequency",
    ),
)


def _two_masses(
    name: str, motor: Component, model: ShaftModel | str, load_inertia: float, shear_modulus: float, damping: float
) -> Network:
    """A motor and its inertia, the steel shaft and the rotating mass."""
    net = Network(name)
    net.add(motor, "motor end")
    net.add(Inertia("Je", J=MOTOR_INERTIA, symbol="e"), "motor end")
    shaft = Shaft(
        "line",
        length=LENGTH,
        diameter=DIAMETER,
        density=DENSITY,
        shear_modulus=shear_modulus,
        damping=damping,
        model=model,  # type: ignore[arg-type]
        symbol="",
    )
    net.add(shaft, "motor end", "load end")
    net.add(Inertia("Jm", J=load_inertia, symbol="m"), "load end")
    return net


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
