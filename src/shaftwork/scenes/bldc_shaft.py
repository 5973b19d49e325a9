"""A brushless motor that starts a rotating mass through a steel shaft: Popenda 2019, figures 4 to 13."""

from __future__ import annotations

import math

from shaftwork.components.bldc import BLDCMotor
from shaftwork.components.loads import CoulombLoad
from shaftwork.components.rotation import Inertia
from shaftwork.components.shaft_models import ShaftModel, Spectral
from shaftwork.components.shafts import Shaft
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene
from shaftwork.scenes.shaft_chain import (
    DENSITY,
    DIAMETER,
    LENGTH,
    LOAD_INERTIA,
    MOTOR_INERTIA,
    RATED_TORQUE,
    SHEAR_MODULUS,
)

VOLTAGE = 540.0  # V, chosen: mains of 400 V, rectified
BACK_EMF, RATED_SPEED = 212.0, 3000.0  # V, taken as the flat top of a phase; 1/min
MOTOR = {
    "R": 0.5,
    "L": 7.4e-3 + 1.6e-3,
    "k": BACK_EMF / (math.pi / 30 * RATED_SPEED),
    "pole_pairs": 2.0,  # chosen
}
DAMPING = 0.02  # N m2 s/rad, chosen: 0.002 of critical at the lowest frequency with J_m = 0.11


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
    net = Network("bldc shaft")
    net.add(BLDCMotor("motor", U=voltage, symbol="M", **MOTOR), "motor end")
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
    net.add(Inertia("Jm", J=J_m, symbol="m"), "load end")
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
        "shear modulus 77.5 GPa (steel) instead of the printed 7750 MN/m2",
        "internal damping of the shaft 0.02 N m2 s/rad, 0.002 of critical at the lowest frequency",
    ),
)
