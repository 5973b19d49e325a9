"""A step of torque on the steel shaft of Popenda 2019, as one `Shaft` with a model to choose."""

from __future__ import annotations

from shaftwork.components.rotation import Inertia
from shaftwork.components.shaft_models import Lumped, ShaftModel
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
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
    net = Network("shaft step")
    net.add(TorqueSource("motor", tau=torque, symbol="e"), "motor end")
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


SHAFT_STEP = Scene(
    name="shaft-step",
    title="steel shaft between motor and load, torque step, model to choose",
    source="Popenda 2019, (8)-(23), data of section Results",
    build=shaft_step,
    t_end=0.2,
    signals=("line.tau_a", "line.tau_b", "Je.omega", "Jm.omega"),
    chosen=(
        "shear modulus 77.5 GPa (steel) instead of the printed 7750 MN/m2",
        "torque step 12.7 N m (4 kW at 3000 1/min) instead of the BLDC motor",
        "no damping",
    ),
)
