"""The m-element chain of a long shaft: Popenda 2019, equations (1) to (4), with the data of his steel shaft."""

from __future__ import annotations

import math

from shaftwork.components.rotation import Inertia, Spring
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene

LENGTH, DIAMETER, DENSITY = 1.0, 0.02, 7900.0  # m, m, kg/m3
SHEAR_MODULUS = 77.5e9  # Pa: steel
PRINTED_SHEAR_MODULUS = 7.75e9  # Pa: 7750 MN/m2 as printed, ten times too small for steel
MOTOR_INERTIA, LOAD_INERTIA = 0.025, 0.11  # kg m2
RATED_TORQUE = 12.7  # N m: 4 kW at 3000 1/min


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
    chosen=(
        "shear modulus 77.5 GPa (steel) instead of the printed 7750 MN/m2",
        "torque step 12.7 N m (4 kW at 3000 1/min) instead of the BLDC motor",
        "no damping",
    ),
)
