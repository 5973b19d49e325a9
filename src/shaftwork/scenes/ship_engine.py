"""A ship's line behind a four-cylinder engine, for the torsional vibration calculation."""

from __future__ import annotations

import math
from dataclasses import replace

from shaftwork.components.excitations import HarmonicTorque
from shaftwork.components.harmonics import Harmonics
from shaftwork.components.laws import omega
from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.components.shaft_models import Lumped, ShaftModel
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene

RATED_SPEED, FIRING_ORDER = 900.0, (1, 3, 4, 2)  # 1/min
BORE, STROKE, ROD, RECIPROCATING = 0.20, 0.28, 0.56, 22.0  # m, m, m, kg
ORDERS = tuple(k / 2 for k in range(1, 13))
# tangential pressures in Pa: of compression, and of combustion at full load
SINES_COMPRESSION = (183e3, 457e3, 377e3, 389e3, 328e3, 274e3, 226e3, 187e3, 154e3, 124e3, 99e3, 78e3)
SINES = (253e3, 413e3, 443e3, 371e3, 264e3, 181e3, 135e3, 109e3, 78e3, 38e3, 2e3, -16e3)
COSINES = (527e3, 339e3, 124e3, -37e3, -112e3, -125e3, -118e3, -120e3, -130e3, -131e3, -112e3, -84e3)
THROW, CRANK, CYLINDER_DAMPING = 2.0, 4.0e6, 4.0  # kg m2 with half of the piston, N m/rad, N m s
CRANK_DAMPING = 2e-5  # s, of each crank over its stiffness
RING, VISCOUS_DAMPER = 2.0, 400.0  # kg m2, N m s: the ring of the damper at the free end, and the oil between
FLYWHEEL, PROPELLER, BLADES = 45.0, 38.0, 4  # kg m2, kg m2 with entrained water
COUPLING, COUPLING_DAMPING = 1.2e5, 200.0  # N m/rad, N m s: rubber between flywheel and shaft
HUB = 1.5  # kg m2, of the coupling on the side of the shaft
TORQUE = 5000.0  # N m at rated speed
INTERMEDIATE, AFT = (3.0, 0.12), (2.0, 0.13)  # length and diameter in m
DAMPING = 1e-4  # s, of the shafts over their stiffness
SHEAR_MODULUS = 79.3e9  # Pa


def ship_engine(
    model: ShaftModel | str = Lumped(3),  # noqa: B008 (a frozen record)
    *,
    speed: float = 1.0,
) -> Network:
    """Four-cylinder four-stroke engine with damper, flywheel, rubber coupling, two shafts in a row and propeller.

    Args:
        model: of the two shafts.
        speed: at which the mean torque of the engine is that of the propeller, over the rated speed.
    """
    net = Network("ship engine")
    still = (0.0,) * len(ORDERS)
    compression = Harmonics.gas_force(ORDERS, still, SINES_COMPRESSION, bore=BORE, stroke=STROKE)
    full = Harmonics.gas_force(ORDERS, COSINES, SINES, bore=BORE, stroke=STROKE)
    combustion = replace(full, exponent=2.0, omega_n=RATED_SPEED * math.pi / 30)  # the load goes as the propeller's
    masses = Harmonics.reciprocating(RECIPROCATING, stroke=STROKE, rod=ROD)
    angles = HarmonicTorque.firing_angles(FIRING_ORDER)
    for k, angle in enumerate(angles, 1):
        throw = f"throw {k}"
        # the mean torque drives the propeller and what rubs in the engine
        mean = TORQUE * speed**2 / len(angles) + CYLINDER_DAMPING * speed * RATED_SPEED * math.pi / 30
        torques = (("combustion", combustion, mean), ("compression", compression, 0.0), ("piston", masses, 0.0))
        for letter, (name, harmonics, steady) in zip("gzm", torques, strict=True):
            symbol = f"{letter}{k}"
            net.add(
                HarmonicTorque(f"{name} {k}", harmonics=harmonics, mean=steady, firing_angle=angle, symbol=symbol),
                throw,
            )
        net.add(Inertia(throw, J=THROW, symbol=f"{k}"), throw)
        net.add(Damper(f"friction {k}", d=CYLINDER_DAMPING, symbol=f"{k}"), throw)
        behind = f"throw {k + 1}" if k < len(angles) else "flywheel"
        net.add(Spring(f"crank {k}", c=CRANK, d=CRANK_DAMPING * CRANK, symbol=f"c{k}"), throw, behind)
    net.add(Inertia("damper ring", J=RING, symbol="d"), "damper ring")
    net.add(Damper("viscous damper", d=VISCOUS_DAMPER, symbol="v"), "throw 1", "damper ring")
    net.add(Inertia("flywheel", J=FLYWHEEL, symbol="f"), "flywheel")
    net.add(Spring("coupling", c=COUPLING, d=COUPLING_DAMPING, symbol="k"), "flywheel", "hub")
    net.add(Inertia("hub", J=HUB, symbol="h"), "hub")
    net.add(_shaft("intermediate shaft", *INTERMEDIATE, model, "i"), "hub", "flange")
    net.add(_shaft("propeller shaft", *AFT, model, "a"), "flange", "propeller")
    net.add(Inertia("propeller", J=PROPELLER, symbol="p"), "propeller")
    water = -TORQUE * (omega / (RATED_SPEED * math.pi / 30)) ** 2  # ahead
    net.add(TorqueSource("water", tau=water, symbol="w"), "propeller")
    blades = Harmonics.propeller(BLADES, TORQUE, RATED_SPEED * math.pi / 30)
    net.add(HarmonicTorque("wake", harmonics=blades, symbol="b"), "propeller")
    return net


def _shaft(name: str, length: float, diameter: float, model: ShaftModel | str, symbol: str) -> Shaft:
    stiffness = SHEAR_MODULUS * math.pi * diameter**4 / 32
    return Shaft(
        name,
        length=length,
        diameter=diameter,
        shear_modulus=SHEAR_MODULUS,
        damping=DAMPING * stiffness,
        model=model,  # type: ignore[arg-type]
        symbol=symbol,
    )


SHIP_ENGINE = Scene(
    name="ship-engine",
    title="four-cylinder four-stroke engine with flywheel, coupling, shaft and propeller, all orders of its torques",
    source="typical of a medium-speed engine of 470 kW; not from one paper",
    build=ship_engine,
    t_end=0.5,
    signals=("intermediate shaft.tau_a", "propeller shaft.tau_b", "crank 4.tau", "propeller.omega"),
    chosen=(
        "all dimensions, inertias and dampings are chosen as typical",
        "gas torques: harmonics of an ideal cycle, compression 13 : 1, polytropic exponent 1.36, 0.25 MPa of boost, "
        "rounded; combustion grows with the load, which goes with the square of the speed",
        "propeller of four blades whose torque swings by 5 % and 1 % in the first two blade orders",
    ),
)
