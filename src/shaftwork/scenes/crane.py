"""The travel drive of a laboratory crane, as two masses and gear by gear: Marinkovic 2012, figures 1, 4 and 9 to 12."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from shaftwork.components.base import Component
from shaftwork.components.contacts import Backlash
from shaftwork.components.drives import PullOutDrive, motors
from shaftwork.components.friction import Brake
from shaftwork.components.loads import CoulombLoad, RandomLoad
from shaftwork.components.mechanics import Inertia, Mass, Spring, TranslationalSpring, Wheel
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.pipeline.network import Network
from shaftwork.scenes.catalog import DAMPING, GearStage, Scene, add_reducer, choice, steel

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
WHEEL_INERTIA, CRANE_MASS = 0.15625, 3990.0  # kg m2, kg: a wheel of 10 kg at its rim; 4.0 t together
FRAME = 5e7  # N/m: from the axle of the wheel to the mass


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
    motor = replace(MOTOR, tau_k=tau_k).kloss("motor", symbol="M", **GEAR)
    return _two_masses("crane start", motor, None, _shaft(), _load("constant"))


def _travel(name: str, gap: float, load: str, start: str, seed: float) -> Network:
    brake = Brake("brake", tau=BRAKE_TORQUE, t_on=T_BRAKE, symbol="B")
    return _two_masses(name, _motor(start), brake, _shaft(gap), _load(load, seed))


def _two_masses(name: str, motor: Component, brake: Brake | None, shaft: Component, load: Component) -> Network:
    net = Network(name)
    net.add(motor, "rotor")
    net.add(Inertia("J1", J=27.35, symbol="1"), "rotor")
    if brake is not None:
        net.add(brake, "rotor")
    net.add(shaft, "rotor", "wheel")
    net.add(Inertia("J2", J=62.5, symbol="2"), "wheel")
    net.add(load, "wheel")
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


def _shaft(gap: float = 0.0) -> Component:
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
    net.add(_shaft(), last, "wheel")
    net.add(Inertia("wheel", J=WHEEL_INERTIA), "wheel")
    net.add(CoulombLoad("load", tau=RESISTANCE, symbol="w"), "wheel")
    net.add(Wheel("rail", radius=WHEEL_RADIUS), "wheel", "axle")
    net.add(TranslationalSpring("frame", c=FRAME, d=DAMPING * FRAME), "axle", "crane")
    net.add(Mass("crane", m=CRANE_MASS), "crane")
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
