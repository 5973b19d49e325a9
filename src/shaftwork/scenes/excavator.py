"""The bucket wheel drive of an excavator: Marinkovic 2012, section 3, figure 13."""

from __future__ import annotations

from shaftwork.components.bucket_wheel import BucketWheelLoad, Soil
from shaftwork.components.motor_catalogue import motors
from shaftwork.components.motors import CageMotor
from shaftwork.components.rotation import Gear, Inertia, Spring
from shaftwork.core.errors import NetworkWarning
from shaftwork.core.notices import muted
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene

T_DIG, T_END = 5.0, 30.0  # s: from then on it digs; end of figure 13
PULL_UP_SPEED = 537.0  # 1/min, chosen: the one number with which the start has both of the extremes of figure 13
RATIO = 120.0  # chosen: with 6 m across the edges cut at 2.6 m/s
RADIUS, EDGE = 3.0, 0.6  # m, chosen: their product gives the mean of figure 13 in grey clay
ALPHA = 2.0  # rad, chosen: a bucket leaves the soil after 115 degrees
RISE = 1.0  # s, chosen: the wheel comes to its full depth


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
