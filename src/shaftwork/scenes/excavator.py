"""The bucket wheel drive of an excavator, as two masses and gear by gear: Marinkovic 2012, figures 2 and 13."""

from __future__ import annotations

from shaftwork.components.bucket_wheel import BucketWheelLoad, Soil
from shaftwork.components.drives import motors
from shaftwork.components.mechanics import Gear, Inertia, Spring
from shaftwork.components.motors import CageMotor
from shaftwork.core.errors import NetworkWarning
from shaftwork.core.notices import muted
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import GearStage, Scene, add_reducer, steel

T_DIG, T_END = 5.0, 30.0  # s: from then on it digs; end of figure 13
PULL_UP_SPEED = 537.0  # 1/min, chosen: the one number with which the start has both of the extremes of figure 13
RATIO = 120.0  # chosen: with 6 m across the edges cut at 2.6 m/s
RADIUS, EDGE = 3.0, 0.6  # m, chosen: their product gives the mean of figure 13 in grey clay
ALPHA = 2.0  # rad, chosen: a bucket leaves the soil after 115 degrees
RISE = 1.0  # s, chosen: the wheel comes to its full depth

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


def excavator(
    soil: Soil | str = "grey clay",
    *,
    seed: float = 1.0,
    pull_up_speed: float = PULL_UP_SPEED,
    ratio: float = RATIO,
    radius: float = RADIUS,
    edge: float = EDGE,
    alpha: float = ALPHA,
) -> Network:
    """Start of the wheel in the air, from 5 s on digging; inertias and stiffness referred to the motor shaft.

    Args:
        soil: "fault zone", "transitional zone", "grey clay", or a `Soil`.
        seed: of the cutting resistance of the buckets.
        pull_up_speed: of the motor, 1/min.
        ratio: motor speed over wheel speed.
        radius: of the cutting edges, m.
        edge: mean length of an edge in the soil, m.
        alpha: angle at which a bucket leaves the soil, rad.
    """
    net = Network("excavator")
    net.add(cage_motor(pull_up_speed), "rotor")
    net.add(Inertia("J1", J=27.0, symbol="1"), "rotor")
    net.add(Spring("shaft", c=1608.0, symbol="sh"), "rotor", "coupling")
    net.add(Inertia("J2", J=8.2, symbol="2"), "coupling")
    net.add(Gear("reducer", ratio=ratio, symbol="R"), "coupling", "wheel")
    net.add(digging(soil, seed=seed, radius=radius, edge=edge, alpha=alpha), "wheel")
    return net


def digging(
    soil: Soil | str, *, seed: float, radius: float = RADIUS, edge: float = EDGE, alpha: float = ALPHA
) -> BucketWheelLoad:
    """The wheel in the soil, from 5 s on; arguments as of `excavator`."""
    values = {"radius": radius, "edge": edge, "alpha": alpha, "seed": seed, "t_on": T_DIG, "rise": RISE}
    return BucketWheelLoad("digging", soil=soil, symbol="w", **values)  # type: ignore[arg-type]


def cage_motor(pull_up_speed: float) -> CageMotor:
    """The motor with a speed at pull-up, 1/min, without a warning of its curve."""
    with muted(NetworkWarning):
        # the quartic first rises to 5.8 kN m at 110 1/min: the price of the extremes of figure 13
        return motors["excavator 250 kW"].cage("motor", n_s=pull_up_speed, symbol="M")


EXCAVATOR = Scene(
    name="excavator",
    title="bucket wheel drive of an excavator, start in the air and digging",
    source="Marinkovic 2012, section 3, figure 13",
    build=excavator,
    t_end=T_END,
    signals=("shaft.tau", "motor.tau", "J1.omega", "J2.omega"),
    chosen=(
        "speed at pull-up 537 1/min, with which the start has both T_max and T_min of figure 13; the quartic then "
        "first rises to 5.8 kN m at 110 1/min; synchronous speed 1000 1/min",
        "grey clay: the source does not say in which of its three soils figure 13 digs",
        "gear ratio 120 and edges at a radius of 3 m, which cut at 2.6 m/s; their mean length of 0.6 m in the soil "
        "gives T_mean of figure 13; a bucket leaves the soil after 2 rad; losses of the reducer are left out",
        "from 5 s on the wheel comes to its full depth within 1 s",
    ),
)


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
