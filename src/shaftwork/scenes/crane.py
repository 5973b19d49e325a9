"""The travel drive of a laboratory crane: Marinkovic 2012, section 3, figures 9 to 12, and its phases, figure 4."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from shaftwork.components.base import Component
from shaftwork.components.contacts import Backlash
from shaftwork.components.drives import PullOutDrive
from shaftwork.components.friction import Brake
from shaftwork.components.loads import CoulombLoad, RandomLoad
from shaftwork.components.motor_catalogue import motors
from shaftwork.components.rotation import Inertia, Spring
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import Scene, choice

MOTOR = motors["KBF-90 LA 2"]
WHEEL_RADIUS = 0.125  # m
GEAR = {"ratio": 35.5, "efficiency": 0.95}
BRAKE_AT_MOTOR = 9.6  # N m
BRAKE_TORQUE = BRAKE_AT_MOTOR * GEAR["ratio"] * GEAR["efficiency"]  # N m at the wheel shaft, (18): 323.76
T_BRAKE = 6.5  # s: then the motor is off and the brake on
RESISTANCE, SPREAD = 22.4, 10.0  # N m: mean and standard deviation
INTERVAL = 0.05  # s, chosen: from one random resistance to the next
T_RAMP = 4.0  # s, chosen: of the frequency
GAP = 0.003  # rad, chosen: the source names a gap and gives no value


def crane(*, gap: float = 0.0, load: str = "constant", start: str = "direct", seed: float = 1.0) -> Network:
    """The crane from rest to rest: start, steady travel, from 6.5 s on braking, and ringing down.

    Everything is referred to the wheel shaft, as the source does. J2 is the crane itself: 4.0 t at the wheel's radius
    of 0.125 m. Its travel speed is `WHEEL_RADIUS` times J2.omega.

    Args:
        gap: whole free twist of the shaft, rad. The motion starts in its middle; "shaft.phi" starts it elsewhere.
        load: "constant", or "random" as in figure 11.
        start: "direct" on the mains; "frequency", a ramp of the frequency from 2.5 to 50 Hz; "pull-out", the curve 1 of
            figure 6, along which figure 12 starts.
        seed: of the random resistance.

    Raises:
        ParameterError: there is no such load or start.
    """
    return _travel("crane", gap, load, start, seed)


def six_phases(gap: float = GAP) -> Network:
    """The crane from the middle of an open gap: all phases of figure 4, (12) to (16).

    Args:
        gap: whole free twist of the shaft, rad; above zero.

    Raises:
        ParameterError: there is no gap.
    """
    if not gap > 0:
        raise ParameterError(
            f"six_phases: gap = {gap} rad leaves nothing to close; give more than zero, or take crane."
        )
    return _travel("six phases", gap, "constant", "direct", 1.0)


def crane_start(pull_out_torque: float = MOTOR.tau_k) -> Network:
    """The crane from rest to steady travel, by Kloss' formula alone.

    Args:
        pull_out_torque: of the motor, N m; more than the rated 3.8 N m.

    Raises:
        ParameterError: it is not more.
    """
    tau_k = in_si("crane_start: pull_out_torque", pull_out_torque, "N*m")
    if not tau_k > MOTOR.tau_n:
        raise ParameterError(
            f"crane_start: pull_out_torque = {tau_k} N m must be more than the rated {MOTOR.tau_n} N m."
        )
    net = Network("crane start")
    net.add(replace(MOTOR, tau_k=tau_k).kloss("motor", symbol="M", **GEAR), "rotor")
    net.add(Inertia("J1", J=27.35, symbol="1"), "rotor")
    net.add(_shaft(0.0), "rotor", "wheel")
    net.add(Inertia("J2", J=62.5, symbol="2"), "wheel")
    net.add(_load("constant"), "wheel")
    return net


def _travel(name: str, gap: float, load: str, start: str, seed: float) -> Network:
    net = Network(name)
    net.add(_motor(start), "rotor")
    net.add(Inertia("J1", J=27.35, symbol="1"), "rotor")
    net.add(Brake("brake", tau=BRAKE_TORQUE, t_on=T_BRAKE, symbol="B"), "rotor")
    net.add(_shaft(gap), "rotor", "wheel")
    net.add(Inertia("J2", J=62.5, symbol="2"), "wheel")
    net.add(_load(load, seed), "wheel")
    return net


def _motor(start: str) -> Component:
    values: dict[str, Any] = {"t_off": T_BRAKE, "symbol": "M", **GEAR}
    curve: dict[str, Any] = {"tau_k": MOTOR.tau_k, "s_k": MOTOR.s_k, "n_sync": MOTOR.n_sync}
    starts: dict[str, Callable[[], Component]] = {
        "direct": lambda: MOTOR.cage("motor", **values),
        "frequency": lambda: MOTOR.drive("motor", t_ramp=T_RAMP, **values),
        "pull-out": lambda: PullOutDrive("motor", **curve, **values),
    }
    return choice("start", start, "crane", starts)()


def _shaft(gap: float) -> Component:
    values: dict[str, Any] = {"c": 24206.0, "d": 14.0, "symbol": "sh"}
    return Backlash("shaft", gap=gap, **values) if gap else Spring("shaft", **values)


def _load(kind: str, seed: float = 1.0) -> Component:
    loads: dict[str, Callable[[], Component]] = {
        "constant": lambda: CoulombLoad("load", tau=RESISTANCE, symbol="w"),
        "random": lambda: RandomLoad("load", mean=RESISTANCE, std=SPREAD, interval=INTERVAL, seed=seed, symbol="w"),
    }
    return choice("load", kind, "crane", loads)()


_CURVE = (
    "pull-out torque 8.0 N m (printed only in a figure), such that the start takes about 5 s; its slip from Kloss "
    "through the printed rated point 2510 1/min, 3.8 N m"
)

CRANE_START = Scene(
    name="crane-start",
    title="crane travel drive, start and steady travel",
    source="Marinkovic 2012, section 3, figures 9 and 10",
    build=crane_start,
    t_end=6.5,
    signals=("shaft.tau", "motor.tau", "J1.omega", "J2.omega"),
    chosen=(_CURVE, "Kloss' curve from standstill on; the pull-up dip of the cage motor is left out"),
)

CRANE = Scene(
    name="crane",
    title="crane travel drive, start, steady travel, braking and ringing down",
    source="Marinkovic 2012, section 3, figures 9 to 12",
    build=crane,
    t_end=10.0,
    signals=("shaft.tau", "motor.tau", "brake.tau", "J1.omega", "J2.omega"),
    chosen=(
        _CURVE,
        "locked-rotor torque 7.0 and pull-up torque 6.4 N m (printed only in a figure)",
        "no gap; with gap > 0 the motion starts in the middle of it",
        "with load='random' a new number every 0.05 s; with start='frequency' a ramp of 4 s",
    ),
)

SIX_PHASES = Scene(
    name="six-phases",
    title="crane travel drive from an open gap, phase by phase",
    source="Marinkovic 2012, section 2.1, figure 4, (12)-(16)",
    build=six_phases,
    t_end=10.0,
    signals=("shaft.tau", "motor.tau", "brake.tau", "J1.omega", "J2.omega"),
    chosen=(
        "gap of 0.003 rad between the flanks, at first in its middle",
        "the motor of the scene crane",
    ),
    phases=(
        "load stuck, shaft open, brake released",
        "load stuck, shaft in contact, brake released",
        "load slipping forward, shaft in contact, brake released",
        "load slipping forward, shaft in contact backward, brake slipping forward",
        "load slipping backward, shaft in contact, brake locked",
    ),
)
