"""The travel drive of a laboratory crane: Marinkovic 2012, section 3, figures 9 and 10."""

from __future__ import annotations

import math

from shaftwork.components.loads import CoulombLoad
from shaftwork.components.machines import KlossMotor
from shaftwork.components.rotation import Inertia, Spring
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene, enter

SYNCHRONOUS_SPEED = 3000.0  # 1/min: two poles at 50 Hz
RATED_SPEED, RATED_TORQUE = 2510.0, 3.8  # 1/min and N m, printed for the motor KBF-90 LA 2
WHEEL_RADIUS = 0.125  # m
PULL_OUT_TORQUE = (
    8.0  # N m, chosen: printed only in a figure; with it the start takes about 5 s, as in figures 9 and 10
)


def slip_at_pull_out(pull_out_torque: float) -> float:
    """The slip at the pull-out torque for which Kloss' curve passes through the rated point.

    Law: tau_n / tau_k = 2 / (s_n/s_k + s_k/s_n), the larger root. Source: Marinkovic 2012, (2).
    """
    overload = pull_out_torque / RATED_TORQUE
    return (1 - RATED_SPEED / SYNCHRONOUS_SPEED) * (overload + math.sqrt(overload**2 - 1))


def crane_start(pull_out_torque: float = PULL_OUT_TORQUE) -> Network:
    """The crane from rest to steady travel: everything referred to the wheel shaft, as the source does.

    J2 is the crane itself: 4.0 t at the wheel's radius of 0.125 m. Its travel speed is `WHEEL_RADIUS` times J2.omega.

    Args:
        pull_out_torque: of the motor, N m; more than the rated 3.8 N m.
    """
    net = Network("crane start")
    net.add(
        KlossMotor(
            "motor",
            tau_k=pull_out_torque,
            s_k=slip_at_pull_out(pull_out_torque),
            n_sync=SYNCHRONOUS_SPEED,
            ratio=35.5,
            efficiency=0.95,
            symbol="M",
        ),
        "rotor",
    )
    net.add(Inertia("J1", J=27.35, symbol="1"), "rotor")
    net.add(Spring("shaft", c=24206.0, d=14.0, symbol="sh"), "rotor", "wheel")
    net.add(Inertia("J2", J=62.5, symbol="2"), "wheel")
    net.add(CoulombLoad("load", tau=22.4, symbol="w"), "wheel")
    return net


CRANE_START = enter(
    Scene(
        name="crane-start",
        title="crane travel drive, start and steady travel",
        source="Marinkovic 2012, section 3, figures 9 and 10",
        build=crane_start,
        t_end=6.5,
        signals=("shaft.tau", "motor.tau", "J1.omega", "J2.omega"),
        chosen=(
            "pull-out torque 8.0 N m (printed only in a figure), slip at pull-out from Kloss through the printed rated "
            "point 2510 1/min, 3.8 N m",
            "Kloss' curve from standstill on; the pull-up dip of the cage motor is left out",
            "travel resistance 22.4 N m rounded below 0.01 rad/s instead of true sticking",
        ),
    )
)
