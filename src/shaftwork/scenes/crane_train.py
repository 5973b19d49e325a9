"""The travel drive of a laboratory crane, gear by gear: Marinkovic 2012, sections 2.1 and 2.2, figure 1."""

from __future__ import annotations

from shaftwork.components.friction import Brake
from shaftwork.components.loads import CoulombLoad
from shaftwork.components.rotation import Inertia, Spring
from shaftwork.components.translation import Mass, TranslationalSpring, Wheel
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene, choice
from shaftwork.scenes.crane import BRAKE_AT_MOTOR, GEAR, MOTOR, RESISTANCE, T_BRAKE, WHEEL_RADIUS
from shaftwork.scenes.reducer import DAMPING, GearStage, add_reducer, steel

# All chosen, in whole teeth and such that what is before the last shaft, each inertia times the square of 35.5, 10, 2.5
# or 1, is J_1 = 27.35 of the source, and wheel and mass together are its J_2 = 62.5 kg m2.
ROTOR, COUPLING = 0.0172, 0.003  # kg m2: rotor with its fan, and coupling with the disc of the brake
STAGES = (
    GearStage(71 / 20, pinion=0.0002, gear=0.0115, mesh=5e5, shaft=3.8e4),
    GearStage(80 / 20, pinion=0.001, gear=0.036, mesh=1.5e6, shaft=1.17e5),
    GearStage(50 / 20, pinion=0.004, gear=0.1409, mesh=5e6),
)
MOTOR_SHAFT, INPUT_SHAFT = 12e3, 400.0  # N m/rad: the second with the rubber of the coupling
RUBBER = 0.1  # N m s/rad
WHEEL, CRANE = 0.15625, 3990.0  # kg m2, kg: a wheel of 10 kg at its rim; 4.0 t together
FRAME = 5e7  # N/m: from the axle of the wheel to the mass


def crane_train(*, mesh: str = "elastic", losses: str = "torques") -> Network:
    """The crane as a train of ten masses: rotor, coupling, six gears, wheel, crane; start, travel and braking.

    Each shaft counts its speed in its own direction. At the node "wheel" it is the scene `crane` with compliance
    elsewhere: "shaft" is the shaft on which the source measures.

    Args:
        mesh: "elastic", or "rigid" as in the source, which leaves seven masses and six springs.
        losses: where the efficiency of 0.95 is: in the "torques" of motor and brake, as (18) of the source has it, so
            that inertias are referred by energy alone; or in the "gears", each stage its share, by the direction of the
            power. Then the driving masses count 0.95 of their energy while the motor drives.

    Raises:
        ParameterError: there is no such mesh, or no such place of losses.
    """
    total = GEAR["efficiency"]
    places = {"torques": (total, 1.0), "gears": (1.0, total ** (1 / len(STAGES)))}
    at_motor, at_stage = choice("place of losses", losses, "crane train", places)
    net = Network("crane train")
    net.add(MOTOR.cage("motor", t_off=T_BRAKE, efficiency=at_motor, symbol="M"), "rotor")
    net.add(Inertia("rotor", J=ROTOR), "rotor")
    net.add(steel("motor shaft", MOTOR_SHAFT, "s0"), "rotor", "coupling")
    net.add(Inertia("coupling", J=COUPLING), "coupling")
    net.add(Brake("brake", tau=BRAKE_AT_MOTOR * at_motor, t_on=T_BRAKE, symbol="B"), "coupling")
    net.add(Spring("input shaft", c=INPUT_SHAFT, d=RUBBER, symbol="s1"), "coupling", "gear 1")
    last = add_reducer(net, STAGES, mesh, at_stage)
    net.add(Spring("shaft", c=24206.0, d=14.0, symbol="sh"), last, "wheel")
    net.add(Inertia("wheel", J=WHEEL), "wheel")
    net.add(CoulombLoad("load", tau=RESISTANCE, symbol="w"), "wheel")
    net.add(Wheel("rail", radius=WHEEL_RADIUS), "wheel", "axle")
    net.add(TranslationalSpring("frame", c=FRAME, d=DAMPING * FRAME), "axle", "crane")
    net.add(Mass("crane", m=CRANE), "crane")
    return net


CRANE_TRAIN = Scene(
    name="crane-train",
    title="crane travel drive as ten masses from rotor to crane, start, travel and braking",
    source="Marinkovic 2012, sections 2.1 and 2.2, figure 1; it reduces to section 3",
    build=crane_train,
    t_end=10.0,
    signals=("shaft.tau", "input shaft.tau", "motor.tau", "rotor.omega", "crane.v"),
    chosen=(
        "teeth 20:71, 20:80, 20:50, all inertias, and the 10 kg at the rim of the wheel, such that at the wheel "
        "J1 = 27.35, J2 = 62.5 kg m2 and i = 35.5",
        "stiffness of all shafts but the last one, of teeth and frame, and their damping",
        "motor, brake and resistance of the scene crane; efficiency in the torques of motor and brake, as (18)",
    ),
)
