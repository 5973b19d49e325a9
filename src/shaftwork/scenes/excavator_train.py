"""The bucket wheel drive of an excavator, gear by gear: Marinkovic 2012, sections 2.1 and 2.2, figure 2."""

from __future__ import annotations

from shaftwork.components.bucket_wheel import Soil
from shaftwork.components.rotation import Inertia, Spring
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene
from shaftwork.scenes.excavator import PULL_UP_SPEED, T_END, cage_motor, digging
from shaftwork.scenes.reducer import GearStage, add_reducer, steel

# All chosen, in whole teeth and such that rotor and coupling are J_1 = 27 of the source, and what is behind the inlet
# shaft its J_2 = 8.2 kg m2, each inertia divided by the square of 1, 3, 12, 48 or 120, the ratio down to it.
ROTOR, COUPLING = 10.5, 16.5  # kg m2: the second with the drum of the brake
STAGES = (
    GearStage(60 / 20, pinion=0.3, gear=8.1, mesh=4.5e7, shaft=6e5),
    GearStage(80 / 20, pinion=1.35, gear=38.4, mesh=1.5e8, shaft=8e6),
    GearStage(80 / 20, pinion=4.8, gear=430.0, mesh=8e8, shaft=1e8),
    GearStage(50 / 20, pinion=30.8, gear=1440.0, mesh=4e9),
)
MOTOR_SHAFT, WHEEL_SHAFT = 2e6, 4.5e8  # N m/rad
WHEEL = 90_000.0  # kg m2: with its buckets


def excavator_train(soil: Soil | str = "grey clay", *, seed: float = 1.0, mesh: str = "elastic") -> Network:
    """The excavator as a train of eleven masses: rotor, coupling with brake, eight gears, bucket wheel.

    Each shaft counts its speed in its own direction. At the node "rotor" it is the scene `excavator` with compliance
    elsewhere: "shaft", with the rubber of the coupling, is the inlet shaft whose torque the source shows. The plates of
    the coupling on the second shaft do not slip.

    Args:
        soil: "fault zone", "transitional zone", "grey clay", or a `Soil`.
        seed: of the cutting resistance of the buckets.
        mesh: "elastic", or "rigid" as in the source, which leaves seven masses and six springs.

    Raises:
        ParameterError: there is no such mesh.
    """
    net = Network("excavator train")
    net.add(cage_motor(PULL_UP_SPEED), "rotor")
    net.add(Inertia("rotor", J=ROTOR), "rotor")
    net.add(steel("motor shaft", MOTOR_SHAFT, "s0"), "rotor", "coupling")
    net.add(Inertia("coupling", J=COUPLING), "coupling")
    net.add(Spring("shaft", c=1608.0, symbol="sh"), "coupling", "gear 1")
    last = add_reducer(net, STAGES, mesh)
    net.add(steel("wheel shaft", WHEEL_SHAFT, "s5"), last, "wheel")
    net.add(Inertia("wheel", J=WHEEL), "wheel")
    net.add(digging(soil, seed=seed), "wheel")
    return net


EXCAVATOR_TRAIN = Scene(
    name="excavator-train",
    title="bucket wheel drive of an excavator as eleven masses from rotor to wheel, start in the air and digging",
    source="Marinkovic 2012, sections 2.1 and 2.2, figure 2; it reduces to section 3",
    build=excavator_train,
    t_end=T_END,
    signals=("shaft.tau", "wheel shaft.tau", "motor.tau", "rotor.omega", "wheel.omega"),
    chosen=(
        "teeth 20:60, 20:80, 20:80, 20:50 and all inertias, such that at the motor J1 = 27 and J2 = 8.2 kg m2",
        "stiffness of all shafts but the inlet shaft, and of the teeth, and their damping; the plates of the coupling "
        "on the second shaft do not slip",
        "motor, wheel and soil of the scene excavator",
    ),
)
